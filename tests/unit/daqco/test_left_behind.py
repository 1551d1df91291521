"""What a killed process left open is closed at the next start, or by hand; nothing else is."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
import pytest

from cosmic.app.cli import main
from cosmic.daqco.api.recording import open_recording
from cosmic.daqco.core import left_behind
from cosmic.daqco.core.left_behind import OpenRecordings, Outcome, close_left_open
from cosmic.daqco.core.recording_file import RecordingFile
from cosmic.daqco.core.unclosed_file import FLAGS_AT, LENGTH
from cosmic.frame.errors import RecordingError
from unit.daqco.recording_helpers import chunks, header, volts_of

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL is POSIX's")

TESTS = str(Path(__file__).resolve().parents[2])
SAMPLES = 5000
CHILD = """
import sys
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from cosmic.daqco.core.left_behind import OpenRecordings
from cosmic.daqco.core.recording_file import RecordingFile
from unit.daqco.recording_helpers import chunks, header, volts_of

path, notes = Path(sys.argv[2]), OpenRecordings(Path(sys.argv[3]))
head = header()
file = RecordingFile(path, head)
notes.note(path)
for chunk in chunks(head, volts_of(2, int(sys.argv[4])), 10):
    file.append(chunk)
file.flush()
print("written", flush=True)
sys.stdin.read()
"""


@dataclass
class Recorders:
    """Processes that record until they are killed."""

    notes: Path
    running: list["subprocess.Popen[str]"] = field(default_factory=list)

    def start(self, path: Path) -> "subprocess.Popen[str]":
        command = [sys.executable, "-c", CHILD, TESTS, str(path), str(self.notes), str(SAMPLES)]
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        self.running.append(process)
        assert process.stdout is not None
        assert process.stdout.readline() == "written\n"
        return process

    def end(self) -> None:
        for process in self.running:
            process.kill()
            process.communicate()
        self.running.clear()


@pytest.fixture
def recorders(tmp_path: Path) -> Iterator[Recorders]:
    made = Recorders(tmp_path / "notes")
    yield made
    made.end()


@pytest.fixture(scope="module")
def left(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of a process that was killed; for copies."""
    folder = tmp_path_factory.mktemp("left")
    made = Recorders(folder / "notes")
    made.start(folder / "push.h5")
    made.end()
    return folder / "push.h5"


@pytest.fixture
def killed(left: Path, tmp_path: Path) -> Path:
    return Path(shutil.copy(left, tmp_path / "push.h5"))


def check_all_is_there(path: Path) -> None:
    """Read it as any other program would."""
    with h5py.File(path, "r") as file:
        np.testing.assert_array_equal(file["volts"][:, :SAMPLES], volts_of(2, SAMPLES))
        assert file["chunks"][-1]["column"] + file["chunks"][-1]["samples"] == SAMPLES
    with open_recording(path) as found:
        assert found.samples == SAMPLES
        assert not found.complete, "it was not closed in order"


def test_the_next_start_closes_what_a_killed_process_left_and_no_living_one(
    recorders: Recorders, tmp_path: Path
) -> None:
    gone, lives = tmp_path / "gone.h5", tmp_path / "lives.h5"
    recorders.start(gone)
    recorders.end()
    recorders.start(lives)
    with pytest.raises(OSError, match="already open for write"):
        h5py.File(gone, "r")
    before = lives.read_bytes()
    notes = OpenRecordings(recorders.notes)
    done = {each.path: each.outcome for each in notes.close_left_open((tmp_path,))}
    assert done == {gone: Outcome.CLOSED, lives: Outcome.IN_USE}
    check_all_is_there(gone)
    assert gone.stat().st_size < 2_000_000, "the room that was taken ahead is given back"
    assert lives.read_bytes() == before
    recorders.end()
    (last,) = notes.close_left_open()
    assert (last.path, last.outcome) == (lives, Outcome.CLOSED)
    check_all_is_there(lives)
    assert notes.close_left_open((tmp_path,)) == []
    assert list(recorders.notes.iterdir()) == []


def test_one_that_nobody_noted_is_found_in_the_usual_folder(killed: Path, tmp_path: Path) -> None:
    (done,) = OpenRecordings(tmp_path / "notes").close_left_open((tmp_path,))
    assert done.outcome is Outcome.CLOSED
    check_all_is_there(killed)


