"""USB cameras, films, folders of pictures and network addresses through OpenCV."""

import threading
from collections.abc import Sequence
from pathlib import Path

import cv2
from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import DeviceFault, NotConnectedError
from cosmic.vico.hw.interface import Camera, CameraInfo, CameraLibrary
from cosmic.vico.hw.opencv_camera import FilmCamera, OpenCvCamera
from cosmic.vico.hw.opencv_film import open_film
from cosmic.vico.hw.opencv_live import LiveCamera, MakeCapture, open_capture
from cosmic.vico.hw.opencv_source import SYSFS, Kind, VideoSource, attached_devices


class OpenCvLibrary(CameraLibrary):
    """What OpenCV's VideoCapture reads; any thread.

    Parameters
    ----------
    clock : Clock
        The platform's: stamps frames and paces films.
    sources : sequence of VideoSource, str or Path
        What is listed besides the devices that Linux knows, with how it is played. The path of
        a film or a folder (played again and again) and an address open without being named here.
    sysfs : Path
        Where Linux lists video devices.
    make_capture : callable
        cv2.VideoCapture, or what tests put in its place for devices and addresses.
    """

    def __init__(
        self,
        clock: Clock = WALL,
        *,
        sources: Sequence[VideoSource | str | Path] = (),
        sysfs: Path = SYSFS,
        make_capture: MakeCapture = cv2.VideoCapture,
    ) -> None:
        self._clock = clock
        self._sysfs = sysfs
        self._make_capture = make_capture
        made = [
            each if isinstance(each, VideoSource) else VideoSource(str(each)) for each in sources
        ]
        self._sources = {each.address: each for each in made}
        self._cameras: list[Camera] = []
        self._lock = threading.Lock()
        self._closed = False

    @property
    @override
    def name(self) -> str:
        return f"OpenCV {cv2.__version__}"

    @override
    def cameras(self) -> tuple[CameraInfo, ...]:
        attached = {each.key: each for each in attached_devices(self._sysfs)}
        named = {each.address: each.info for each in self._sources.values() if each.is_there}
        return tuple({**named, **attached}.values())

    @override
    def open(self, key: str) -> OpenCvCamera:
        listed = {each.key: each for each in self.cameras()}
        source = self._sources.get(key, VideoSource(key, loop=True))
        if self._closed or (key not in listed and not _can_be_tried(source)):
            raise NotConnectedError(
                f"OpenCV: there is no camera {key!r}; there are: {', '.join(listed) or 'none'}",
                fault=DeviceFault.COMMUNICATION,
            )
        camera = self._open(listed.get(key, source.info), source)
        with self._lock:
            self._cameras.append(camera)
        return camera

    @override
    def close(self) -> None:
        self._closed = True
        with self._lock:
            cameras = tuple(self._cameras)
        for camera in cameras:
            camera.close()

    def _open(self, info: CameraInfo, source: VideoSource) -> OpenCvCamera:
        if source.kind in (Kind.FILM, Kind.PICTURES):
            return FilmCamera(source, open_film(source), self._clock, self._forget)

        def opened() -> object:
            return open_capture(source, self._make_capture)

        return LiveCamera(info, source, opened(), self._clock, reopen=opened, closed=self._forget)

    def _forget(self, camera: Camera) -> None:
        with self._lock:
            if camera in self._cameras:
                self._cameras.remove(camera)


def _can_be_tried(source: VideoSource) -> bool:
    return source.kind is Kind.ADDRESS or (source.kind is not Kind.DEVICE and source.is_there)
