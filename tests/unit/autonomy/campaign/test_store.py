"""A campaign's folder: every fibre once and whole, whatever happens to the program."""

import errno
import os
import resource
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from threading import Event

import numpy as np
import pytest

from cosmic.autonomy.bending.bent_shape import BentShape
from cosmic.autonomy.bending.span import Freed
from cosmic.autonomy.campaign.analysis import altered_files
from cosmic.autonomy.campaign.opening import check_folder
from cosmic.autonomy.campaign.recorder import Journal
from cosmic.autonomy.campaign.records import (
    CalibrationNote,
    CampaignError,
    FibreRecord,
    Outcome,
    Pose,
)
from cosmic.autonomy.campaign.storage_format import RESULT_CELLS, result_row
from cosmic.autonomy.campaign.store import LOCK, CampaignStore
from cosmic.autonomy.campaign.store_read import CampaignReader
from unit.autonomy.campaign.sample_records import INFO, failed, good

KILLS = 24
WRITER = Path(__file__).with_name("killed_writer.py")


@pytest.fixture
def store(tmp_path: Path) -> Iterator[CampaignStore]:
    with CampaignStore.create(tmp_path / "campaign", INFO) as opened:
        yield opened


def test_what_a_slide_has_shown_is_kept_with_its_span(store: CampaignStore) -> None:
    record = good(store.begin_fibre(Pose(0.0, 0.0, 0.0), time_s=5.0), began_s=5.0)
    slid = Freed(7, np.array([3.5, 3.4]), np.array([2.9, 3.0]), 0.05, 0.3)
    first, *others = record.spans
    store.finish_fibre(replace(record, spans=(replace(first, freed=slid), *others)))
    read, *rest = CampaignReader(store.folder).fibre(record.number).spans
    assert read.freed is not None
    assert (read.freed.after, read.freed.std_un, read.freed.wait_s) == (7, 0.05, 0.3)
    np.testing.assert_array_equal(read.freed.up_un, slid.up_un)
    np.testing.assert_array_equal(read.freed.down_un, slid.down_un)
    assert all(each.freed is None for each in rest)


def test_what_an_image_has_shown_of_a_push_is_kept_with_its_span(store: CampaignStore) -> None:
    record = good(store.begin_fibre(Pose(0.0, 0.0, 0.0), time_s=5.0), began_s=5.0)
    seen = BentShape(np.array([70.0, 85.0]), np.array([0.4, 0.9]), 0.6, 120.5, 31.0)
    first, *others = record.spans
    store.finish_fibre(replace(record, spans=(replace(first, bent=seen), *others)))
    read, *rest = CampaignReader(store.folder).fibre(record.number).spans
    assert read.bent is not None
    assert (read.bent.std_um, read.bent.probe_um, read.bent.force_un) == (0.6, 120.5, 31.0)
    np.testing.assert_array_equal(read.bent.ahead_um, seen.ahead_um)
    np.testing.assert_array_equal(read.bent.aside_um, seen.aside_um)
    assert all(each.bent is None for each in rest)


def test_what_is_written_is_read_back_whole(store: CampaignStore) -> None:
    number = store.begin_fibre(Pose(300.0, -150.0, 12.0), time_s=5.0)
    record = good(number, began_s=5.0)
    store.finish_fibre(record)
    read = CampaignReader(store.folder).fibre(number)
    assert (read.outcome, read.found, read.left) == (Outcome.GOOD, record.found, record.left)
    assert read.shape == record.shape
    assert read.operations == record.operations
    assert read.bending is not None
    assert record.bending is not None
    assert read.bending.ei_n_m2 == record.bending.ei_n_m2
    assert read.bending.used == record.bending.used
    for ours, theirs in zip(read.spans, record.spans, strict=True):
        np.testing.assert_array_equal(ours.force_un, theirs.force_un)
        np.testing.assert_array_equal(ours.loading, theirs.loading)
    for fit, same in zip(read.bending.spans, record.bending.spans, strict=True):
        np.testing.assert_array_equal(fit.fitted_un, same.fitted_un)
        assert fit.k_un_um == same.k_un_um
        assert fit.flags == same.flags
    np.testing.assert_array_equal(read.images[0].pixels, record.images[0].pixels)
    assert read.images[0].scale_um_px == 7.6
    assert read.images[0].region_px == record.images[0].region_px
    assert {each.name: each.unit for each in read.series} == {"left.x": "um", "force": "uN"}


def test_the_budget_of_a_fibre_is_read_back(store: CampaignStore) -> None:
    record = good(store.begin_fibre(time_s=0.0))
    store.finish_fibre(record)
    found = store.reader.fibre(record.number).bending
    assert found is not None
    assert record.bending is not None
    assert found.budget == record.bending.budget
    assert found.notes == record.bending.notes
    assert not found.scale_verified


