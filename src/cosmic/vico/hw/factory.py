"""Makes the cameras that the configuration names."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import ConfigError
from cosmic.vico.hw.interface import CameraLibrary

if TYPE_CHECKING:
    from cosmic.twin.scene import Scene
    from cosmic.vico.hw.opencv_source import VideoSource

Backend = Literal["simulated", "aravis", "opencv", "dc1394", "harvesters"]


def make_camera_library(
    backend: Backend,
    *,
    clock: Clock | None = None,
    scene: "Scene | None" = None,
    sources: "Sequence[VideoSource | str | Path]" = (),
    producers: Sequence[Path | str] = (),
    packet_bytes: int = 0,
    seed: int = 0,
) -> CameraLibrary:
    """Return the cameras of `backend`; none is opened, and none stands in for another.

    Parameters
    ----------
    backend : str
        "simulated" (views of the twin), "aravis" (GigE Vision and USB3 Vision on Linux),
        "opencv" (USB cameras, films, folders of pictures, addresses), "dc1394" (FireWire on
        Linux), "harvesters" (GenTL producers of the vendors, extra ``gentl``).
    clock : Clock or None
        The platform's, which stamps frames and paces simulated cameras; None is the wall's.
    scene : Scene or None
        For "simulated": what its cameras see.
    sources : sequence of VideoSource, str or Path
        For "opencv": what it plays, besides the USB cameras that Linux lists.
    producers : sequence of Path or str
        For "harvesters": the ``.cti`` files.
    packet_bytes : int
        For "aravis": size of the packets of a GigE camera; 0 leaves it alone.
    seed : int
        For "simulated": of its faults.

    Raises
    ------
    ConfigError
        No such backend, or what it needs was not given.
    NotConnectedError
        Its library or package is not installed; the text says what to install.
    """
    if backend not in _BACKENDS:
        raise ConfigError(
            f"cameras: there is no backend {backend!r}; there are {', '.join(_BACKENDS)}"
        )
    # Imported here and below, so that each platform loads its own backend only.
    if backend == "simulated":
        return _simulated(scene, clock or WALL, seed)
    if backend == "aravis":
        from cosmic.vico.hw.aravis_library import AravisLibrary

        return AravisLibrary(clock or WALL, packet_bytes=packet_bytes)
    if backend == "opencv":
        from cosmic.vico.hw.opencv_library import OpenCvLibrary

        return OpenCvLibrary(clock or WALL, sources=sources)
    if backend == "dc1394":
        from cosmic.vico.hw.dc1394_library import Dc1394Library

        return Dc1394Library(clock or WALL)
    if not producers:
        raise ConfigError("cameras: harvesters: name the .cti file of a GenTL producer at least")
    from cosmic.vico.hw.harvesters_library import HarvestersLibrary

    return HarvestersLibrary(clock or WALL, producers=producers)


_BACKENDS = ("simulated", "aravis", "opencv", "dc1394", "harvesters")


def _simulated(scene: "Scene | None", clock: Clock, seed: int) -> CameraLibrary:
    from cosmic.vico.hw.sim_camera_library import SimulatedCameraLibrary

    if scene is None or scene.optics is None:
        raise ConfigError("cameras: simulated: a scene is needed, for there is nothing to see")
    return SimulatedCameraLibrary(scene, clock, seed)
