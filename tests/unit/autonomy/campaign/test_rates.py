"""What part of the fibres came to a value, of which of them, and in how much of the time."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cosmic.autonomy.campaign.rates import Seen, rates_of, seen_fibres
from cosmic.autonomy.campaign.records import STANDARD, FibreRecord, Outcome, Pose, Shape, Sighting
from cosmic.autonomy.campaign.selection import selection_of
from cosmic.autonomy.campaign.store import CampaignStore
from unit.autonomy.campaign.sample_records import INFO, failed, good


@pytest.fixture
def store(tmp_path: Path) -> Iterator[CampaignStore]:
    with CampaignStore.create(tmp_path, INFO) as opened:
        yield opened


def sighting(
    x_um: float, problem: str = "", *, plate: int = 1, length_um: float = 1500.0
) -> Sighting:
    return Sighting(plate, x_um, 0.0, length_um, 30.0, 0.01, problem)


def put(
    store: CampaignStore, record: FibreRecord, x_um: float, *, plate: int = 1, took_s: float = 20.0
) -> None:
    number = store.begin_fibre(time_s=record.began_s, plate=plate, role=record.role)
    found = Pose(x_um, 0.0, 0.0)
    ended_s = record.began_s + took_s
    store.finish_fibre(replace(record, number=number, found=found, ended_s=ended_s))


def test_success_is_counted_of_those_seen_of_those_that_could_be_grasped_and_of_those_tried(
    store: CampaignStore,
) -> None:
    plates = [sighting(0.0), sighting(500.0, "crossing"), sighting(1000.0, "too near to another")]
    store.keep_sightings(1, [*plates, sighting(1500.0, "too faint"), sighting(2000.0)])
    store.keep_sightings(2, [sighting(0.0, plate=2)])
    store.keep_sightings(1, [sighting(9000.0)])  # a later look at a plate makes no new fibres
    put(store, replace(good(0), began_s=100.0), 10.0)
    put(store, replace(good(0), began_s=130.0), 1010.0)  # one that others had crowded
    put(store, replace(failed(0), began_s=160.0), 2010.0)
    put(store, replace(good(0), began_s=900.0), 5.0, plate=2)
    rates = rates_of(store.reader)
    assert (rates.seen, rates.graspable, rates.tried, rates.good) == (5, 4, 4, 3)
    assert rates.part(rates.seen) == 0.6
    assert rates.part(rates.graspable) == 0.75


def test_the_time_of_a_campaign_is_divided_by_what_it_went_to(store: CampaignStore) -> None:
    put(store, replace(good(0), began_s=100.0), 0.0)
    put(store, replace(good(0), began_s=110.0), 500.0)  # the other arm's, meanwhile
    put(store, replace(good(0), role=STANDARD, began_s=200.0), 800.0, took_s=30.0)
    store.begin_plate(2, time_s=300.0, by="handler")
    store.finish_plate(2, time_s=500.0)
    store.end("enough", time_s=1000.0)
    rates = rates_of(store.reader)
    assert (rates.fibres_s, rates.standards_s, rates.plates_s) == (30.0, 30.0, 200.0)
    assert rates.preparation_s == 1000.0 - 260.0
    assert rates.an_hour == pytest.approx(7.2)
    assert rates.an_hour_without_plates == pytest.approx(9.0)
    assert rates.an_hour_of_treatment == pytest.approx(240.0)
    assert rates.plates == 2


def test_a_campaign_of_an_earlier_program_has_rates_without_what_was_seen(
    store: CampaignStore,
) -> None:
    put(store, good(0), 0.0)
    rates = rates_of(store.reader)
    assert (rates.seen, rates.tried, rates.good) == (0, 1, 1)
    assert math.isnan(rates.part(rates.seen))


def test_two_treatments_of_one_sighting_count_once(store: CampaignStore) -> None:
    fibres = [
        replace(failed(1), found=Pose(0.0, 0.0, 0.0)),
        replace(good(2), found=Pose(5.0, 0.0, 0.0)),
    ]
    (one,) = seen_fibres([sighting(0.0)], fibres)
    assert one.outcome is Outcome.GOOD


def test_a_fibre_that_moved_before_its_second_treatment_is_one_fibre(store: CampaignStore) -> None:
    store.keep_sightings(1, [sighting(0.0), sighting(1000.0, length_um=900.0)])
    fell = replace(failed(0), shape=Shape(length_um=1500.0), began_s=100.0)
    put(store, fell, 10.0)
    put(store, replace(good(0), shape=Shape(length_um=1503.0), began_s=130.0), 400.0)
    put(store, replace(good(0), shape=Shape(length_um=901.0), began_s=160.0), 1010.0)
    rates = rates_of(store.reader)
    assert (rates.seen, rates.graspable, rates.tried, rates.good) == (2, 2, 3, 2)


def test_a_fibre_that_a_later_survey_found_was_seen_and_could_be_grasped(
    store: CampaignStore,
) -> None:
    store.keep_sightings(1, [sighting(0.0), sighting(500.0, "crossing")])
    put(store, replace(good(0), began_s=100.0), 0.0)
    put(store, replace(good(0), began_s=130.0), 3000.0)
    put(store, replace(good(0), began_s=900.0), 0.0, plate=2)  # its sightings were not kept
    rates = rates_of(store.reader)
    assert (rates.seen, rates.graspable, rates.good) == (3, 2, 3)


def test_no_class_of_length_has_more_good_fibres_than_could_be_grasped() -> None:
    seen = [sighting(1000.0 * n, length_um=1000.0 + 100.0 * n) for n in range(10)]
    seen[4] = replace(seen[4], problem="not certain", length_um=2500.0)
    seen[7] = replace(seen[7], problem="out of reach")
    records = [
        replace(
            good(n), found=Pose(1000.0 * n, 0.0, 0.0), shape=Shape(length_um=1003.0 + 100.0 * n)
        )
        for n in range(10)
    ]
    found = selection_of(seen_fibres(seen, records), records)
    assert [(each.seen, each.graspable, each.good) for each in found.classes] == [
        (3, 3, 3),
        (2, 2, 2),
        (2, 2, 2),
        (3, 3, 3),
    ]
    assert found.unknown == 0


def test_weights_put_right_what_a_choice_by_length_does_to_the_mean() -> None:
    rng = np.random.default_rng(1)
    lengths = rng.uniform(800.0, 2400.0, 400)
    stiffness = 5e-11 * np.exp(0.5 * (lengths / 1600.0 - 1.0) + 0.1 * rng.standard_normal(400))
    taken = rng.random(400) < np.where(lengths > 1600.0, 0.9, 0.2)  # short ones are lost
    seen = [
        Seen(sighting(0.0, length_um=float(length)), Outcome.GOOD if each else None)
        for length, each in zip(lengths, taken, strict=True)
    ]
    one = good(0)
    assert one.bending is not None
    records = [
        replace(
            one,
            shape=Shape(length_um=float(length)),
            bending=replace(one.bending, ei_n_m2=float(ei)),
        )
        for length, ei, each in zip(lengths, stiffness, taken, strict=True)
        if each
    ]
    found = selection_of([*seen, Seen(sighting(0.0, "crossing"))], records)
    true = float(np.mean(np.log(stiffness)))
    plain = float(np.mean(np.log(stiffness[taken])))
    assert abs(math.log(found.weighted.ei_n_m2) - true) < 0.03 < 0.08 < abs(plain - true)
    assert found.unknown == 1
    assert found.missing_part == 0.0
    assert {name: count for name, count, _ in found.problems} == {"none": 400, "crossing": 1}


def test_a_class_without_a_good_fibre_is_said_to_stand_for_nothing() -> None:
    seen = [Seen(sighting(0.0, length_um=1000.0 + 100.0 * n)) for n in range(12)]
    records = [replace(good(n), shape=Shape(length_um=2000.0 + n)) for n in range(3)]
    found = selection_of(seen, records)
    assert found.missing_part == 0.75
    assert [math.isnan(each.weight) for each in found.classes] == [True, True, True, False]
