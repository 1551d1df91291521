"""What is left when the program is killed, the disk fills, or a file is damaged."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cosmic.frame.errors import RecordingError
from cosmic.vico.core.recording.formats import ImageFormat
from cosmic.vico.core.recording.image_file import ImageFile
from cosmic.vico.core.recording.reading import open_image_recording
from cosmic.vico.core.recording.side_row import row_of
from unit.vico.recording.image_helpers import AXES, image, noise

TESTS = Path(__file__).resolve().parents[3]
SECONDS = 1.6
PYTHONPATH = os.pathsep.join([str(TESTS), os.environ.get("PYTHONPATH", "")])
CHILD_ENVIRONMENT = {**os.environ, "PYTHONPATH": PYTHONPATH}


def child(*arguments):
    return subprocess.Popen(
        [sys.executable, *arguments],
        env=CHILD_ENVIRONMENT,
        stdout=subprocess.PIPE,
        text=True,
    )


KILLED = (
    ImageFormat.FFV1,
    ImageFormat.FAST,
    ImageFormat.STACK,
    ImageFormat.ZARR,
    ImageFormat.TIFF,
)


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    """Recordings of killed processes, with the times at which their images came."""
    directory = tmp_path_factory.mktemp("killed")
    script = str(Path(__file__).with_name("kill_child.py"))
    processes = {each: child(script, str(directory / each), each.value) for each in KILLED}
    found = {}
    try:
        for image_format, process in processes.items():
            times_s = [0.0]
            while times_s[-1] < SECONDS:
                times_s.append(float(process.stdout.readline().split()[1]))
            process.send_signal(signal.SIGKILL)
            times_s += [float(line.split()[1]) for line in process.stdout if line.endswith("\n")]
            found[image_format] = (directory / f"{image_format}.csv", np.array(times_s[1:]))
    finally:
        for process in processes.values():
            process.kill()
            process.wait(10.0)
            process.stdout.close()
    return found


@pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL is POSIX's")
@pytest.mark.parametrize("image_format", KILLED)
def test_after_a_kill_all_but_the_last_second_is_there(killed, image_format):
    path, times_s = killed[image_format]
    old_enough = int((times_s <= times_s[-1] - 1.0).sum())
    shots = [noise(width=160, height=120, seed=seed) for seed in range(8)]
    with open_image_recording(path) as found:
        assert not found.complete
        assert len(found) >= old_enough > 10
        assert np.isfinite(found.time_s).sum() >= old_enough
        read = list(found)
        assert len(read) == len(found)
        for number, each in enumerate(read):
            np.testing.assert_array_equal(each.data, shots[number % 8])
            assert each.row is None or each.row.frame_id == number
        np.testing.assert_array_equal(found[7].data, shots[7])


FILL = """
import resource, sys
from pathlib import Path
resource.setrlimit(resource.RLIMIT_FSIZE, (150_000, 150_000))
from cosmic.frame.failure import FailurePolicy
from cosmic.vico.core.recording.formats import ImageFormat
from cosmic.vico.core.recording.image_recorder import ImageRecorder
from unit.vico.recording.image_helpers import noise, image, settings
recorder = ImageRecorder(Path(sys.argv[1]), ImageFormat(sys.argv[2]), settings(), FailurePolicy())
recorder.start()
for number in range(40):
    recorder.put(image(number, noise(width=160, height=120, seed=number)))
recorder.request_end()
assert recorder.join()
print(recorder.error)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="limits of files are POSIX's")
@pytest.mark.parametrize("image_format", [ImageFormat.FFV1, ImageFormat.FAST])
def test_a_file_that_cannot_grow_keeps_what_was_written_and_says_so(tmp_path, image_format):
    process = child("-c", FILL, str(tmp_path / "run"), image_format.value)
    said, _ = process.communicate(timeout=30.0)
    assert process.returncode == 0
    assert "writing failed (File too large)" in said
    with open_image_recording(tmp_path / "run.csv") as found:
        assert not found.complete
        assert 3 <= len(found) <= 8
        for number, each in enumerate(found):
            np.testing.assert_array_equal(each.data, noise(width=160, height=120, seed=number))
        # Those that came after the failure were refused.
        assert [row.frame_id for row in found.rows] == list(range(len(found.rows)))
        assert len(found.rows) > len(found)
        assert found.rows[-1].status == "dropped"


