"""A campaign goes on after an end without warning, trusting no position of before."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosmic.autonomy.campaign.recorder import skip_known
from cosmic.autonomy.campaign.records import Outcome, Pose
from cosmic.autonomy.campaign.resume import FELL, DroppedFibre, resume
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.handling.context import SharedWorkspace
from cosmic.autonomy.handling.plate import Candidate
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.handling.survey import MEASURED, leave_dropped
from cosmic.mico.core.motion.positioner import Confidence
from unit.autonomy.campaign.sample_records import INFO, failed, good

LEFT_THERE = Pose(1000.0, -500.0, 20.0)


@pytest.fixture
def store(tmp_path: Path) -> Iterator[CampaignStore]:
    with CampaignStore.create(tmp_path, INFO) as opened:
        yield opened


def left_behind(store: CampaignStore) -> None:
    """Finish a fibre that stays where it was found."""
    record = failed(store.begin_fibre(time_s=0.0))
    store.finish_fibre(replace(record, found=LEFT_THERE))


def test_what_was_in_treatment_is_marked_and_the_last_steps_are_reported(
    store: CampaignStore,
) -> None:
    left_behind(store)
    number = store.begin_fibre(Pose(0.0, 0.0, 0.0), time_s=30.0)
    store.note("lift", "move", {"left_z_um": -500.0}, time_s=33.0, fibre=number)
    plan = resume(store)
    assert (plan.finished, plan.interrupted) == (1, (number,))
    assert (plan.last[-1].operation, plan.last[-1].fibre) == ("lift", number)
    assert [each.outcome for each in store.reader.fibres()] == [
        Outcome.FAILED,
        Outcome.INTERRUPTED,
    ]
    assert resume(store).interrupted == (), "an interruption is told once"


@pytest.mark.parametrize(
    ("pose", "length_um", "done"),
    [
        (LEFT_THERE, 1500.0, True),
        (Pose(1080.0, -430.0, 28.0), 1540.0, True),
        (Pose(1000.0, -500.0, 200.0), 1500.0, True),  # the same line, the other end first
        (Pose(1400.0, -500.0, 20.0), 1500.0, False),
        (LEFT_THERE, 1900.0, False),
        (Pose(1000.0, -500.0, 80.0), 1500.0, False),
    ],
)
def test_a_treated_fibre_is_known_again_by_position_and_length(
    store: CampaignStore, pose: Pose, length_um: float, done: bool
) -> None:
    left_behind(store)
    assert resume(store).is_done(pose, length_um) is done


def test_a_fibre_that_was_put_away_is_not_looked_for_where_it_lay(store: CampaignStore) -> None:
    record = good(store.begin_fibre(time_s=0.0))
    store.finish_fibre(record)
    plan = resume(store)
    assert record.found is not None
    assert record.left is not None
    assert not plan.is_done(record.found, record.shape.length_um)
    assert plan.is_done(record.left, record.shape.length_um)


def test_an_interrupted_fibre_is_tried_once_more_only(store: CampaignStore) -> None:
    store.begin_fibre(LEFT_THERE, time_s=0.0)
    assert not resume(store).is_done(LEFT_THERE, 1500.0)
    store.begin_fibre(LEFT_THERE, time_s=60.0)
    assert resume(store).is_done(LEFT_THERE, 1500.0)


def test_another_fibre_at_the_position_of_an_interrupted_one_is_not_taken_for_it(
    store: CampaignStore,
) -> None:
    for _ in range(2):
        store.begin_fibre(LEFT_THERE, time_s=0.0, length_um=1500.0)
        plan = resume(store)
    assert plan.is_done(LEFT_THERE, 1510.0)
    assert not plan.is_done(LEFT_THERE, 2500.0)
    assert [each.length_um for each in plan.known] == [1500.0, 1500.0]


LOOKS = {"length_um": 1510.0, "width_um": 31.0, "curl": 0.012}


def test_a_measured_fibre_that_fell_is_known_by_its_looks(store: CampaignStore) -> None:
    number = store.begin_fibre(LEFT_THERE, time_s=0.0)
    store.note("carry to the bin", FELL, LOOKS, time_s=9.0, fibre=number)
    store.finish_fibre(good(number))
    assert resume(store).fallen == (DroppedFibre(number, 1510.0, 31.0, 0.012),)


def test_one_that_fell_before_its_record_was_written_may_be_measured_again(
    store: CampaignStore,
) -> None:
    number = store.begin_fibre(LEFT_THERE, time_s=0.0)
    store.note("carry to the bin", FELL, LOOKS, time_s=9.0, fibre=number)
    assert resume(store).fallen == ()


def test_a_run_that_ended_without_a_word_differs_from_one_that_said_why(tmp_path: Path) -> None:
    with CampaignStore.create(tmp_path, INFO) as begun:
        assert not resume(begun).cut_off, "it is the first"
    with CampaignStore.open(tmp_path) as after_kill:
        assert resume(after_kill).cut_off
        after_kill.end("1 fibres done", time_s=3.0)
    with CampaignStore.open(tmp_path) as after_end:
        assert not resume(after_end).cut_off


def workplace(confidence: Confidence) -> Any:
    """Return as much of the work as resuming needs, with axes that are known so well."""
    tool = SimpleNamespace(x_axis="x", y_axis="y", z_axis="")
    axis = SimpleNamespace(details=SimpleNamespace(confidence=confidence))
    return SimpleNamespace(
        shared=SharedWorkspace(),
        settings=HandlingSettings(),
        table="table",
        tool=lambda _name: tool,
        mico=dict.fromkeys(("x", "y", "table"), axis),
    )


@pytest.mark.parametrize("confidence", [Confidence.KNOWN, Confidence.UNKNOWN])
def test_what_a_stop_left_without_a_position_is_initialised_first(
    confidence: Confidence, store: CampaignStore
) -> None:
    work, plan = workplace(confidence), replace(resume(store), cut_off=False)
    skip_known(work, plan)
    assert work.shared.needs_initialisation is (confidence is Confidence.UNKNOWN)


def test_only_fibres_of_the_plate_that_is_there_are_known_again(store: CampaignStore) -> None:
    left_behind(store)
    store.begin_plate(2, time_s=100.0, by="person")
    plan = resume(store)
    assert (plan.plate, plan.plate_pending) == (2, True)
    store.finish_plate(2, time_s=160.0)
    here = store.begin_fibre(time_s=170.0, plate=2)
    store.finish_fibre(replace(failed(here), found=Pose(0.0, 0.0, 0.0)))
    plan = resume(store)
    assert (plan.plate, plan.plate_pending) == (2, False)
    assert [each.number for each in plan.known] == [here]
    (change,) = store.reader.plate_changes()
    assert (change.by, change.put_s - change.asked_s) == ("person", 60.0)


def test_what_looks_like_one_that_fell_is_not_taken_after_the_restart(
    store: CampaignStore,
) -> None:
    number = store.begin_fibre(LEFT_THERE, time_s=0.0)
    store.note("carry to the bin", FELL, LOOKS, time_s=9.0, fibre=number)
    store.finish_fibre(good(number))
    work = workplace(Confidence.KNOWN)
    skip_known(work, resume(store))
    line = np.array([[0.0, 0.0], [1511.0, 0.0]])
    alike, other = (Candidate(line, length, 31.2, 0.013, 60.0) for length in (1511.0, 1200.0))
    left = leave_dropped([other, alike], work.shared.dropped)
    assert [each.problem for each in left] == ["", MEASURED]
