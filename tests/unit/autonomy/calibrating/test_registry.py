"""What the calibration registry keeps, and whether it lets one be used."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from cosmic.autonomy.calibrating.registry import (
    FILE,
    CalibrationEntry,
    CalibrationRegistry,
    CalibrationStanding,
)
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import ConfigError

NOON = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)


def entry(
    registry: CalibrationRegistry, name: str = "height", residual: float = 2.0
) -> CalibrationEntry:
    return CalibrationEntry(
        name, "left", {"up_um": 38.5}, residual, "um", 12.0, registry.now(), 10.0, registry.session
    )


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def registry(tmp_path: Path, clock: ManualClock) -> CalibrationRegistry:
    return CalibrationRegistry(tmp_path / "kept", "1.2", clock, lambda: NOON)


def test_what_was_put_is_in_force_and_fresh_until_it_is_too_old(
    registry: CalibrationRegistry, clock: ManualClock
) -> None:
    registry.put(entry(registry))
    found = registry.get("height", "left")
    assert found is not None
    assert (found.values, found.version) == ({"up_um": 38.5}, "1.2")
    assert registry.standing(found, 600.0) is CalibrationStanding.FRESH
    clock.advance(500.0)
    assert registry.age_s(found) == pytest.approx(490.0)
    clock.advance(200.0)
    assert registry.standing(found, 600.0) is CalibrationStanding.STALE


def test_after_a_restart_it_is_there_but_is_to_be_looked_at_first(
    registry: CalibrationRegistry, tmp_path: Path
) -> None:
    registry.put(entry(registry))
    later = CalibrationRegistry(
        tmp_path / "kept", "1.3", ManualClock(), lambda: NOON + timedelta(minutes=5)
    )
    found = later.get("height", "left")
    assert found is not None
    assert found.version == "1.2"
    assert later.age_s(found) == 300.0
    assert later.standing(found) is CalibrationStanding.UNCHECKED
    assert later.standing(found, 200.0) is CalibrationStanding.STALE
    holds = later.confirm(found, now_s=20.0)
    assert later.standing(holds) is CalibrationStanding.FRESH
    assert holds.checked == NOON + timedelta(minutes=5)
    assert later.age_s(holds) == pytest.approx(280.0), "it was made when it was made"


@pytest.mark.parametrize(
    ("back", "standing"),
    [
        (timedelta(seconds=30), CalibrationStanding.UNCHECKED),
        (timedelta(hours=2), CalibrationStanding.STALE),
        (timedelta(days=4000), CalibrationStanding.STALE),
    ],
)
def test_where_the_date_was_set_back_its_age_is_unknown_and_not_nothing(
    registry: CalibrationRegistry, tmp_path: Path, back: timedelta, standing: CalibrationStanding
) -> None:
    registry.put(entry(registry))
    later = CalibrationRegistry(tmp_path / "kept", "1.2", ManualClock(), lambda: NOON - back)
    found = later.get("height", "left")
    assert found is not None
    assert later.standing(found) is standing


def test_a_date_set_back_while_the_program_runs_changes_nothing(
    tmp_path: Path, clock: ManualClock
) -> None:
    dates = iter([NOON, NOON - timedelta(hours=5)])
    registry = CalibrationRegistry(tmp_path / "kept", "1.2", clock, lambda: next(dates))
    registry.put(entry(registry))
    found = registry.get("height", "left")
    assert found is not None
    assert registry.standing(found) is CalibrationStanding.FRESH


def test_a_poor_one_is_listed_with_its_reason_and_never_in_force(
    registry: CalibrationRegistry,
) -> None:
    registry.put(entry(registry))
    registry.refuse(entry(registry, residual=30.0), "residual 30 um, at most 12 is allowed")
    assert registry.get("height", "left") is None
    (listed,) = registry.entries
    assert registry.standing(listed) is CalibrationStanding.POOR
    assert "30 um" in listed.problem


@pytest.mark.parametrize("wrong", [math.nan, math.inf])
def test_what_is_no_number_is_never_in_force_and_keeps_nothing_else_from_being_kept(
    registry: CalibrationRegistry, tmp_path: Path, wrong: float
) -> None:
    good = entry(registry)
    registry.put(good)
    for other in (replace(good, values={"up_um": wrong}), replace(good, residual=wrong)):
        with pytest.raises(ConfigError, match="not a number; measure it again"):
            registry.put(other)
    found = registry.get("height", "left")
    assert found is not None
    assert found.values == good.values
    bad = replace(good, values={"up_um": wrong, "x_um": 1.0}, residual=wrong)
    registry.refuse(bad, f"residual {wrong}")
    assert registry.get("height", "left") is None
    (kept,) = CalibrationRegistry(tmp_path / "kept").entries
    assert (dict(kept.values), kept.problem) == ({"x_um": 1.0}, f"residual {wrong}")
    registry.put(entry(registry, "depth"))
    assert len(CalibrationRegistry(tmp_path / "kept").entries) == 2


def test_what_others_do_to_the_file_meanwhile_stays(
    registry: CalibrationRegistry, tmp_path: Path
) -> None:
    registry.put(entry(registry, "first"))
    registry.put(entry(registry, "second"))
    other = CalibrationRegistry(tmp_path / "kept", now=lambda: NOON)
    other.put(entry(other, "third"))
    other.forget("first", "left")
    registry.put(entry(registry, "fourth"))
    kept = CalibrationRegistry(tmp_path / "kept").entries
    assert [each.name for each in kept] == ["fourth", "second", "third"]
    assert [each.name for each in registry.entries] == ["fourth", "second", "third"]
    found = registry.get("third", "left")
    assert found is not None
    assert registry.standing(found) is CalibrationStanding.UNCHECKED
    other.put(entry(other, "second", residual=3.0))
    registry.put(entry(registry, "second", residual=1.0))
    assert {each.name: each.residual for each in registry.entries}["second"] == 1.0


def test_two_programs_that_write_at_once_lose_nothing_of_each_other(tmp_path: Path) -> None:
    registries = [CalibrationRegistry(tmp_path, now=lambda: NOON) for _ in range(2)]

    def put(number: int) -> None:
        for each in range(8):
            registries[number].put(entry(registries[number], f"height {number}.{each}"))

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(put, range(2)))
    assert len(CalibrationRegistry(tmp_path).entries) == 16


def test_a_file_that_became_wrong_meanwhile_stays_and_is_named(
    registry: CalibrationRegistry, tmp_path: Path
) -> None:
    registry.put(entry(registry))
    file = tmp_path / "kept" / "calibrations.toml"
    file.write_text("format = 1\n[[entry", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"calibrations\.toml: not valid TOML"):
        registry.put(entry(registry, "depth"))
    assert file.read_text(encoding="utf-8") == "format = 1\n[[entry"
    assert registry.get("depth", "left") is not None


def test_one_is_forgotten_and_listeners_are_notified(registry: CalibrationRegistry) -> None:
    counts: list[int] = []
    forget = registry.on_change(lambda: counts.append(len(registry.entries)))
    registry.put(entry(registry))
    registry.forget("height", "left")
    forget()
    registry.forget("height", "left")
    assert counts == [1, 0]


def test_any_text_comes_back_as_it_was(registry: CalibrationRegistry, tmp_path: Path) -> None:
    text = 'a "quoted" \\ name\twith µ, \x7f and\nlines'
    registry.refuse(entry(registry), text)
    (again,) = CalibrationRegistry(tmp_path / "kept").entries
    assert again.problem == text


def test_values_of_any_name_come_back(registry: CalibrationRegistry, tmp_path: Path) -> None:
    values = {"residual_0.58x_px": 0.1, "x": -1e-9, 'a "name"': 3.0}
    registry.put(replace(entry(registry), values=values))
    (again,) = CalibrationRegistry(tmp_path / "kept").entries
    assert again.values == values


def test_a_broken_file_is_refused_with_its_key(
    registry: CalibrationRegistry, tmp_path: Path
) -> None:
    registry.put(entry(registry))
    path = tmp_path / "kept" / FILE
    path.write_text(path.read_text().replace("residual = 2.0", 'residual = "good"'))
    with pytest.raises(ConfigError, match=r"calibrations\.toml: entry\[0\]\.residual"):
        CalibrationRegistry(tmp_path / "kept")


def test_without_a_folder_nothing_is_written(clock: ManualClock) -> None:
    registry = CalibrationRegistry(clock=clock)
    registry.put(entry(registry))
    assert len(registry.entries) == 1