def test_a_campaign_of_an_earlier_program_is_resumed_without_a_budget(tmp_path: Path) -> None:
    with CampaignStore.create(tmp_path / "old", INFO) as store:
        store.finish_fibre(good(store.begin_fibre(time_s=0.0)))
    with sqlite3.connect(tmp_path / "old" / "campaign.sqlite") as connection:
        for column in ("budget_json", "scale_verified", "notes", "probability"):
            connection.execute(f"ALTER TABLE fibre DROP COLUMN {column}")
    connection.close()
    before = CampaignReader(tmp_path / "old").finished()[0].bending
    assert before is not None
    assert before.budget == ()
    with CampaignStore.open(tmp_path / "old") as store:
        store.finish_fibre(good(store.begin_fibre(time_s=10.0)))
        first, second = (each.bending for each in store.reader.finished())
    assert first is not None
    assert second is not None
    assert not first.budget
    assert second.budget


def test_a_failed_fibre_keeps_its_cause_and_its_tries(store: CampaignStore) -> None:
    number = store.begin_fibre(time_s=0.0)
    store.finish_fibre(failed(number))
    (read,) = store.reader.finished()
    assert (read.outcome, read.cause, read.attempts) == (Outcome.FAILED, "missed grasp", 4)
    assert read.bending is None
    assert [each.attempt for each in read.operations if each.failed] == [1, 2]


def test_a_fibre_has_one_end(store: CampaignStore) -> None:
    number = store.begin_fibre(time_s=0.0)
    store.finish_fibre(failed(number))
    with pytest.raises(CampaignError, match="is already completed: failed"):
        store.finish_fibre(good(number))
    with pytest.raises(CampaignError, match="fibre 99 was not started"):
        store.finish_fibre(failed(99))
    with pytest.raises(CampaignError, match="which is not final"):
        store.finish_fibre(FibreRecord(number, Outcome.RUNNING, 0.0, 1.0))
    assert [each.cause for each in store.reader.finished()] == ["missed grasp"]
    assert store.reader.fibre(number).spans == (), "its files are those of the first end"


def test_the_campaign_says_what_it_is_and_what_held(store: CampaignStore) -> None:
    store.keep_calibrations([CalibrationNote("plate", 0.4, "um", "2026-03-02T09:00:00")])
    assert store.reader.info() == INFO
    assert [each.name for each in store.reader.calibrations()] == ["plate"]
    assert store.reader.ended() == ("", "")
    store.end("3 fibres done", time_s=120.0)
    assert store.reader.ended()[1] == "3 fibres done"
    assert store.reader.elapsed_s() == 120.0


def test_time_counts_from_run_to_run(tmp_path: Path) -> None:
    with CampaignStore.create(tmp_path, INFO, time_s=100.0) as store:
        store.finish_fibre(failed(store.begin_fibre(time_s=110.0), began_s=110.0))
    with CampaignStore.open(tmp_path, time_s=5.0) as store:
        store.finish_fibre(failed(store.begin_fibre(time_s=10.0), began_s=10.0))
        # 24 s to the end of the first fibre, then 19 s in the second run.
        assert store.reader.elapsed_s() == pytest.approx(24.0 + 19.0)


def test_the_time_of_a_run_that_was_cut_off_counts_until_its_last_line(tmp_path: Path) -> None:
    with CampaignStore.create(tmp_path, INFO, time_s=100.0) as store:
        store.note("survey", "begin", time_s=130.0)
        number = store.begin_fibre(time_s=140.0)
        store.note("lift", "begin", time_s=155.0, fibre=number)  # and it is killed
    with CampaignStore.open(tmp_path, time_s=5.0) as store:
        store.note("survey", "begin", time_s=25.0)
        assert store.reader.elapsed_s() == pytest.approx(55.0 + 20.0)
        store.end("done", time_s=30.0)
        assert store.reader.elapsed_s() == pytest.approx(55.0 + 25.0)


def test_the_journal_reports_what_was_about_to_happen(store: CampaignStore) -> None:
    journal = Journal(store, lambda: 12.5)
    journal.note("survey", "begin")
    journal.fibre = store.begin_fibre(time_s=12.0)
    journal.note("descend", "move", left_z_um=-850.0)
    last = store.reader.journal(1)[0]
    assert (last.operation, last.phase, last.fibre, last.time_s) == ("descend", "move", 1, 12.5)
    assert last.payload == {"left_z_um": -850.0}
    assert [each.operation for each in store.reader.journal()] == ["survey", "descend"]


def test_no_campaign_is_begun_over_another(store: CampaignStore) -> None:
    with pytest.raises(CampaignError, match="already holds a campaign"):
        CampaignStore.create(store.folder, INFO)


