"""Makes the controller that the configuration names."""

from typing import Literal

from cosmic.mico.hw.interface import Controller
from cosmic.mico.hw.scu3d import Scu3dController
from cosmic.mico.hw.scu3d_load import load_library
from cosmic.twin.scene import Scene

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
    # Imported here, so that a real rig does not load the simulation.
    from cosmic.mico.hw.sim_scu3d import load_simulated_library

    return Scu3dController(load_simulated_library(scene=scene), simulated=True)
