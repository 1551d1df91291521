"""Aravis' wrapper where Aravis is missing, refuses, or has only its fake camera inside."""

import ctypes
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace

import pytest

from cosmic.frame.errors import (
    ConfigError,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotConnectedError,
)
from cosmic.vico.hw import aravis_ctypes as arv
from cosmic.vico.hw.aravis import AravisLibrary
from cosmic.vico.hw.base_camera import as_refusal
from cosmic.vico.hw.bus_frames import buffers_for
from cosmic.vico.hw.interface import PixelFormat


def installed() -> bool:
    try:
        arv.load_library()
    except NotConnectedError:
        return False
    return True


needs_aravis = pytest.mark.skipif(not installed(), reason="libaravis-0.8-0 is not installed")


def test_a_missing_library_is_named_with_its_package() -> None:
    with pytest.raises(NotConnectedError, match=r"libaravis-0\.8-0"):
        arv.load_library("libaravis-that-is-not-there.so")


def test_a_library_that_lacks_a_function_is_refused_by_its_name() -> None:
    with pytest.raises(NotConnectedError, match="arv_get_major_version") as caught:
        AravisLibrary(library=SimpleNamespace())
    assert caught.value.fault is DeviceFault.UNSUPPORTED


class StubAravis:
    """Answers every call with nothing, and `arv_camera_new` with an error of GLib's kind."""

    def __init__(self, domain: bytes, code: int) -> None:
        self.domain, self.code = domain, code
        self.freed = 0

    def __getattr__(self, name: str) -> object:
        if not name.startswith(("arv_", "g_")):
            raise AttributeError(name)
        return lambda *_: 0

    def arv_camera_new(self, *arguments: object) -> int:
        self.error = arv.GError(7, self.code, b"said so")
        to = ctypes.cast(arguments[-1], ctypes.POINTER(ctypes.c_void_p))  # type: ignore[arg-type]
        to[0] = ctypes.addressof(self.error)
        return 0

    def g_quark_to_string(self, quark: int) -> bytes:
        assert quark == 7
        return self.domain

    def g_error_free(self, _error: object) -> None:
        self.freed += 1


@pytest.mark.parametrize(
    ("domain", "code", "fault", "kind"),
    [
        (b"arv-device-error-quark", 5, DeviceFault.TIMEOUT, DeviceTimeout),
        (b"arv-device-error-quark", 2, DeviceFault.COMMUNICATION, DeviceError),
        (b"arv-device-error-quark", 10, DeviceFault.OVERRIDDEN, DeviceError),
        (b"arv-device-error-quark", 13, DeviceFault.PARAMETER, DeviceError),
        (b"arv-device-error-quark", 99, DeviceFault.OTHER, DeviceError),
        (b"arv-gc-error-quark", 5, DeviceFault.PARAMETER, DeviceError),
    ],
)
def test_an_error_says_who_what_and_why_and_is_freed_once(
    domain: bytes, code: int, fault: DeviceFault, kind: type[DeviceError]
) -> None:
    stub = StubAravis(domain, code)
    with pytest.raises(kind) as caught:
        arv.AravisCalls(stub).checked("camera K", "arv_camera_new", b"K")
    assert caught.value.fault is fault
    assert caught.value.code == code
    for part in ("camera K", "arv_camera_new", "said so"):
        assert part in str(caught.value)
    assert stub.freed == 1


def test_a_value_refused_by_the_camera_is_an_error_of_the_settings() -> None:
    refused = DeviceError("no", fault=DeviceFault.PARAMETER)
    gone = DeviceError("no", fault=DeviceFault.COMMUNICATION)
    assert isinstance(as_refusal(refused), ConfigError)
    assert as_refusal(gone) is gone


def test_the_pool_holds_half_a_second_within_reason() -> None:
    assert buffers_for(60.0, 1_920_000) == 30
    assert buffers_for(1.0, 1_920_000) == 8
    assert buffers_for(1000.0, 1000) == 64
    assert buffers_for(1000.0, 50_000_000) == 5


@pytest.fixture
def fake() -> Iterator[AravisLibrary]:
    library = AravisLibrary(fake=True)
    yield library
    library.close()


@needs_aravis
def test_a_format_that_the_camera_lacks_is_refused_with_those_it_has(fake: AravisLibrary) -> None:
    camera = fake.open("Fake_1")
    with pytest.raises(ConfigError, match=r"Mono12.*Mono8, Mono16, RGB8"):
        camera.configure(replace(camera.settings, pixel_format=PixelFormat.MONO12))


@needs_aravis
def test_closing_the_library_closes_its_cameras(fake: AravisLibrary) -> None:
    camera = fake.open("Fake_1")
    camera.start()
    fake.close()
    with pytest.raises(DeviceError, match="closed"):
        camera.start()
