"""Makes the controllers that the configuration names."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final, Literal

from cosmic.mico.hw import scu3d_load, smaractctl_load
from cosmic.mico.hw.interface import Controller, Serial
from cosmic.mico.hw.joined import JoinedController
from cosmic.mico.hw.scu3d import Scu3dController
from cosmic.mico.hw.smaractctl import SmaractCtlController
from cosmic.twin.scene import Scene

if TYPE_CHECKING:
    from cosmic.mico.hw.sim_scu3d_faults import Fault, Faults

RealBackend = Literal["scu3d", "smaractctl"]
Backend = Literal["simulated", "scu3d", "smaractctl"]
_SCU: Final = "scu3d"


def make_controller(
    backend: Backend,
    *,
    library_path: str = "",
    serials: Sequence[Serial] = (),
    scene: Scene | None = None,
) -> Controller:
    """Return the controller for `backend`, not yet open; nothing moves.

    Parameters
    ----------
    backend : str
        "simulated", "scu3d" for SmarAct SCUs, or "smaractctl" for MCS2s. None ever stands in for
        another.
    library_path : str
        The vendor's library; empty looks where the system does.
    serials : sequence of int or str
        What is configured; of an MCS2 it may be a locator, for a device that is not found by
        itself.
    scene : Scene or None
        For "simulated": the platform to move; None makes four SCUs just switched on, in real time.

    Raises
    ------
    NotConnectedError
        The vendor's library is not there or does not fit.
    """
    if backend == "scu3d":
        return Scu3dController(scu3d_load.load_library(library_path))
    if backend == "smaractctl":
        locators = [each for each in serials if isinstance(each, str) and ":" in each]
        library = smaractctl_load.load_library(library_path)
        return SmaractCtlController(library, locators=locators)
    return make_simulated(scene)[0]


def join(controllers: Sequence[Controller]) -> Controller:
    """Return `controllers` as one; a single one stays what it is."""
    return controllers[0] if len(controllers) == 1 else JoinedController(controllers)


class JoinedFaults:
    """Faults of controllers of several makes; a device is counted along the wiring of all."""

    def __init__(self, parts: Sequence["Faults"]) -> None:
        self._parts = tuple(parts)

    @property
    def active(self) -> tuple["Fault", ...]:
        """The faults in force, each once."""
        return tuple(dict.fromkeys(each for part in self._parts for each in part.active))

    def inject(self, name: str, **where: Any) -> None:
        """Put a fault in force; see `Faults.inject`."""
        for part in self._parts:
            part.inject(name, **where)

    def clear(self, name: str | None = None, **where: Any) -> None:
        """End a fault, or all; see `Faults.clear`."""
        for part in self._parts:
            part.clear(name, **where)


def make_simulated(scene: Scene | None = None) -> tuple[Controller, "Faults | JoinedFaults"]:
    """Return the simulated controller, and the trouble that can be injected into it.

    A scene whose devices are of two makes gets a controller of each, joined to one.
    """
    # Imported here, so that a real rig does not load the simulation.
    from cosmic.mico.hw.sim_scu3d import load_simulated_library
    from cosmic.mico.hw.sim_smaractctl import load_simulated_library as load_simulated_smaractctl

    makes = {_SCU} if scene is None else set(scene.makes)
    controllers: list[Controller] = []
    faults: list[Faults] = []
    if _SCU in makes:
        scu = load_simulated_library(scene=scene)
        controllers.append(Scu3dController(scu, simulated=True))
        faults.append(scu.faults)
    if makes - {_SCU}:
        mcs2 = load_simulated_smaractctl(scene=scene)
        controllers.append(SmaractCtlController(mcs2, simulated=True))
        faults.append(mcs2.faults)
    return join(controllers), faults[0] if len(faults) == 1 else JoinedFaults(faults)