def test_a_folder_without_a_campaign_is_reported(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match=r"holds no campaign: there is no campaign\.sqlite"):
        CampaignStore.open(tmp_path)
    with pytest.raises(CampaignError, match="holds no campaign: it is not a folder"):
        CampaignReader(tmp_path / "mistyped").check()
    (tmp_path / "campaign.sqlite").write_bytes(b"this is no database, but long enough" * 10)
    with pytest.raises(CampaignError, match=r"campaign\.sqlite"):
        CampaignStore.open(tmp_path)


def test_a_begin_that_was_cut_off_can_be_begun_again(tmp_path: Path) -> None:
    (tmp_path / "campaign.sqlite").touch()
    with pytest.raises(CampaignError, match="its creation was interrupted"):
        CampaignStore.open(tmp_path)
    with CampaignStore.create(tmp_path, INFO) as store:
        assert store.reader.info().name == "quick"


@pytest.mark.parametrize("emptied", [True, False])
def test_no_campaign_is_begun_over_raw_files_whose_database_is_lost(
    store: CampaignStore, *, emptied: bool
) -> None:
    store.finish_fibre(good(store.begin_fibre(time_s=0.0)))
    store.close()
    database = store.folder / "campaign.sqlite"
    database.unlink()
    if emptied:
        database.touch()
    raw = (store.folder / "fibres" / "00001.h5").read_bytes()
    alone = r"holds raw files of 1 fibres, such as fibres/00001\.h5, and no campaign\.sqlite"
    with pytest.raises(CampaignError, match=alone):
        CampaignStore.create(store.folder, INFO)
    with pytest.raises(CampaignError, match=alone):
        CampaignReader(store.folder).check()
    if not emptied:
        with pytest.raises(CampaignError, match=alone):
            check_folder(store.folder)
    assert (store.folder / "fibres" / "00001.h5").read_bytes() == raw


def test_a_campaign_is_there_whole_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*_: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", killed)
        with pytest.raises(KeyboardInterrupt):
            CampaignStore.create(tmp_path, INFO)
    assert not (tmp_path / "campaign.sqlite").exists()
    with CampaignStore.create(tmp_path, INFO) as store:
        assert store.reader.info() == INFO


def test_a_folder_that_cannot_be_written_can_still_be_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with CampaignStore.create(tmp_path, INFO) as store:
        store.finish_fibre(failed(store.begin_fibre(time_s=0.0)))
    before = sorted(each.name for each in tmp_path.iterdir())
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert len(CampaignReader(tmp_path).finished()) == 1
    assert sorted(each.name for each in tmp_path.iterdir()) == before


def test_to_read_a_campaign_leaves_its_folder_as_it_is(store: CampaignStore) -> None:
    store.finish_fibre(failed(store.begin_fibre(time_s=0.0)))
    assert len(store.reader.fibres()) == 1  # also while it is written
    store.close()
    before = sorted(each.name for each in store.folder.iterdir())
    reader = CampaignReader(store.folder)
    reader.check()
    assert len(reader.fibres()) == 1
    assert altered_files(reader) == ()
    assert sorted(each.name for each in store.folder.iterdir()) == before


def test_a_second_writer_is_refused_while_readers_are_not(store: CampaignStore) -> None:
    with pytest.raises(CampaignError, match="already being written there"):
        CampaignStore.open(store.folder)
    assert CampaignReader(store.folder).finished() == ()


def test_a_closed_campaign_says_so(tmp_path: Path) -> None:
    store = CampaignStore.create(tmp_path, INFO)
    store.close()
    store.close()
    with pytest.raises(CampaignError, match="closed"):
        store.note("survey", "begin", time_s=0.0)


# ---------------------------------------------------------------------- full disks