def test_one_of_another_computer_is_left_alone_until_somebody_answers_for_it(
    killed: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("platform.node", lambda: "another")
    before = killed.read_bytes()
    (closing,) = OpenRecordings(tmp_path / "notes").close_left_open((tmp_path,))
    assert closing.outcome is Outcome.UNSURE
    assert "cannot be seen from here" in closing.text
    assert f"cosmic repair --ended {killed}" in closing.text
    assert main(["repair", str(killed)]) == 1
    assert "left alone" in capsys.readouterr().err
    assert killed.read_bytes() == before
    assert main(["repair", "--ended", str(killed)]) == 0
    check_all_is_there(killed)


def test_the_number_of_a_process_that_was_given_again_does_not_deceive(
    killed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosmic.frame.file_holder.process_start", lambda _: "this boot:later")
    assert close_left_open(killed).outcome is Outcome.CLOSED


def test_repair_says_what_it_did_and_the_second_time_that_all_is_well(
    killed: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["repair", str(killed)]) == 0
    assert f"{killed}: closed; 5.00 s of samples" in capsys.readouterr().out
    check_all_is_there(killed)
    before = killed.read_bytes()
    assert main(["repair", str(killed)]) == 0
    assert "nothing to do" in capsys.readouterr().out
    assert killed.read_bytes() == before


def test_repair_refuses_a_file_in_use(
    recorders: Recorders, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "lives.h5"
    recorders.start(path)
    before = path.read_bytes()
    for more in ([], ["--ended"]):
        assert main(["repair", *more, str(path)]) == 1
        assert "is in use; it was not changed" in capsys.readouterr().err
    assert path.read_bytes() == before


def test_a_file_that_another_program_holds_is_in_use(killed: Path) -> None:
    fcntl = pytest.importorskip("fcntl")
    with killed.open("rb") as held:
        fcntl.flock(held, fcntl.LOCK_SH)
        assert close_left_open(killed).outcome is Outcome.IN_USE
    assert close_left_open(killed).outcome is Outcome.CLOSED


def test_one_recorded_by_this_very_process_is_in_use(tmp_path: Path) -> None:
    head = header()
    file = RecordingFile(tmp_path / "mine.h5", head)
    assert close_left_open(tmp_path / "mine.h5").outcome is Outcome.IN_USE
    for chunk in chunks(head, volts_of(2, 100)):
        file.append(chunk)
    file.close(complete=True)
    assert close_left_open(tmp_path / "mine.h5").outcome is Outcome.WHOLE


def nothing(path: Path) -> None:
    path.unlink()


def text(path: Path) -> None:
    path.write_text("time_s,force_uN\n", encoding="utf-8")


def foreign(path: Path) -> None:
    path.unlink()
    with h5py.File(path, "w", libver=("v110", "v110")) as file:
        file["x"] = np.arange(100)


def foreign_and_open(path: Path) -> None:
    foreign(path)
    with path.open("r+b") as file:
        file.seek(FLAGS_AT)
        file.write(b"\5")


def cut_short(path: Path) -> None:
    os.truncate(path, LENGTH + 200)


def overwritten(path: Path) -> None:
    size = path.stat().st_size
    with path.open("r+b") as file:
        file.seek(LENGTH)
        file.write(os.urandom(min(size, 60_000) - LENGTH))


@pytest.mark.parametrize(
    ("harm", "message"),
    [
        (nothing, "No such file"),
        (text, "is not a recording by CoSMic; nothing was changed"),
        (foreign, "not a recording by CoSMic"),
        (foreign_and_open, "h5clear"),
        (cut_short, "damaged beyond what can be mended, and nothing was changed"),
        (overwritten, "damaged beyond what can be mended, and nothing was changed"),
    ],
)
def test_what_cannot_be_closed_is_refused_and_stays_as_it_is(
    killed: Path, capsys: pytest.CaptureFixture[str], harm, message: str
) -> None:
    harm(killed)
    before = killed.read_bytes() if killed.exists() else None
    assert main(["repair", str(killed)]) == 1
    said = capsys.readouterr().err
    assert str(killed) in said
    assert message in said
    assert (killed.read_bytes() if killed.exists() else None) == before


CLOSED = """
import sys
sys.path.insert(0, sys.argv[1])
from pathlib import Path
from cosmic.daqco.core.recording_file import RecordingFile
from unit.daqco.recording_helpers import chunks, header, volts_of
head = header()
file = RecordingFile(Path(sys.argv[2]), head)
for chunk in chunks(head, volts_of(2, 60_000)):
    file.append(chunk)
file.close(complete=True)
"""


def test_repair_does_not_send_what_is_cut_off_to_repair(tmp_path: Path) -> None:
    path = tmp_path / "run.h5"
    subprocess.run([sys.executable, "-c", CLOSED, TESTS, str(path)], check=True, timeout=60)
    size = path.stat().st_size
    for percent in range(99, 1, -3):  # what is still there when the reader gives up depends on it
        os.truncate(path, size * percent // 100)
        with pytest.raises(RecordingError, match="is damaged beyond what can be mended") as found:
            close_left_open(path)
        assert "Run cosmic repair" not in str(found.value)


def test_a_closing_that_cannot_be_verified_is_taken_back(
    killed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = killed.read_bytes()
    written = left_behind._write_head
    monkeypatch.setattr(  # a disk that writes something else
        left_behind,
        "_write_head",
        lambda handle, head: written(handle, head.replace(b"\x03", b"\x02", 1)),
    )
    with pytest.raises(RecordingError, match="it is as it was"):
        close_left_open(killed)
    monkeypatch.undo()
    with killed.open("r+b") as file:  # what that disk did to the old head is its own
        file.write(before[:LENGTH])
    assert killed.read_bytes() == before, "nothing but the head was touched"


def test_two_starts_at_once_close_it_once(killed: Path) -> None:
    script = (
        "import sys; from pathlib import Path; "
        "from cosmic.daqco.core.left_behind import close_left_open; "
        "print(close_left_open(Path(sys.argv[1])).outcome.name)"
    )
    command = [sys.executable, "-c", script, str(killed)]
    both = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    said = sorted(process.communicate()[0].strip() for process in both)
    assert "CLOSED" in said
    assert said[1] in ("WHOLE", "IN_USE")
    check_all_is_there(killed)


def test_notes_stay_few(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(left_behind, "MOST_NOTES", 5)
    notes = OpenRecordings(tmp_path / "notes")
    for number in range(20):
        notes.note(tmp_path / f"{number}.h5")
    assert len(list((tmp_path / "notes").iterdir())) <= 5


@pytest.mark.skipif(sys.platform == "win32", reason="its names are text")
def test_a_folder_whose_name_is_no_text_costs_a_note_and_no_recording(tmp_path: Path) -> None:
    notes = OpenRecordings(tmp_path / "notes")
    assert notes.note(tmp_path / os.fsdecode(b"caf\xe9") / "run.h5") is None
    assert not list(tmp_path.glob("notes/*"))
