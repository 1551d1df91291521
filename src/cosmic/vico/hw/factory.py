"""Makes the cameras, the lens and the lamp that the configuration names."""

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import ConfigError, CosmicError, DeviceFault, NotConnectedError
from cosmic.frame.plugins import Kind, make
from cosmic.vico.hw.brightlight import BrightLight
from cosmic.vico.hw.interface import CameraContext, CameraLibrary
from cosmic.vico.hw.navitar import NavitarLens, counts_anew
from cosmic.vico.hw.navitar_protocol import Found, Product, probe
from cosmic.vico.hw.peripherals import Lens, LensAxis, Light
from cosmic.vico.hw.serial_port import SerialPort, open_serial_port

if TYPE_CHECKING:
    from cosmic.twin.scene import Scene
    from cosmic.vico.hw.interface import VideoSource
    from cosmic.vico.hw.sim_line import SimLine
    from cosmic.vico.hw.sim_peripherals import SimPeripherals

logger = logging.getLogger(__name__)

LensBackend = Literal["simulated", "navitar", "none"]
LightBackend = Literal["simulated", "brightlight", "none"]


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
    backend: LensBackend,
    *,
    port: str = "",
    homed: bool = False,
    limits_counts: Mapping[LensAxis, int] | None = None,
    simulation: "SimPeripherals | None" = None,
) -> Lens | None:
    """Open the lens of `backend`; nothing moves. None for "none".

    Parameters
    ----------
    backend : str
        "simulated", or "navitar" for a controller of either generation. Neither stands in for
        the other.
    port : str
        For "navitar": the serial port, such as "/dev/ttyUSB0" or "COM3".
    homed : bool
        It has been homed and kept under power since; not believed when both motors count 0. A
        simulated lens that was found warm has.
    simulation : SimPeripherals or None
        For "simulated": the platform's.

    Raises
    ------
    NotConnectedError
        The port is not there, or something else answers on it.
    DeviceError, ProtocolError
        The line failed right after it was opened.
    ConfigError
        No port, or no simulation, is given.
    """
    if backend == "none":
        return None
    if backend == "simulated":
        line = _given(simulation).lens_line
        # The simulated controller remembers nothing either; the morning after does.
        homed = homed or not _given(simulation).lens.cold
        found = probe(_line_to(line, "simulated lens"))
    else:
        found = probe(open_serial_port(_named(port, backend)))
    _expect(found, "a lens controller", Product.MOTORS, Product.MOTORS_2)
    kind = "simulated lens" if backend == "simulated" else "Navitar"
    name = f"{kind}, generation {found.generation}"
    homed = homed and _believable(found)
    return NavitarLens(found.registers, name=name, homed=homed, limits_counts=limits_counts)


def make_light(
    backend: LightBackend, *, port: str = "", simulation: "SimPeripherals | None" = None
) -> Light | None:
    """Open the lamp of `backend`; it goes on shining as it does. None for "none".

    Raises
    ------
    NotConnectedError
        The port is not there, or something else answers on it.
    ConfigError
        No port, or no simulation, is given.
    """
    if backend == "none":
        return None
    if backend == "simulated":
        found = probe(_line_to(_given(simulation).light_line, "simulated light"))
    else:
        found = probe(open_serial_port(_named(port, backend)))
    _expect(found, "a BrightLight", Product.BRIGHTLIGHT)
    name = "simulated BrightLight" if backend == "simulated" else "BrightLight"
    return BrightLight(found.registers, name=name)


def _line_to(line: "SimLine", name: str) -> SerialPort:
    # Imported here, so that a real rig does not load the simulation.
    from cosmic.vico.hw.sim_line import SimSerial

    return SerialPort(SimSerial(line), name)


def _given(simulation: "SimPeripherals | None") -> "SimPeripherals":
    if simulation is None:
        raise ConfigError("a simulated lens or light needs the twin of the platform")
    return simulation


def _named(port: str, backend: str) -> str:
    if not port:
        raise ConfigError(f"backend {backend!r} needs a port, such as /dev/ttyUSB0 or COM3")
    return port


def _believable(found: Found) -> bool:
    """Whether the counters can be those of a lens that was homed."""
    try:
        anew = counts_anew(found.registers)
    except CosmicError:
        found.registers.close()
        raise
    if anew:
        logger.warning(
            "%s: both motors report 0, as after power-up; home the lens", found.registers.name
        )
    return not anew


def _expect(found: Found, what: str, *products: Product) -> None:
    if found.product not in products:
        found.registers.close()
        raise NotConnectedError(
            f"{found.registers.name}: {what} was expected, a {found.product.name} answers "
            f"({found.product:#x}); are the ports of lens and light exchanged?",
            fault=DeviceFault.COMMUNICATION,
        )