def test_a_full_disk_is_reported_and_the_fibre_can_be_written_later(
    store: CampaignStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = store.begin_fibre(time_s=0.0)
    store.finish_fibre(good(first))
    second = store.begin_fibre(time_s=30.0)

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(os, "fsync", full)
        with pytest.raises(CampaignError, match=r"No space left.*are saved: make room"):
            store.finish_fibre(good(second))
    assert not list((store.folder / "fibres").glob("*.part"))
    assert [each.number for each in store.reader.finished()] == [first]
    store.finish_fibre(good(second))
    assert len(store.reader.finished()) == 2


def test_a_database_that_cannot_grow_is_reported_and_keeps_what_it_has(
    store: CampaignStore,
) -> None:
    store.finish_fibre(good(store.begin_fibre(time_s=0.0)))
    number = store.begin_fibre(time_s=30.0)
    largest = max(each.stat().st_size for each in store.folder.iterdir() if each.is_file())
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    text = "x" * 4000
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest + 100_000, hard))
        with pytest.raises(CampaignError, match="cannot be written"):
            for _ in range(100):
                store.note("survey", "begin", {"text": text}, time_s=31.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert len(store.reader.finished()) == 1
    store.finish_fibre(good(number))
    assert len(store.reader.finished()) == 2


# ---------------------------------------------------------------------- killed


class Writers:
    """Forks one writer after another."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, str(WRITER)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            bufsize=1,
        )

    def start(self, folder: Path) -> int:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{folder}\n")
        self._process.stdin.flush()
        return int(self.line())

    def line(self) -> str:
        assert self._process.stdout is not None
        return self._process.stdout.readline().strip()

    def to_the_end(self) -> list[int]:
        said = iter(self.line, "gone")
        return [int(each) for each in said if each != "open"]

    def close(self) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.wait(10)
        self._process.stdout.close()


@pytest.fixture
def writers() -> Iterator[Writers]:
    made = Writers()
    yield made
    made.close()


def test_a_writer_killed_at_any_moment_loses_and_doubles_nothing(
    tmp_path: Path, writers: Writers
) -> None:
    CampaignStore.create(tmp_path, INFO).close()
    rng, announced = np.random.default_rng(5), []
    for number in range(KILLS):
        process = writers.start(tmp_path)
        if number % 6:  # now and then while it still opens the campaign
            writers.line()
            announced += [int(writers.line()) for _ in range(rng.integers(0, 3))]
        Event().wait(float(rng.uniform(0.0, 0.05)))  # any moment will do
        os.kill(process, signal.SIGKILL)
        announced += writers.to_the_end()
        reader = CampaignReader(tmp_path)
        serials = [each.peak_force_un for each in reader.finished()]
        assert serials == list(range(len(serials)))
        # What was said to be written is; an end may have been written and not been said.
        assert set(announced) <= set(range(len(serials)))
        assert len(set(announced)) == len(announced)
    finished = CampaignReader(tmp_path).finished()
    assert len(finished) > KILLS / 3
    for each in finished:
        whole = CampaignReader(tmp_path).fibre(each.number)
        assert whole.series[0].values[-1] == each.peak_force_un
        assert whole.images[0].pixels.shape == (200, 200)
    with CampaignStore.open(tmp_path) as store:
        store.interrupt_running()
        outcomes = {each.outcome for each in store.reader.fibres()}
        assert outcomes <= {Outcome.GOOD, Outcome.INTERRUPTED}
        assert not list((tmp_path / "fibres").glob("*.part"))


def test_another_process_is_refused_until_the_first_is_gone(
    tmp_path: Path, writers: Writers
) -> None:
    CampaignStore.create(tmp_path, INFO).close()
    process = writers.start(tmp_path)
    assert writers.line() == "open"
    with pytest.raises(CampaignError, match="already being written there"):
        CampaignStore.open(tmp_path)
    os.kill(process, signal.SIGKILL)
    writers.to_the_end()
    with CampaignStore.open(tmp_path) as store:
        assert store.reader.info() == INFO


def test_a_folder_whose_lock_cannot_be_written_is_not_said_to_be_in_use(tmp_path: Path) -> None:
    CampaignStore.create(tmp_path, INFO).close()
    (tmp_path / LOCK).unlink()
    (tmp_path / LOCK).mkdir()
    with pytest.raises(CampaignError, match="cannot be written there"):
        CampaignStore.open(tmp_path)


def test_a_folder_in_which_no_database_can_be_made_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "campaign.sqlite.part").mkdir()
    with pytest.raises(CampaignError, match="cannot be written"):
        CampaignStore.create(tmp_path, INFO)


def test_where_a_database_cannot_be_opened_it_is_not_said_to_make_room(tmp_path: Path) -> None:
    (tmp_path / "campaign.sqlite").mkdir()
    with pytest.raises(CampaignError, match="It is as it was: see who may write in its folder"):
        CampaignStore.open(tmp_path)


def test_a_raw_file_written_just_before_the_end_is_no_stranger(tmp_path: Path) -> None:
    with CampaignStore.create(tmp_path, INFO) as store:
        number = store.begin_fibre(time_s=1.0)
        (tmp_path / "fibres" / f"{number:05d}.h5").write_bytes(b"whole, and not in the record yet")
    assert altered_files(CampaignReader(tmp_path)) == ()
    with CampaignStore.open(tmp_path) as store:
        store.interrupt_running()
    assert altered_files(CampaignReader(tmp_path)) == ()


def test_the_cells_of_a_result_are_those_that_an_analysis_writes() -> None:
    record = good(1)
    assert record.bending is not None
    assert set(result_row(record.bending)) == RESULT_CELLS
