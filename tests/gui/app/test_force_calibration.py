"""The dialog that leads through a calibration of the force against known weights."""

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from cosmic.app.panels.force_calibration import ForceCalibrationDialog
from cosmic.autonomy.calibrating.force_scale import reach_of
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import ChannelSettings

RATE_HZ = 100.0


class Sensor:
    """Has samples of three seconds for each look at it; reads 5 % too high."""

    def __init__(self) -> None:
        self.channels = ["force"]
        self.running, self.problem, self.remote = True, "", False
        self.scales = {"force": Scale("sensor", "uN", (1.0, 18.0))}
        channel = ChannelSettings(
            name="force", board="Dev1", input="ai0", low_v=-10.0, high_v=10.0, colour="#E69F00"
        )
        self.settings = SimpleNamespace(channel=(channel,))
        self.limits: tuple[object, ...] = ()
        self.load_un = 0.0
        self.latest_chunk: DataChunk | None = None
        self._take: Callable[[DataChunk], None] = lambda chunk: None
        self._time_s = 0.0

    def subscribe(self, take: Callable[[DataChunk], None]) -> Callable[[], None]:
        self._take = take
        return lambda: None

    def sample(self) -> None:
        count = 100
        values = np.full((1, count), 1.0 + 1.05 * self.load_un)
        values += 0.01 * np.random.default_rng(int(self._time_s)).standard_normal((1, count))
        chunk = DataChunk(
            first_sample=round(self._time_s * RATE_HZ),
            time_s=self._time_s,
            rate_hz=RATE_HZ,
            channels=("force",),
            volts=values,
            scales=(Scale("plain", "uN"),),
        )
        self._time_s += count / RATE_HZ
        self.latest_chunk = chunk
        self._take(chunk)

    def set_scale(self, channel: str, scale: Scale) -> None:
        self.scales = {channel: scale}


@pytest.fixture
def sensor() -> Sensor:
    return Sensor()


@pytest.fixture
def dialog(sensor: Sensor, qtbot: QtBot) -> Iterator[ForceCalibrationDialog]:
    sensor.sample()
    rig: Any = sensor
    reach = reach_of(rig, "force")
    dialog = ForceCalibrationDialog(rig, "force", reach=reach, name="own")
    qtbot.addWidget(dialog)
    dialog.show()
    yield dialog
    dialog.close()


def read(dialog: ForceCalibrationDialog, sensor: Sensor, qtbot: QtBot) -> None:
    qtbot.mouseClick(dialog.read, Qt.MouseButton.LeftButton)
    for _ in range(4):
        sensor.sample()
    qtbot.waitUntil(lambda: dialog.start.isEnabled(), timeout=5000)


def begin(dialog: ForceCalibrationDialog, qtbot: QtBot, weights: str = "2, 5") -> None:
    dialog.weights.setText(weights)
    qtbot.mouseClick(dialog.start, Qt.MouseButton.LeftButton)


def carry_out(dialog: ForceCalibrationDialog, sensor: Sensor, qtbot: QtBot) -> None:
    """Read all that is asked for, with the weights of 2 and 5 mg."""
    for _ in range(20):
        text = dialog.instruction.text()
        if not text:
            break
        sensor.load_un = sum(9.80665 * n for n in (2, 5) if f"of {n} mg (" in text)
        read(dialog, sensor, qtbot)


def test_the_scale_changes_only_when_it_is_used(
    dialog: ForceCalibrationDialog, sensor: Sensor, qtbot: QtBot
) -> None:
    begin(dialog, qtbot)
    carry_out(dialog, sensor, qtbot)
    assert dialog.found is not None
    assert dialog.found.gain == pytest.approx(1.05, abs=0.002)
    assert "+5.0" in dialog.message.text()
    assert sensor.scales["force"].coefficients == (1.0, 18.0)
    qtbot.mouseClick(dialog.use, Qt.MouseButton.LeftButton)
    assert sensor.scales["force"].coefficients == pytest.approx((1.0 / 1.05, 18.0 / 1.05), rel=0.01)
    assert sensor.scales["force"].name == "own", "another channel may have the one before"
    assert not dialog.use.isEnabled()


def test_a_missing_weight_is_asked_for_again_and_a_reading_can_be_taken_back(
    dialog: ForceCalibrationDialog, sensor: Sensor, qtbot: QtBot
) -> None:
    dialog.weights.setText("2")
    qtbot.mouseClick(dialog.start, Qt.MouseButton.LeftButton)
    read(dialog, sensor, qtbot)
    assert "2 mg" in dialog.instruction.text()
    read(dialog, sensor, qtbot)
    assert "is not to be seen" in dialog.message.text()
    qtbot.mouseClick(dialog.undo, Qt.MouseButton.LeftButton)
    assert "Take everything off" in dialog.instruction.text()


