"""The dialog that leads through a calibration of the force against known weights."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from cosmic.app.panels.force_calibration import ForceCalibrationDialog
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.scale import Scale

RATE_HZ = 100.0


class Sensor:
    """Has samples of three seconds for each look at it; reads 5 % too high."""

    def __init__(self) -> None:
        self.channels = ["force"]
        self.running, self.problem, self.remote = True, "", False
        self.scales = {"force": Scale("sensor", "uN", (1.0, 18.0))}
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
    dialog = ForceCalibrationDialog(sensor, "force")  # type: ignore[arg-type]
    qtbot.addWidget(dialog)
    dialog.show()
    yield dialog
    dialog.close()


def read(dialog: ForceCalibrationDialog, sensor: Sensor, qtbot: QtBot) -> None:
    qtbot.mouseClick(dialog.read, Qt.MouseButton.LeftButton)
    for _ in range(4):
        sensor.sample()
    qtbot.waitUntil(lambda: dialog.start.isEnabled(), timeout=5000)


def test_the_scale_changes_only_when_it_is_used(
    dialog: ForceCalibrationDialog, sensor: Sensor, qtbot: QtBot
) -> None:
    dialog.weights.setText("2, 5")
    qtbot.mouseClick(dialog.start, Qt.MouseButton.LeftButton)
    for _ in range(20):
        if not dialog.instruction.text():
            break
        text = dialog.instruction.text()
        sensor.load_un = sum(9.80665 * n for n in (2, 5) if f"of {n} mg (" in text)
        read(dialog, sensor, qtbot)
    assert dialog.found is not None
    assert dialog.found.gain == pytest.approx(1.05, abs=0.002)
    assert "+5.0" in dialog.message.text()
    assert sensor.scales["force"].coefficients == (1.0, 18.0)
    qtbot.mouseClick(dialog.use, Qt.MouseButton.LeftButton)
    assert sensor.scales["force"].coefficients == pytest.approx((1.0 / 1.05, 18.0 / 1.05), rel=0.01)
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


@pytest.mark.parametrize("weights", ["", "two", "1;2", "-1", "0"])
def test_weights_that_are_none_are_refused(
    dialog: ForceCalibrationDialog, qtbot: QtBot, weights: str
) -> None:
    dialog.weights.setText(weights)
    qtbot.mouseClick(dialog.start, Qt.MouseButton.LeftButton)
    assert not dialog.read.isEnabled()
    assert dialog.message.text()
