"""A channel is calibrated against known loads, step by step."""

import math
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from cosmic.autonomy.calibrating.force_scale import (
    CalibrationProblem,
    ForceCalibration,
    KnownLoad,
    reach_of,
    weight,
)
from cosmic.daqco.api.daqco import Daqco, DaqLimit
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import ChannelSettings, LimitSettings

NOISE_UN = 0.05


class Sensor:
    """Reads loads with a gain, a zero that walks, and noise; the weights are off their mass."""

    def __init__(self, gain: float, seed: int, off: float = 0.0) -> None:
        self.gain, self.off = gain, off
        self.rng = np.random.default_rng(seed)
        self.zero = 3.0

    def read(self, instruction: str, loads: list[KnownLoad]) -> float:
        self.zero += 0.05 + 0.02 * float(self.rng.standard_normal())
        there = [each.force_un for each in loads if f"{each.words} (" in instruction]
        force = sum(there) * (1.0 + self.off)
        return self.zero + self.gain * force + NOISE_UN * float(self.rng.standard_normal())


def carried_out(sensor: Sensor, loads: list[KnownLoad], rounds: int = 2) -> ForceCalibration:
    calibration = ForceCalibration(loads, rounds)
    while not calibration.done:
        calibration.take(sensor.read(calibration.instruction, loads), NOISE_UN)
    return calibration


def test_every_load_is_asked_for_up_and_down_between_readings_of_nothing() -> None:
    calibration = ForceCalibration([weight(2.0, 1.0), weight(1.0, 1.0)], rounds=1)
    asked = []
    for force in (0.0, 9.8, 19.6, 19.6, 9.8, 0.0):
        asked.append(calibration.instruction)
        calibration.take(force, 0.01)
    assert [each.split(" (")[0] for each in asked] == [
        "Take everything off the sensor, and wait until it is at rest.",
        "Put the weight of 1 mg",
        "Put the weight of 2 mg",
        "Put the weight of 2 mg",
        "Put the weight of 1 mg",
        "Take everything off the sensor, and wait until it is at rest.",
    ]
    assert "once more" in asked[3]
    assert calibration.instruction == ""
    with pytest.raises(CalibrationProblem, match="all readings"):
        calibration.take(0.0, 0.01)


def test_the_interval_of_the_gain_holds_the_truth() -> None:
    rng, inside, halves = np.random.default_rng(5), 0, []
    for seed in range(200):
        gain = 1.0 + 0.05 * float(rng.standard_normal())
        off = 0.01 * float(rng.standard_normal())  # 2 % (k = 2)
        loads = [weight(each, 2.0) for each in (1.0, 2.0, 5.0)]
        found = carried_out(Sensor(gain, seed, off), loads).result()
        inside += abs(found.gain / gain - 1.0) <= 2.0 * found.gain_std_part
        halves.append(200.0 * found.gain_std_part)
    assert 0.91 <= inside / 200 <= 0.99
    assert 2.0 < np.median(halves) < 3.0


def test_the_scale_is_put_right_and_keeps_unit_and_name() -> None:
    loads = [weight(2.0, 1.0), weight(5.0, 1.0)]
    found = carried_out(Sensor(1.08, seed=1), loads).result()
    scale = found.applied_to(Scale("sensor", "uN", (4.0, 18.0)))
    assert (scale.name, scale.unit) == ("sensor", "uN")
    assert scale.coefficients == pytest.approx((4.0 / 1.08, 18.0 / 1.08), rel=0.01)
    assert "+8." in found.words or "+7." in found.words


def test_a_sensor_that_weights_pull_keeps_its_sign() -> None:
    loads = [weight(2.0, 1.0), weight(5.0, 1.0)]
    found = carried_out(Sensor(-1.08, seed=1), loads).result()
    assert found.gain == pytest.approx(1.08, rel=0.01)


def test_a_load_that_is_not_there_is_asked_for_again() -> None:
    calibration = ForceCalibration([weight(2.0, 1.0)])
    calibration.take(0.0, 0.01)
    with pytest.raises(CalibrationProblem, match=r"not to be seen: .* µN instead of .* µN\."):
        calibration.take(0.05, 0.01)
    with pytest.raises(CalibrationProblem, match="no force was read"):
        calibration.take(math.nan, 0.01)
    assert len(calibration.readings) == 1
    calibration.take(19.5, 0.01)
    calibration.undo()
    assert "2 mg" in calibration.instruction


def test_another_load_than_said_changes_nothing() -> None:
    loads = [weight(2.0, 1.0)]
    with pytest.raises(CalibrationProblem, match="Nothing was changed"):
        carried_out(Sensor(2.0, seed=1), loads).result()
    with pytest.raises(CalibrationProblem, match="readings are left"):
        ForceCalibration(loads).result()


