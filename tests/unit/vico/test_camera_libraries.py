"""Which camera belongs to whom."""

from typing import Any, cast

import pytest

from cosmic.frame.clock import WALL
from cosmic.frame.errors import ConfigError
from cosmic.frame.failure import FailurePolicy
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.core.camera_libraries import CameraLibraries
from cosmic.vico.core.settings import CameraConfig, VicoSettings
from cosmic.vico.hw.interface import CameraInfo, CameraLibrary

KEYS = {"simulated": ("one", "two"), "usb": ("eye",)}


class Library:
    """Has the cameras of a backend; opening one gives its key."""

    def __init__(self, backend: str) -> None:
        self.name = backend

    def cameras(self) -> tuple[CameraInfo, ...]:
        return tuple(CameraInfo(key, "Test", "Eye", key) for key in KEYS[self.name])

    def open(self, key: str) -> Any:
        return key

    def close(self) -> None: ...


def made(backend: str) -> CameraLibrary:
    return cast("CameraLibrary", Library(backend))


def test_a_camera_without_a_key_takes_none_that_another_is_named_by() -> None:
    anything = CameraConfig(name="anything")
    named = CameraConfig(name="named", key="one")
    libraries = CameraLibraries(made, (anything, named))
    first: Any = libraries.open(anything)  # by chance before the other
    second: Any = libraries.open(named)
    assert (first, second) == ("two", "one")


def test_a_camera_of_another_driver_cannot_be_chosen() -> None:
    cameras = (CameraConfig(name="top", key="one"), CameraConfig(name="side", backend="usb"))
    application = VicoApplication(
        made,
        lambda: None,
        lambda: None,
        VicoSettings(camera=cameras),
        clock=WALL,
        policy=FailurePolicy(),
    )
    for each in cameras:
        application.libraries.open(each)
    assert {info.key for info in application.libraries.found()} == {"one", "two", "eye"}
    with pytest.raises(ConfigError, match="eye is a camera of 'usb'"):
        application.use("top", "eye")
    assert application.unit("top").config.key == "one"
    application.use("top", "two")
    assert application.unit("top").config.key == "two"
