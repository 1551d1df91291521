"""The simulated controllers of a platform: one of each make that the twin has, as one."""

from collections.abc import Sequence
from typing import Any, Final

from cosmic.frame.plugins import NoOptions
from cosmic.mico.hw.interface import Controller, ControllerBackend, ControllerContext
from cosmic.mico.hw.joined import JoinedController
from cosmic.mico.hw.scu3d import Scu3dController
from cosmic.mico.hw.sim_faults import Fault, Faults
from cosmic.mico.hw.sim_scu3d import load_simulated_library as load_simulated_scu3d
from cosmic.mico.hw.sim_smaractctl import load_simulated_library as load_simulated_smaractctl
from cosmic.mico.hw.smaractctl import SmaractCtlController
from cosmic.twin.scene import Scene

SCU: Final = "scu3d"
MCS2: Final = "smaractctl"


class JoinedFaults:
    """Faults of controllers of several makes; a device is counted along the wiring of all."""

    def __init__(self, parts: Sequence[Faults]) -> None:
        self._parts = tuple(parts)

    @property
    def active(self) -> tuple[Fault, ...]:
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


class SimulatedScus(Scu3dController):
    """The SCUs of the twin, and the trouble that can be injected into them."""

    def __init__(self, scene: Scene | None) -> None:
        library = load_simulated_scu3d(scene=scene)
        self.faults = library.faults
        super().__init__(library, simulated=True)


class SimulatedMcs2s(SmaractCtlController):
    """The MCS2s of the twin, and the trouble that can be injected into them."""

    def __init__(self, scene: Scene | None) -> None:
        library = load_simulated_smaractctl(scene=scene)
        self.faults = library.faults
        super().__init__(library, simulated=True)


class SimulatedMakes(JoinedController):
    """The controllers of a twin whose devices are of several makes."""

    def __init__(self, parts: "Sequence[SimulatedScus | SimulatedMcs2s]") -> None:
        super().__init__(parts)
        self.faults = JoinedFaults([each.faults for each in parts])


def make_simulated(scene: Scene | None = None) -> SimulatedScus | SimulatedMcs2s | SimulatedMakes:
    """Return the simulated controller; without a scene four SCUs just switched on, in real time.

    A scene whose devices are of two makes gets a controller of each, joined to one.
    """
    makes = {SCU} if scene is None else set(scene.makes)
    parts: list[SimulatedScus | SimulatedMcs2s] = []
    if SCU in makes:
        parts.append(SimulatedScus(scene))
    if makes - {SCU}:
        parts.append(SimulatedMcs2s(scene))
    return parts[0] if len(parts) == 1 else SimulatedMakes(parts)


def _make(_options: NoOptions, context: ControllerContext) -> Controller:
    return make_simulated(context.scene)


BACKEND: Final = ControllerBackend(_make, simulated=True, twin=True)
