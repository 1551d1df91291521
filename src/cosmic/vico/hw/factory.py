"""Makes the cameras, the lens and the lamp that the configuration names."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.plugins import Kind, make
from cosmic.vico.hw.interface import CameraContext, CameraLibrary
from cosmic.vico.hw.peripherals import Lens, LensAxis, Light, PeripheralContext

if TYPE_CHECKING:
    from cosmic.twin.scene import Scene
    from cosmic.vico.hw.interface import VideoSource
    from cosmic.vico.hw.sim_peripherals import SimPeripherals

NONE: Final = "none"
"""In place of a backend: the platform has no such thing."""


def make_camera_library(
    backend: str,
    *,
    clock: Clock | None = None,
    scene: "Scene | None" = None,
    sources: "Sequence[VideoSource | str | Path]" = (),
    producers: Sequence[Path | str] = (),
    packet_bytes: int = 0,
    options: Mapping[str, object] | None = None,
    seed: int = 0,
) -> CameraLibrary:
    """Return the cameras of `backend`; none is opened, and none stands in for another.

    Parameters
    ----------
    backend : str
        "simulated" (views of the twin), "harvesters" (GenTL producers of the vendors, extra
        ``gentl``: the usual way to GigE Vision and USB3 Vision), "aravis" (the same two on
        Linux, without anything of the vendor's), "opencv" (USB cameras, films, folders of
        images, addresses), "dc1394" (FireWire on Linux), or what another package brings
        (`cosmic.frame.plugins`). Only this one is loaded.
    clock : Clock or None
        The platform's, which stamps frames and paces simulated cameras; None is the wall's.
    scene : Scene or None
        For "simulated": what its cameras see.
    sources : sequence of VideoSource, str or Path
        For "opencv": what it plays, besides the USB cameras that Linux lists.
    producers : sequence of Path or str
        For "harvesters": the ``.cti`` files; empty: those that are installed.
    packet_bytes : int
        For "aravis": size of the packets of a GigE camera; 0 leaves it alone.
    options : mapping, or None
        The backend's own settings.
    seed : int
        For "simulated": of its faults.

    Raises
    ------
    ConfigError
        No such backend, its options are wrong, or what it needs was not given.
    NotConnectedError
        Its library or package is not installed; the text says what to install.
    """
    context = CameraContext(clock or WALL, scene, sources, producers, packet_bytes, seed)
    library: CameraLibrary = make(Kind.CAMERA, backend, context, options or {})
    return library


def make_lens(
    backend: str,
    *,
    clock: Clock | None = None,
    port: str = "",
    homed: bool = False,
    limits_counts: Mapping[LensAxis, int] | None = None,
    simulation: "SimPeripherals | None" = None,
    options: Mapping[str, object] | None = None,
) -> Lens | None:
    """Open the lens of `backend`; nothing moves. None for "none".

    Parameters
    ----------
    backend : str
        "simulated", "navitar" for a controller of either generation, or what another package
        brings. None ever stands in for another.
    clock : Clock or None
        The platform's, which paces a simulated lens; None is the wall's.
    port : str
        For "navitar": the serial port, such as "/dev/ttyUSB0" or "COM3".
    homed : bool
        It has been homed and kept under power since; not believed when both motors count 0. A
        simulated lens that was found warm has.
    simulation : SimPeripherals or None
        For "simulated": the platform's.
    options : mapping, or None
        The backend's own settings.

    Raises
    ------
    NotConnectedError
        The port is not there, or something else answers on it.
    DeviceError, ProtocolError
        The line failed right after it was opened.
    ConfigError
        There is no such backend, or no port, or no simulation, is given.
    """
    if backend == NONE:
        return None
    context = PeripheralContext(clock or WALL, port, homed, limits_counts or {}, simulation)
    lens: Lens = make(Kind.LENS, backend, context, options or {})
    return lens


def make_light(
    backend: str,
    *,
    clock: Clock | None = None,
    port: str = "",
    simulation: "SimPeripherals | None" = None,
    options: Mapping[str, object] | None = None,
) -> Light | None:
    """Open the lamp of `backend`; it goes on shining as it does. None for "none".

    Parameters, Raises
    ------------------
    As `make_lens`.
    """
    if backend == NONE:
        return None
    context = PeripheralContext(clock or WALL, port, simulation=simulation)
    light: Light = make(Kind.LIGHT, backend, context, options or {})
    return light
