"""`CameraLibraries`: the drivers in use, and which camera belongs to whom."""

import logging
from collections.abc import Callable, Iterable
from threading import RLock

from cosmic.frame.errors import ConfigError, CosmicError, NotConnectedError
from cosmic.vico.core.settings import CameraConfig
from cosmic.vico.hw.interface import Camera, CameraInfo, CameraLibrary

logger = logging.getLogger(__name__)


class CameraLibraries:
    """Opens each driver when a camera of it is first wanted; any thread.

    Parameters
    ----------
    make : callable
        Returns the library of a backend; raises `CosmicError` where it is not installed.
    configured : iterable of CameraConfig
        Cameras of the platform: one that is named by its key is no other's, opened or not.
    """

    def __init__(
        self, make: Callable[[str], CameraLibrary], configured: Iterable[CameraConfig] = ()
    ) -> None:
        self._make = make
        self._lock = RLock()
        self._libraries: dict[str, CameraLibrary] = {}
        self._taken = {each.name: (each.backend, each.key) for each in configured if each.key}
        self._found: dict[str, frozenset[str]] = {}

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
            libraries = dict(self._libraries)
        for backend, library in libraries.items():
            try:
                there = library.cameras()
            except CosmicError as exc:
                logger.warning("%s: %s", library.name, exc)
                there = ()
            self._found[backend] = frozenset(info.key for info in there)
            found += there
        return tuple(found)

    def check_backend(self, config: CameraConfig, key: str) -> None:
        """Refuse a camera that the last look found with other drivers only.

        Raises
        ------
        ConfigError
            It was; the text names the driver.
        """
        drivers = [backend for backend, keys in self._found.items() if key in keys]
        if drivers and config.backend not in drivers:
            raise ConfigError(
                f"{config.name} takes its images with {config.backend!r}, and {key} is a camera of "
                f"{drivers[0]!r}; change the backend of {config.name} in the platform file"
            )

    def close(self) -> None:
        """Give everything back."""
        with self._lock:
            for library in self._libraries.values():
                library.close()
            self._libraries.clear()