def recorded(path, image_format, count=10):
    file = ImageFile(path, image_format, axes=AXES)
    for number in range(count):
        shot = image(number, noise(width=160, height=120, seed=number))
        file.append(shot.data, row_of(shot, None))
    file.close(complete=True)
    return file.path


@pytest.mark.parametrize("image_format", [ImageFormat.FFV1, ImageFormat.TIFF])
def test_a_damaged_image_is_reported_and_never_shown_as_good(tmp_path, image_format):
    path = recorded(tmp_path / "run", image_format)
    target = path / "run_000005.tif" if path.is_dir() else path
    content = bytearray(target.read_bytes())
    if path.is_dir():
        del content[len(content) // 2 :]
    else:
        content[len(content) // 2] ^= 0x55
    target.write_bytes(content)
    with open_image_recording(path) as found, pytest.raises(RecordingError, match="run"):
        for number, each in enumerate(found):
            np.testing.assert_array_equal(
                each.data, noise(width=160, height=120, seed=number), strict=True
            )


@pytest.mark.parametrize("cut", [0.1, 0.5, 0.93])
@pytest.mark.parametrize("image_format", [ImageFormat.FFV1, ImageFormat.FAST])
def test_a_file_cut_off_anywhere_gives_the_images_before(tmp_path, image_format, cut):
    path = recorded(tmp_path / "run", image_format)
    content = path.read_bytes()
    path.write_bytes(content[: int(cut * len(content))])
    lines = (tmp_path / "run.csv").read_text().splitlines(keepends=True)
    (tmp_path / "run.csv").write_text("".join(lines[:4]) + lines[4][:20])
    with open_image_recording(path) as found:
        assert not found.complete
        assert len(found) >= int(10 * cut) - 1
        read = list(found)
        assert len(read) == len(found)
        for number, each in enumerate(read):
            np.testing.assert_array_equal(each.data, noise(width=160, height=120, seed=number))
            assert (each.row is None) == (number >= 3)


def test_images_without_a_side_file_can_still_be_read(tmp_path):
    path = recorded(tmp_path / "run", ImageFormat.FFV1, 3)
    (tmp_path / "run.csv").unlink()
    with open_image_recording(path) as found:
        assert len(found) == 3
        assert [each.row for each in found] == [None] * 3


@pytest.mark.parametrize("name", ["none.mkv", "none", "none.csv"])
def test_a_recording_that_is_not_there_is_reported(tmp_path, name):
    with pytest.raises(RecordingError, match="there is no such recording"):
        open_image_recording(tmp_path / name)


def test_files_that_are_something_else_are_reported(tmp_path):
    (tmp_path / "a.mkv").write_bytes(b"no video")
    with pytest.raises(RecordingError, match="damaged"):
        open_image_recording(tmp_path / "a.mkv")
    (tmp_path / "b.mkv").touch()
    (tmp_path / "b.csv").write_text("x,y\n1,2\n")
    with pytest.raises(RecordingError, match="not a side file"):
        open_image_recording(tmp_path / "b.mkv")
    recorded(tmp_path / "c", ImageFormat.FFV1, 2)
    text = (tmp_path / "c.csv").read_text().replace("100.05,", "soon,")
    (tmp_path / "c.csv").write_text(text)
    with pytest.raises(RecordingError, match=r"c\.csv, line 3: .* cannot be read"):
        open_image_recording(tmp_path / "c.mkv")