@pytest.mark.parametrize(
    ("loads", "rounds"),
    [([], 2), ([weight(-1.0, 1.0)], 2), ([weight(math.nan, 1.0)], 2), ([weight(1.0, 1.0)], 0)],
)
def test_loads_that_are_none_are_refused(loads: list[KnownLoad], rounds: int) -> None:
    with pytest.raises(CalibrationProblem):
        ForceCalibration(loads, rounds)


def test_a_bent_characteristic_widens_the_interval() -> None:
    loads = [weight(each, 1.0) for each in (1.0, 5.0, 10.0)]
    straight = carried_out(Sensor(1.0, seed=2), loads).result()
    calibration = ForceCalibration(loads)
    sensor = Sensor(1.0, seed=2)
    while not calibration.done:
        read = sensor.read(calibration.instruction, loads)
        calibration.take(read - 5e-4 * (read - sensor.zero) ** 2, NOISE_UN)
    bent = calibration.result()
    assert bent.linearity_part > 2.0 * straight.linearity_part
    assert bent.gain_std_part > straight.gain_std_part


@pytest.mark.parametrize("percent", [-1.0, 50.0, math.nan, math.inf])
def test_an_uncertainty_that_is_none_is_refused(percent: float) -> None:
    with pytest.raises(CalibrationProblem, match="no uncertainty"):
        weight(1.0, percent)


def test_another_weight_is_noticed_at_once() -> None:
    calibration = ForceCalibration([weight(2.0, 1.0), weight(5.0, 1.0)])
    calibration.take(1.0, 0.05)
    with pytest.raises(CalibrationProblem, match=r"\+49\.00 µN is read instead of 19\.61 µN"):
        calibration.take(50.0, 0.05)
    calibration.take(20.6, 0.05)
    assert len(calibration.readings) == 2


def test_a_weight_that_was_left_on_the_sensor_is_noticed() -> None:
    calibration = ForceCalibration([weight(2.0, 1.0), weight(5.0, 1.0)], rounds=1)
    for read in (1.0, 20.6, 50.0, 50.1, 20.7):
        calibration.take(read, 0.05)
    with pytest.raises(CalibrationProblem, match="take everything off"):
        calibration.take(20.7, 0.05)
    calibration.take(1.2, 0.05)
    assert calibration.done


def test_a_sensor_that_ends_below_the_largest_load_is_not_taken_for_sure() -> None:
    loads = [weight(each, 0.5) for each in (1.0, 2.0, 5.0, 20.0)]
    calibration, sensor = ForceCalibration(loads), Sensor(1.0, seed=4)
    while not calibration.done:
        calibration.take(min(sensor.read(calibration.instruction, loads), 180.0), NOISE_UN)
    found = calibration.result()
    assert abs(found.gain - 1.0) <= 2.0 * found.gain_std_part
    assert "look for something that touches" in found.words


def test_one_load_is_said_not_to_show_a_straight_line() -> None:
    one, two = [weight(5.0, 1.0)], [weight(5.0, 1.0), weight(2.0, 1.0)]
    assert "use another one too" in carried_out(Sensor(1.0, seed=1), one).result().words
    assert "use another one too" not in carried_out(Sensor(1.0, seed=1), two).result().words


def channel_of(unit: str = "uN", limit: LimitSettings | None = None) -> Daqco:
    settings = ChannelSettings(
        name="force", board="Dev1", input="ai0", low_v=0.0, high_v=5.0, colour="#E69F00"
    )
    limits = () if limit is None else (DaqLimit(limit, False, None, None, ""),)
    there = SimpleNamespace(
        channels=["force"],
        settings=SimpleNamespace(channel=(settings,)),
        scales={"force": Scale("sensor", unit, (-250.0, 100.0))},
        limits=limits,
    )
    return cast("Daqco", there)


def test_no_load_is_beyond_the_input_or_the_limit_of_the_channel() -> None:
    assert reach_of(channel_of(), "force").largest_un == pytest.approx(250.0)
    limit = LimitSettings(channel="force", low=-150.0, high=160.0)
    reach = reach_of(channel_of(limit=limit), "force")
    assert reach.largest_un == 150.0
    with pytest.raises(CalibrationProblem, match=r"goes to 150 µN, as its limit.*lighter"):
        ForceCalibration([weight(1.0, 1.0), weight(16.0, 1.0)], reach=reach)
    assert ForceCalibration([weight(15.0, 1.0)], reach=reach).count == 7


def test_a_channel_that_reads_no_force_is_not_calibrated() -> None:
    with pytest.raises(CalibrationProblem, match="reads V"):
        reach_of(channel_of("V"), "force")
    with pytest.raises(CalibrationProblem, match="no channel 'aux'"):
        reach_of(channel_of(), "aux")