@pytest.mark.parametrize("weights", ["", "two", "1;2", "1 2", "-1", "0", ",", "nan", "1e308", "30"])
def test_weights_that_are_none_are_refused(
    dialog: ForceCalibrationDialog, qtbot: QtBot, weights: str
) -> None:
    dialog.weights.setText(weights)
    qtbot.mouseClick(dialog.start, Qt.MouseButton.LeftButton)
    assert not dialog.read.isEnabled()
    assert dialog.message.text()


@pytest.mark.parametrize("percent", ["", "abc", "nan", "-5", "1,5", "50", "1e308"])
def test_an_uncertainty_that_is_none_is_refused(
    dialog: ForceCalibrationDialog, qtbot: QtBot, percent: str
) -> None:
    dialog.expanded.setText(percent)
    begin(dialog, qtbot)
    assert not dialog.read.isEnabled()
    assert "uncertainty" in dialog.message.text()


def test_what_counts_stands_in_the_fields_and_starting_anew_drops_the_readings(
    dialog: ForceCalibrationDialog, sensor: Sensor, qtbot: QtBot
) -> None:
    begin(dialog, qtbot, "1,5")
    assert dialog.message.text() == "1 mg, 5 mg: 11 readings"
    assert not dialog.weights.isEnabled()
    assert not dialog.expanded.isEnabled()
    read(dialog, sensor, qtbot)
    assert dialog.start.text() == "Start anew"
    qtbot.mouseClick(dialog.start, Qt.MouseButton.LeftButton)
    assert dialog.weights.isEnabled()
    assert not dialog.read.isEnabled()
    assert not dialog.undo.isEnabled()
    assert dialog.instruction.text() == ""
    begin(dialog, qtbot, "0.5, 1")
    assert "0.5 mg, 1 mg:" in dialog.message.text()


def test_readings_of_two_scales_are_not_mixed(
    dialog: ForceCalibrationDialog, sensor: Sensor, qtbot: QtBot
) -> None:
    begin(dialog, qtbot)
    read(dialog, sensor, qtbot)
    sensor.set_scale("force", Scale("sensor", "uN", (0.0, 18.0)))  # as Tare does
    read(dialog, sensor, qtbot)
    assert "changed meanwhile" in dialog.message.text()
    assert not dialog.read.isEnabled()


def test_of_two_calibrations_only_one_is_put_in_force(
    dialog: ForceCalibrationDialog, sensor: Sensor, qtbot: QtBot
) -> None:
    begin(dialog, qtbot)
    carry_out(dialog, sensor, qtbot)
    other = Scale("sensor", "uN", (0.9, 17.0))
    sensor.set_scale("force", other)
    qtbot.mouseClick(dialog.use, Qt.MouseButton.LeftButton)
    assert sensor.scales["force"] == other
    assert "changed meanwhile" in dialog.message.text()
    assert not dialog.use.isEnabled()


def test_a_scale_that_something_measures_with_stays(sensor: Sensor, qtbot: QtBot) -> None:
    sensor.sample()
    dialog = ForceCalibrationDialog(sensor, "force", running=lambda: "a campaign")  # type: ignore[arg-type]
    qtbot.addWidget(dialog)
    dialog.show()
    begin(dialog, qtbot)
    carry_out(dialog, sensor, qtbot)
    qtbot.mouseClick(dialog.use, Qt.MouseButton.LeftButton)
    assert "a campaign measures with this scale" in dialog.message.text()
    assert sensor.scales["force"].coefficients == (1.0, 18.0)
    assert dialog.use.isEnabled()
    dialog.close()


def test_an_acquisition_that_ends_ends_a_reading(
    dialog: ForceCalibrationDialog, sensor: Sensor, qtbot: QtBot
) -> None:
    begin(dialog, qtbot)
    qtbot.mouseClick(dialog.read, Qt.MouseButton.LeftButton)
    sensor.running = False
    qtbot.waitUntil(lambda: dialog.read.isEnabled(), timeout=5000)
    assert "acquisition was stopped" in dialog.message.text()
    qtbot.mouseClick(dialog.read, Qt.MouseButton.LeftButton)
    assert "start the acquisition" in dialog.message.text()


def test_its_texts_have_room_and_move_nothing(
    dialog: ForceCalibrationDialog, sensor: Sensor, qtbot: QtBot
) -> None:
    size, at = dialog.size(), dialog.use.pos()
    begin(dialog, qtbot)
    carry_out(dialog, sensor, qtbot)
    qtbot.mouseClick(dialog.use, Qt.MouseButton.LeftButton)
    assert (dialog.size(), dialog.use.pos()) == (size, at)
    message = dialog.message
    assert message.heightForWidth(message.width()) <= message.height()


def test_the_keys_that_read_once_read_again(
    dialog: ForceCalibrationDialog, sensor: Sensor, qtbot: QtBot
) -> None:
    dialog.activateWindow()
    begin(dialog, qtbot)
    assert dialog.focusWidget() is dialog.read
    qtbot.keyClick(dialog.read, Qt.Key.Key_Space)
    for _ in range(4):
        sensor.sample()
    qtbot.waitUntil(lambda: dialog.read.isEnabled(), timeout=5000)
    assert dialog.focusWidget() is dialog.read
