"""Makes the controller that the configuration names."""

from typing import TYPE_CHECKING, Literal

from cosmic.mico.hw.interface import Controller
from cosmic.mico.hw.scu3d import Scu3dController
from cosmic.mico.hw.scu3d_load import load_library
from cosmic.twin.scene import Scene

if TYPE_CHECKING:
    from cosmic.mico.hw.sim_scu3d_faults import Faults

Backend = Literal["simulated", "scu3d"]


def make_controller(
    backend: Backend, *, library_path: str = "", scene: Scene | None = None
) -> Controller:
    """Return the controller for `backend`, not yet open; nothing moves.

    Parameters
    ----------
    backend : str
        "simulated", or "scu3d" for SmarAct SCUs. Neither ever stands in for the other.
    library_path : str
        For "scu3d": the vendor's library; empty looks where the system does.
    scene : Scene or None
        For "simulated": the platform to move; None makes four devices just switched on, in real
        time.

    Raises
    ------
    NotConnectedError
        The vendor's library is not there or does not fit.
    """
    if backend == "scu3d":
        return Scu3dController(load_library(library_path))
    return make_simulated(scene)[0]


def make_simulated(scene: Scene | None = None) -> tuple[Controller, "Faults"]:
    """Return the simulated controller, and the trouble that can be injected into it."""
    # Imported here, so that a real rig does not load the simulation.
    from cosmic.mico.hw.sim_scu3d import load_simulated_library

    library = load_simulated_library(scene=scene)
    return Scu3dController(library, simulated=True), library.faults
