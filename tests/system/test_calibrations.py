"""Calibrations on the twin, judged by its truth, and taken up again after a restart."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import cosmic
from cosmic.app.rig import Rig
from cosmic.autonomy.calibrating.drift import DRIFT
from cosmic.autonomy.calibrating.registry import CalibrationStanding
from cosmic.autonomy.calibrating.touching import TOUCH
from cosmic.autonomy.calibrating.zooms import ZOOMS
from cosmic.autonomy.handling.context import HEIGHTS, HandlingContext
from cosmic.autonomy.handling.prepare import HELD, PLATE, PROBE, TABLE
from cosmic.autonomy.handling.settings import HandlingSettings, PushSettings
from cosmic.autonomy.shipped.calibrate import build_calibrate
from cosmic.frame.config import shipped_config_dir
from cosmic.twin.truth import read_truth

RATE = 8.0
# The limit has a dead man of a tenth of a second of the wall, which a busy machine oversleeps.
SETTINGS = HandlingSettings(push=PushSettings(stop_un=0.0))
TOO_LOW_UM = 40.0


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A platform whose file has the left tip lower than it is, and keeps its calibrations."""
    home = tmp_path_factory.mktemp("platform") / "config"
    shutil.copytree(shipped_config_dir(), home)
    path = home / "platform.toml"
    text = path.read_text(encoding="utf-8")
    for old, new in (
        ("tip_um = [-4000.0, 0.0, 1500.0]", f"tip_um = [-4000.0, 0.0, {1500.0 - TOO_LOW_UM}]"),
        ('calibration = ""', 'calibration = "kept"'),
    ):
        assert old in text
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")
    return home


@contextmanager
def rig_on(home: Path, truth: Path | None = None) -> Iterator[Rig]:
    with cosmic.connect(home, rate=RATE, sample="three-dry", seed=1, truth=truth) as rig:
        yield rig


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_everything_is_calibrated_and_agrees_with_the_truth(home: Path, tmp_path: Path) -> None:
    truth = tmp_path / "truth.jsonl"
    with rig_on(home, truth) as rig:
        work = HandlingContext.on(rig, SETTINGS)
        rig.procedure(build_calibrate(SETTINGS), work).run_here()
        work.close()
        registry = rig.calibrations
        entries = {each.name: each for each in registry.entries}
        assert set(entries) == {HEIGHTS, PLATE, HELD, PROBE, TOUCH, TABLE, ZOOMS}
        for each in entries.values():
            assert registry.standing(each) is CalibrationStanding.FRESH, each
        zooms = {round(each.zoom_counts) for each in rig.vico.calibrated}
        assert len(zooms) == 5
    assert entries[HEIGHTS].values["up_um"] == pytest.approx(TOO_LOW_UM, abs=5.0)
    assert entries[HEIGHTS].values["probe_up_um"] == pytest.approx(0.0, abs=5.0)
    assert entries[TOUCH].values["off_y_um"] == pytest.approx(0.0, abs=0.3)
    assert entries[PROBE].values["seen_y_um"] == pytest.approx(0.0, abs=5.0)
    centre = entries[TABLE].values["centre_x_um"], entries[TABLE].values["centre_y_um"]
    assert centre == pytest.approx((0.0, 0.0), abs=3.0)
    over = read_truth(truth).of("contact over")
    assert {each.facts["meant"] for each in over} == {True}
    touched = [each for each in read_truth(truth).of("left") if "tool" in each.facts]
    assert 0.0 < max(each.facts["peak_un"] for each in touched) < 0.8 * 180.0


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_after_a_restart_what_holds_is_looked_at_and_used(home: Path) -> None:
    with rig_on(home) as rig:
        registry = rig.calibrations
        before = {each.name: each for each in registry.entries}
        assert before, "kept by the test before"
        assert {registry.standing(each) for each in registry.entries} == {
            CalibrationStanding.UNCHECKED
        }
        work = HandlingContext.on(rig, SETTINGS)
        run = rig.procedure(build_calibrate(SETTINGS, zooms=False), work)
        run.run_here()
        work.close()
        now = {each.name: each for each in registry.entries}
        for name in (HEIGHTS, PLATE, HELD, PROBE, TOUCH, TABLE):
            assert registry.standing(now[name]) is CalibrationStanding.FRESH, now[name]
    # The others are measured anew where a tip is off, or is seen with a doubt.
    assert now[HEIGHTS].made == before[HEIGHTS].made
    assert now[HEIGHTS].checked is not None
    assert now[TOUCH].made > before[TOUCH].made
    assert work.calibration.up_um["left"] == before[HEIGHTS].values["up_um"]
    assert DRIFT not in now
