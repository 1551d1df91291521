"""Makes the controllers that the configuration names."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.plugins import Kind, make
from cosmic.mico.hw.interface import Controller, ControllerContext, Serial
from cosmic.mico.hw.joined import JoinedController

if TYPE_CHECKING:
    from cosmic.twin.scene import Scene


def make_controller(
    backend: str,
    *,
    library_path: str = "",
    serials: Sequence[Serial] = (),
    scene: "Scene | None" = None,
    clock: Clock | None = None,
    options: Mapping[str, object] | None = None,
    seed: int = 0,
) -> Controller:
    """Return the controller for `backend`, not yet open; nothing moves.

    Parameters
    ----------
    backend : str
        "simulated", "scu3d" for SmarAct SCUs, "smaractctl" for MCS2s, or what another package
        brings (`cosmic.frame.plugins`). None ever stands in for another, and only this one is
        loaded.
    library_path : str
        The vendor's library; empty looks where the system does.
    serials : sequence of int or str
        What is configured; of an MCS2 it may be a locator, for a device that is not found by
        itself.
    scene : Scene or None
        For "simulated": the platform to move; None makes four SCUs just switched on, in real time.
    clock : Clock or None
        The platform's, which paces simulated controllers; None is the wall's.
    options : mapping, or None
        The backend's own settings.

    Raises
    ------
    ConfigError
        There is no such backend, its options are wrong, or it cannot be loaded.
    NotConnectedError
        The vendor's library is not there or does not fit.
    """
    context = ControllerContext(clock or WALL, library_path, tuple(serials), scene, seed)
    controller: Controller = make(Kind.CONTROLLER, backend, context, options or {})
    return controller


def join(controllers: Sequence[Controller]) -> Controller:
    """Return `controllers` as one; a single one of ours stays what it is.

    One that another package brings is joined even alone: what it raises then reaches nobody as
    anything but a `DeviceError` that names it.
    """
    if len(controllers) == 1 and type(controllers[0]).__module__.startswith("cosmic."):
        return controllers[0]
    return JoinedController(controllers)
