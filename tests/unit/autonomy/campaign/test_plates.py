"""Plates of a campaign: who is asked for the next, and when there is none."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import pytest

from cosmic.autonomy.campaign.plates import CampaignPlates, confirm, confirmed
from cosmic.autonomy.campaign.records import CampaignError
from cosmic.autonomy.campaign.stop_rule import PLATE, StandardSchedule
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.handling.plate_change import PlateByPerson, PlateHandler
from cosmic.autonomy.procedures.operation import Awaited
from cosmic.frame.errors import NotAvailable, OperationCancelled
from unit.autonomy.campaign.sample_records import INFO, failed
from unit.mico.rigs import wait_until


@pytest.fixture
def store(tmp_path: Path) -> Iterator[CampaignStore]:
    with CampaignStore.create(tmp_path, INFO) as opened:
        yield opened


def plates(most: int = 3, **more: Any) -> CampaignPlates:
    nothing: Any = cast("Any", None)
    return CampaignPlates(most, PlateByPerson(), lambda handler, plate: nothing, **more)


def test_a_plate_is_there_once_somebody_says_so() -> None:
    person = PlateByPerson()
    with pytest.raises(NotAvailable, match="no plate is waited for"):
        person.put(2)
    asked = person.change(2)
    assert "plate 2" in person.request
    assert not asked.done
    person.put(2)
    assert asked.success
    assert person.request == ""


def test_who_ends_a_campaign_waits_for_no_plate() -> None:
    person = PlateByPerson()
    asked = person.change(2)
    asked.cancel()
    with pytest.raises(OperationCancelled):
        asked.wait(0.0)
    assert person.request == ""


def test_a_plate_counts_from_when_it_is_there(store: CampaignStore) -> None:
    some = plates()
    some.change(store, 10.0)
    assert (some.number, some.pending) == (1, True)
    some.there(store, 20.0)
    assert (some.number, some.pending) == (2, False)


def test_a_change_that_was_cut_off_is_asked_for_again(store: CampaignStore) -> None:
    plates().change(store, 10.0)
    (left,) = store.reader.plate_changes()
    assert not left.over
    again = plates(number=left.plate, pending=True)
    assert again.number == 1
    again.change(store, 30.0)
    again.there(store, 40.0)
    (kept,) = store.reader.plate_changes()
    assert (kept.plate, kept.asked_s, kept.put_s) == (2, 30.0, 40.0)


def test_the_last_plate_and_plates_without_any_fibre_end_it() -> None:
    assert "no further plate" in plates(most=2, number=2).why_no_other([])
    on_first = [replace(failed(1), plate=1)]
    assert plates(number=2).why_no_other(on_first) == ""
    assert "plates 2 to 3" in plates(most=9, number=3).why_no_other(on_first)


def test_another_program_confirms_a_plate_only_where_one_is_waited_for(
    store: CampaignStore,
) -> None:
    with pytest.raises(CampaignError, match="no plate is waited for"):
        confirm(store.folder)
    store.begin_plate(2, time_s=10.0, by="person")
    assert confirm(store.folder) == 2
    assert [confirmed(store.folder), confirmed(store.folder)] == [True, False]


def test_a_plate_is_not_confirmed_to_a_campaign_that_nobody_carries_out(tmp_path: Path) -> None:
    with CampaignStore.create(tmp_path, INFO) as store:
        store.begin_plate(2, time_s=10.0, by="person")
    with pytest.raises(CampaignError, match="no program carries this campaign out now"):
        confirm(tmp_path)
    assert not confirmed(tmp_path)


def test_what_another_program_says_goes_for_one_plate(store: CampaignStore) -> None:
    asked: list[Awaited] = []

    def build(handler: PlateHandler, plate: int) -> Any:
        asked.append(handler.change(plate))

    person = PlateByPerson()
    some = CampaignPlates(3, person, build)
    some.change(store, 10.0)
    person.put(2)  # in the window, and from a terminal as well
    confirm(store.folder)
    some.there(store, 20.0)
    some.change(store, 30.0)
    assert not asked[-1].done
    assert "plate 3" in some.request
    confirm(store.folder)
    wait_until(lambda: asked[-1].done)
    assert asked[-1].wait(0.0) is None
    assert not confirmed(store.folder)


def test_the_standard_is_due_on_each_further_plate_where_that_is_wanted() -> None:
    due = StandardSchedule(("begin", "plate", "end"))
    assert due.due(0.0, ending=False) == "begin"
    due.done("begin")
    assert due.due(0.9, ending=False) == ""
    due.new_plate()
    due.new_plate()
    assert due.due(0.1, ending=False) == PLATE
    due.done(PLATE)
    assert due.due(0.1, ending=False) == ""
    without = StandardSchedule(("end",))
    without.new_plate()
    assert without.due(0.1, ending=False) == ""


def test_a_standard_that_could_not_be_measured_is_due_once_more_on_its_plate() -> None:
    due = StandardSchedule(("begin", "plate", "end"))
    due.done("begin")
    due.not_measured("begin")
    assert due.due(0.1, ending=False) == "", "not before the plate is worked off"
    assert due.due_once_more == "begin"
    due.done("begin")
    due.not_measured("begin")
    assert due.due_once_more == "", "once, and no more"
    due.new_plate()
    due.done(PLATE)
    due.not_measured(PLATE)
    due.new_plate()
    assert due.due_once_more == "", "that plate is gone"
    due.done(PLATE)
    assert due.due_once_more == ""
    assert due.due(1.0, ending=True) == "end"
    due.done("end")
    due.not_measured("end")
    assert due.due(1.0, ending=True) == "", "it would be tried for ever"


def test_a_campaign_that_ends_measures_what_it_missed_where_the_end_is_not_asked_for() -> None:
    due = StandardSchedule(("begin",))
    due.done("begin")
    due.not_measured("begin")
    assert due.due(1.0, ending=True) == "begin"
    due.done("begin")
    due.not_measured("begin")
    assert due.due(1.0, ending=True) == ""
