"""Loading a real shared library, as far as that goes without SmarAct's."""

import ctypes
import ctypes.util
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import pytest

from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.mico.hw import scu3d_ctypes as sa
from cosmic.mico.hw import smaract_load as load
from cosmic.mico.hw.interface import Channel, PositionRead
from cosmic.mico.hw.scu3d import Scu3dController

COMPILER = shutil.which("gcc") or shutil.which("cc")
BITS = struct.calcsize("P") * 8

# One device with serial number 7, whose position is always -1.5 um; it lacks most functions.
SOURCE = """
struct packet { unsigned type, channel, data1; int data2, data3; };
static int questions;
unsigned SA_GetDLLVersion(unsigned *version) { *version = 0x01020003; return 0; }
unsigned SA_GetAvailableDevices(unsigned *ids, unsigned *size)
{ if (*size < 1) return 17; ids[0] = 7; *size = 1; return 0; }
unsigned SA_ClearInitDevicesList(void) { return 0; }
unsigned SA_InitDevices(unsigned mode) { return mode == 1 ? 0 : 9; }
unsigned SA_ReleaseDevices(void) { return 0; }
unsigned SA_GetNumberOfDevices(unsigned *number) { *number = 1; return 0; }
unsigned SA_GetDeviceID(unsigned device, unsigned *id) { *id = 7; return device ? 5 : 0; }
unsigned SA_GetDeviceFirmwareVersion(unsigned device, unsigned *version)
{ *version = 0x03040005; return device ? 5 : 0; }
unsigned SA_GetPosition_A(unsigned device, unsigned channel)
{ if (device) return 5; if (channel > 2) return 6; questions++; return 0; }
unsigned SA_MovePositionAbsolute_A(unsigned d, unsigned c, int position, unsigned hold)
{ return d == 0 && c == 2 && position == -15 && hold == 60000 ? 0 : 9; }
unsigned SA_ReceiveNextPacket_A(unsigned device, unsigned timeout, struct packet *packet)
{
    packet->type = 0;
    if (questions) { questions--; packet->type = 2; packet->channel = 2; packet->data2 = -15; }
    return device ? 5 : 0;
}
"""


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    if COMPILER is None or sys.platform == "win32":
        pytest.skip("needs a C compiler for this system")
    folder = tmp_path_factory.mktemp("with space")
    source, library = folder / "scu.c", folder / "libscu3dcontrol.so"
    source.write_text(SOURCE)
    subprocess.run([COMPILER, "-shared", "-fPIC", "-o", str(library), str(source)], check=True)
    return library


def test_a_compiled_library_is_loaded_and_driven(compiled: Path) -> None:
    controller = Scu3dController(load.load_library(str(compiled)))
    assert controller.name == "SCU3DControl 1.2.3"
    assert controller.find_devices() == (7,)
    assert [device.firmware for device in controller.open([])] == ["3.4.5"]
    controller.move_to(Channel(0, 2), -1.5, "um", hold_s=float("inf"))
    controller.ask_position(Channel(0, 2), "um")
    assert controller.receive(0, 0.1) == PositionRead(Channel(0, 2), -1.5, "um")
    assert controller.receive(0, 0.0) is None
    with pytest.raises(DeviceError) as caught:
        controller.ask_position(Channel(0, 3), "um")
    assert caught.value.fault is DeviceFault.NO_CHANNEL
    controller.close()


def test_a_function_that_a_compiled_library_lacks_is_unsupported(compiled: Path) -> None:
    library = sa.Scu3dLibrary(load.load_library(str(compiled)))
    assert library.has("SA_GetPosition_A")
    assert not library.has("SA_Stop_A")
    assert library.call("SA_Stop_A", 0, 0) == sa.SA_COMMAND_NOT_SUPPORTED_ERROR


def test_a_missing_file_is_named_with_what_to_install(tmp_path: Path) -> None:
    path = str(tmp_path / "SCU3DControl.dll")
    with pytest.raises(NotConnectedError) as caught:
        load.load_library(path)
    text = str(caught.value)
    for part in (path, "SmarAct SCU SDK", "SCU3DControl.dll", "libscu3dcontrol.so", f"{BITS} bit"):
        assert part in text


@pytest.mark.parametrize("content", [b"", b"not a library", b"\x7fELF\x01\x01\x01" + bytes(64)])
def test_a_file_that_is_no_fitting_library_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "libscu3dcontrol.so"
    path.write_bytes(content)
    with pytest.raises(NotConnectedError, match=f"{BITS} bit"):
        load.load_library(str(path))


def test_a_path_with_a_zero_byte_is_refused() -> None:
    with pytest.raises(NotConnectedError):
        load.load_library("lib\0scu.so")


@pytest.mark.parametrize(
    ("platform", "name"), [("win32", "SCU3DControl.dll"), ("linux", "libscu3dcontrol.so")]
)
def test_an_empty_path_means_the_name_that_the_system_looks_for(
    monkeypatch: pytest.MonkeyPatch, platform: str, name: str
) -> None:
    tried: list[str] = []

    def refuse(path: str) -> ctypes.CDLL:
        tried.append(path)
        raise OSError("not here")

    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(ctypes, "CDLL", refuse)
    monkeypatch.setattr(ctypes.util, "find_library", lambda _: None)
    with pytest.raises(NotConnectedError, match=f"'{name}'.*not here"):
        load.load_library()
    assert tried == [name]


def test_a_bare_name_is_looked_for_along_path_on_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    tried: list[str] = []

    def refuse(path: str) -> ctypes.CDLL:
        tried.append(path)
        raise OSError

    monkeypatch.setattr(sys, "platform", "win32")
    monkeypatch.setattr(ctypes, "CDLL", refuse)
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: f"C:/SmarAct/{name}")
    for path in ("", "D:/sdk/SCU3DControl.dll"):
        with pytest.raises(NotConnectedError):
            load.load_library(path)
    assert tried == ["C:/SmarAct/SCU3DControl.dll", "D:/sdk/SCU3DControl.dll"]


@pytest.mark.skipif(sys.platform != "linux", reason="loads a library of Linux")
def test_another_library_is_distinguished_from_smaracts() -> None:
    with pytest.raises(NotConnectedError, match="no function SA_InitDevices"):
        load.load_library(ctypes.util.find_library("c") or "libc.so.6")
