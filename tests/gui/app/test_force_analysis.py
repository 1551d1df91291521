"""Filter, statistics and spectrum of a force while it comes, and the seconds before Record."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import QSettings, Qt
from PySide6.QtGui import QAction
from pytestqt.qtbot import QtBot

import cosmic
from cosmic.app.panels.calculated import Calculation
from cosmic.app.panels.force_analysis import LowPass, RecentValues
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.scale import VOLTS
from cosmic.frame.errors import ConfigError
from gui.app.windows import Make

RATE_HZ = 1000.0


def chunks(values: np.ndarray, size: int = 50, first: int = 0) -> Iterator[DataChunk]:
    for at in range(0, values.size, size):
        part = values[None, at : at + size].copy()
        number = first + at
        yield DataChunk(number, number / RATE_HZ, RATE_HZ, ("force",), part, (VOLTS,))


def waves(seconds: float, *, hz: float, amplitude: float, mean: float = 0.0) -> np.ndarray:
    times = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    return mean + amplitude * np.sin(2.0 * np.pi * hz * times)


def test_statistics_are_those_of_the_last_ten_seconds() -> None:
    recent = RecentValues()
    for chunk in chunks(np.concatenate([np.full(5000, 99.0), waves(10.0, hz=5, amplitude=2.0)])):
        recent.add(chunk)
    found = recent.statistics()
    assert found is not None
    assert found.seconds == pytest.approx(10.0, abs=0.06)
    assert found.mean == pytest.approx(0.0, abs=0.1)
    assert found.deviation == pytest.approx(2.0 / np.sqrt(2.0), rel=0.01)
    assert (found.low, found.high) == (pytest.approx(-2.0, abs=0.01), pytest.approx(2.0, abs=0.01))


def test_looking_at_the_statistics_again_and_again_keeps_nothing_older() -> None:
    recent = RecentValues()
    for number, chunk in enumerate(
        chunks(np.concatenate([np.full(15_000, 99.0), np.full(10_000, 1.0)]))
    ):
        recent.add(chunk)
        if number % 10 == 0:
            recent.statistics()
    found = recent.statistics()
    assert found is not None
    assert found.seconds == pytest.approx(10.0, abs=0.06)
    assert (found.mean, found.high) == (pytest.approx(1.0), pytest.approx(1.0))


def test_what_came_before_a_pause_does_not_count() -> None:
    recent = RecentValues()
    for chunk in chunks(np.full(1000, 50.0)):
        recent.add(chunk)
    for chunk in chunks(np.full(1000, 1.0), first=9000):
        recent.add(chunk)
    assert recent.all().tolist() == [1.0] * 1000


def test_a_spectrum_has_its_peak_where_the_force_swings_and_the_power_of_it() -> None:
    recent = RecentValues()
    noise = np.random.default_rng(3).normal(0.0, 0.01, 8000)
    for chunk in chunks(waves(8.0, hz=60.0, amplitude=3.0) + noise):
        recent.add(chunk)
    spectrum = recent.spectrum()
    assert spectrum is not None
    frequencies, density = spectrum
    assert frequencies[np.argmax(density)] == pytest.approx(60.0, abs=0.5)
    power = float(np.sum(density**2) * (frequencies[1] - frequencies[0]))
    assert power == pytest.approx(3.0**2 / 2.0, rel=0.02)


def test_a_filter_takes_the_hum_away_and_leaves_the_level() -> None:
    low_pass = LowPass(3.0)
    filtered = [
        low_pass.apply(each) for each in chunks(waves(4.0, hz=100.0, amplitude=5.0, mean=7.0))
    ]
    values = np.concatenate([each.values[0] for each in filtered])[2000:]
    assert values.mean() == pytest.approx(7.0, abs=0.05)
    assert np.ptp(values) < 0.5


def test_a_formula_is_calculated_sample_by_sample() -> None:
    volts = np.array([[1.0, 2.0, 3.0], [0.5, 0.0, -4.0]])
    chunk = DataChunk(7, 0.1, RATE_HZ, ("force", "arm.aux"), volts, (VOLTS, VOLTS))
    found = Calculation("-(force - 2 * arm.aux) / 2 + abs(arm.aux)").chunk(chunk)
    assert found.values[0].tolist() == [0.5, -1.0, -1.5]
    assert found.first_sample == 7
    nothing = Calculation("sqrt(arm.aux) / 0").chunk(chunk)
    assert np.isnan(nothing.values).all()


@pytest.mark.parametrize(
    "formula",
    [
        "",
        "2 + 3",
        "force +",
        "__import__('os').system('true')",
        "force.real.imag",
        "force ** 99999",
        "abs(force, 2)",
        "[force]",
        "'force'",
        "force if force else 0",
        "force" + " + force" * 40,
        "(" * 190,
    ],
)
def test_what_is_no_formula_is_refused_and_runs_nothing(formula: str) -> None:
    with pytest.raises(ConfigError):
        Calculation(formula)


def test_a_formula_says_which_channel_is_missing() -> None:
    assert "no channel sparse; there are force, spare" in Calculation("force - sparse").missing(
        ("force", "spare")
    )


def test_a_calculated_channel_is_drawn_beside_the_force_and_kept_for_the_next_start(
    make: Make, qtbot: QtBot, stored: QSettings
) -> None:
    window = make(applications=("mico", "daqco", "vico"), rate=1.0)
    assert window.workspaces is not None
    window.workspaces.choose("Measure")
    tasks = window.tasks
    assert tasks is not None
    force = tasks.force
    assert force is not None
    next(each for each in force.more.menu().actions() if "Calculated" in each.text()).trigger()
    qtbot.keyClicks(force.formula, "force - sparse")
    qtbot.keyClick(force.formula, Qt.Key.Key_Return)
    assert "no channel sparse" in force.message.text()
    force.formula.setText("10 + 0 * force")
    qtbot.keyClick(force.formula, Qt.Key.Key_Return)
    assert force.curves.currentWidget() is force.calculated
    qtbot.waitUntil(lambda: force.calculated.newest == 10.0)
    qtbot.waitUntil(lambda: force.statistics.text() == "10 + 0 * force = 10")
    window.close()
    assert stored.value("force/calculated") == "10 + 0 * force"


def test_a_formula_of_a_channel_that_is_not_there_is_kept_for_a_later_start(
    make: Make, stored: QSettings
) -> None:
    stored.setValue("force/calculated", "force - 2 * absent")
    window = make(applications=("mico", "daqco", "vico"), hardware=False)
    assert window.tasks is not None
    force = window.tasks.force
    assert force is not None
    assert "no channel absent" in force.message.text()
    window.close()
    assert stored.value("force/calculated") == "force - 2 * absent"


def test_the_menu_of_the_force_does_what_it_says(
    make: Make, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    window = make(applications=("mico", "daqco", "vico"), rate=1.0)
    tasks = window.tasks
    assert tasks is not None
    force = tasks.force
    assert force is not None
    assert window.workspaces is not None
    window.workspaces.choose("Measure")
    monkeypatch.setattr(tasks.folder, "_folder", tmp_path)
    actions = {each.text(): each for each in force.more.menu().actions()}
    actions["Statistics of the last 10 s"].trigger()
    actions["Spectrum"].trigger()
    qtbot.waitUntil(
        lambda: "mean" in force.statistics.text() and " sd 0." in force.statistics.text()
    )
    qtbot.waitUntil(lambda: force.spectrum.points[0].size > 100)
    assert not force.by_time.isChecked()
    qtbot.mouseClick(force.by_time, Qt.MouseButton.LeftButton)
    assert force.curves.currentWidget() is force.chart
    slow: QAction = force.filters.actions()[-1]
    slow.trigger()
    daqco = window.platform.daqco
    assert daqco is not None
    force.before.setChecked(True)
    qtbot.waitUntil(lambda: daqco.buffer.samples > 3500)
    qtbot.mouseClick(force.record, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: daqco.recorder.state.duration_s > 3.1)
    begun = force.record.text()
    qtbot.mouseClick(force.record, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: "written" in force.message.text())
    assert "Stop" in begun
    (file,) = tmp_path.glob("*.h5")
    with cosmic.open_recording(file) as recording:
        assert recording.values("force").std() > 0.1  # the filter is of what is shown
        assert recording.time_s[-1] - recording.time_s[0] > 3.0
