"""`CameraLibraries`: the drivers in use, and which camera belongs to whom."""

import logging
from collections.abc import Callable
from threading import RLock

from cosmic.frame.errors import CosmicError, NotConnectedError
from cosmic.vico.core.settings import CameraConfig
from cosmic.vico.hw.interface import Camera, CameraInfo, CameraLibrary

logger = logging.getLogger(__name__)


class CameraLibraries:
    """Opens each driver when a camera of it is first wanted; any thread.

    Parameters
    ----------
    make : callable
        Returns the library of a backend; raises `CosmicError` where it is not installed.
    """

    def __init__(self, make: Callable[[str], CameraLibrary]) -> None:
        self._make = make
        self._lock = RLock()
        self._libraries: dict[str, CameraLibrary] = {}
        self._taken: dict[str, tuple[str, str]] = {}

    def library(self, backend: str) -> CameraLibrary:
        """Return the driver of a backend; raises `CosmicError` where it is not there."""
        with self._lock:
            if backend not in self._libraries:
                self._libraries[backend] = self._make(backend)
            return self._libraries[backend]

    def open(self, config: CameraConfig) -> Camera:
        """Open the camera that `place` names, or the first that no other point has.

        Raises
        ------
        NotConnectedError
            It is not there; the text lists those there are.
        """
        with self._lock:
            library = self.library(config.backend)
            key = config.key or self._free_key(library, config)
            camera = library.open(key)
            self._taken[config.name] = (config.backend, key)
            return camera

    def _free_key(self, library: CameraLibrary, config: CameraConfig) -> str:
        others = {taken for name, taken in self._taken.items() if name != config.name}
        there = library.cameras()
        for info in there:
            if (config.backend, info.key) not in others:
                return info.key
        known = ", ".join(info.key for info in there) or "none"
        raise NotConnectedError(
            f"{config.name}: {library.name} has no camera that is free; there are: {known}"
        )

    def found(self) -> tuple[CameraInfo, ...]:
        """Look for the cameras of every driver in use; one that cannot tell is logged."""
        found: list[CameraInfo] = []
        with self._lock:
            libraries = tuple(self._libraries.values())
        for library in libraries:
            try:
                found += library.cameras()
            except CosmicError as exc:
                logger.warning("%s: %s", library.name, exc)
        return tuple(found)

    def close(self) -> None:
        """Give everything back."""
        with self._lock:
            for library in self._libraries.values():
                library.close()
            self._libraries.clear()
