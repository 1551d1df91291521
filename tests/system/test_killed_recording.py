"""A process that records is killed with -9: the next start closes its file, for every program."""

import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

import cosmic

RECORD = """
import sys
import cosmic

rig = cosmic.connect(applications=("daqco",))
rig.daqco.start()
rig.daqco.start_recording(sys.argv[1])
print("recording", flush=True)
sys.stdin.read()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL is POSIX's")
def test_the_next_start_closes_the_recording_of_a_killed_process(tmp_path: Path) -> None:
    path = tmp_path / "push.h5"
    process = subprocess.Popen(
        [sys.executable, "-c", RECORD, str(path)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        assert process.stdout.readline() == "recording\n"
        with cosmic.connect(applications=("daqco",)), pytest.raises(OSError, match="already open"):
            h5py.File(path, "r")  # its writer lives
        samples = 0
        while samples < 2000:
            with h5py.File(path, "r", swmr=True) as file:
                samples = file["volts"].shape[1]
    finally:
        process.kill()
        process.communicate()
    with pytest.raises(OSError, match="already open for write"):
        h5py.File(path, "r")
    with cosmic.connect(applications=("daqco",)), h5py.File(path) as file:
        assert np.isfinite(file["volts"][:, :2000]).all()
        assert file["chunks"].shape[0] > 0
        assert not file["complete"][()]
    with cosmic.connect(applications=("daqco",)) as rig:
        rig.daqco.start()
        with rig.daqco.record(tmp_path / "next.h5"):
            pass
    with h5py.File(tmp_path / "next.h5") as file:
        assert file["complete"][()]
