"""Programs written for the vendors' libraries load a file that forwards to the simulation."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SRC = Path(__file__).parents[2] / "src"
CLIENTS = {
    "scu3d": """
n = ct.c_uint()
assert lib.SA_InitDevices(0) == 0
assert lib.SA_GetNumberOfDevices(ct.byref(n)) == 0
print("devices", n.value)
assert lib.SA_ReleaseDevices() == 0
""",
    "smaractctl": """
text, size, handle = ct.create_string_buffer(500), ct.c_size_t(500), ct.c_uint32()
lib.SA_CTL_GetResultInfo.restype = ct.c_char_p
assert b"NO_SENSOR" in lib.SA_CTL_GetResultInfo(0x103)
assert lib.SA_CTL_FindDevices(None, text, ct.byref(size)) == 0
print("devices", len(text.value.split()))
assert lib.SA_CTL_Open(ct.byref(handle), text.value.split()[0], None) == 0
assert lib.SA_CTL_Move(handle, ct.c_int8(0), ct.c_int64(10**8), 0) == 0
event = ct.create_string_buffer(32)
assert lib.SA_CTL_WaitForEvent(handle, event, 5000) == 0
position = ct.c_int64()
assert lib.SA_CTL_GetProperty_i64(handle, ct.c_int8(0), 0x0305001D, ct.byref(position), None) == 0
assert abs(position.value - 10**8) < 10**6, position.value
assert lib.SA_CTL_Close(handle) == 0
""",
}


@pytest.mark.skipif(shutil.which("gcc") is None or os.name == "nt", reason="needs gcc")
@pytest.mark.parametrize(
    ("make", "folder"), [*((make, "") for make in sorted(CLIENTS)), ("scu3d", "100 %s of %s")]
)
def test_a_program_that_knows_the_header_alone_moves_a_simulated_stage(
    make: str, folder: str, tmp_path: Path
) -> None:
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(SRC), str(tmp_path / folder)])}
    command = [sys.executable, "-m", "cosmic", "simulate", "library", make, "--out", str(tmp_path)]
    built = subprocess.run(
        [*command, "--layout", "LLL,RNN", "--rate", "50"],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    client = f"import ctypes as ct\nlib = ct.CDLL({built.stdout.strip()!r})\n{CLIENTS[make]}"
    ran = subprocess.run(
        [sys.executable, "-c", client],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert (ran.returncode, ran.stdout) == (0, "devices 2\n"), ran.stderr
