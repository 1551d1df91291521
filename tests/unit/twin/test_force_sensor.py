"""The force sensor: gain, bandwidth, noise, drift, saturation."""

import numpy as np
import pytest

from cosmic.twin.force_sensor import ForceSensor
from cosmic.twin.force_settings import ForceSensorSettings
from cosmic.twin.settings import shipped_settings

RATE_HZ = 15_000.0
SHIPPED = shipped_settings().force_sensors["force"]
PERFECT = {"gain_error": 0.0, "zero_error_v": 0.0, "noise_un": 0.0, "drift_un_sqrt_s": 0.0}


def sensor(force=None, *, seed: int = 0, **changed: float) -> ForceSensor:
    settings: ForceSensorSettings = SHIPPED.model_copy(update=changed)
    return ForceSensor("force", settings, force, seed)


def times(duration_s: float, rate_hz: float = RATE_HZ) -> np.ndarray:
    return np.arange(round(duration_s * rate_hz)) / rate_hz


def test_the_data_sheet_holds_for_a_perfect_sensor() -> None:
    perfect = sensor(lambda t: np.full_like(t, 42.0), **PERFECT)
    assert perfect.volts(times(0.1)) == pytest.approx(2.5 + 0.01 * 42.0)


def test_each_sensor_differs_from_its_data_sheet_by_its_seed() -> None:
    sensors = [sensor(seed=seed) for seed in range(200)]
    gains = np.array([each.true_gain_v_un for each in sensors])
    zeros = np.array([each.true_zero_v for each in sensors])
    assert gains.mean() == pytest.approx(0.01, rel=0.003)
    assert gains.std() == pytest.approx(0.0001, rel=0.2)
    assert zeros.std() == pytest.approx(0.005, rel=0.2)
    assert sensor(seed=7).true_gain_v_un == sensor(seed=7).true_gain_v_un


@pytest.mark.parametrize("rate_hz", [200.0, 2_000.0, 15_000.0])
def test_noise_has_its_size_after_the_bandwidth_at_any_rate(rate_hz: float) -> None:
    noisy = sensor(**(PERFECT | {"noise_un": 0.3}))
    volts = noisy.volts(times(20.0, rate_hz))
    assert volts.std() / 0.01 == pytest.approx(0.3, rel=0.05)
    assert volts.mean() == pytest.approx(2.5, abs=0.0005)


def test_noise_is_of_the_colour_of_one_pole() -> None:
    volts = sensor(**(PERFECT | {"noise_un": 0.3})).volts(times(20.0)) - 2.5
    neighbours = np.corrcoef(volts[:-1], volts[1:])[0, 1]
    assert neighbours == pytest.approx(np.exp(-2.0 * np.pi * 1000.0 / RATE_HZ), abs=0.01)


def test_a_step_of_force_is_seen_through_the_bandwidth() -> None:
    step = sensor(lambda t: np.where(t >= 0.01, 100.0, 0.0), **PERFECT)
    at = times(0.02, 150_000.0)
    felt = (step.volts(at) - 2.5) / 0.01
    after = at - 0.01
    assert felt[at < 0.0099] == pytest.approx(0.0)
    expected = 100.0 * (1.0 - np.exp(-2.0 * np.pi * 1000.0 * after))
    assert felt[after > 0.0] == pytest.approx(expected[after > 0.0], abs=5.0)
    assert felt[-1] == pytest.approx(100.0)


def test_the_zero_wanders_with_the_root_of_time() -> None:
    ends, quarters = [], []
    for seed in range(400):
        volts = sensor(seed=seed, **(PERFECT | {"drift_un_sqrt_s": 0.02})).volts(times(100.0, 10.0))
        walk = (volts - 2.5) / 0.01
        assert walk[0] == pytest.approx(0.0)
        ends.append(walk[-1])
        quarters.append(walk[250])
    assert np.std(ends) == pytest.approx(0.2, rel=0.15)
    assert np.std(quarters) == pytest.approx(0.1, rel=0.15)
    assert abs(np.mean(ends)) < 0.04


def test_it_saturates_at_its_range_and_stays_inside_the_supply() -> None:
    ramp = sensor(lambda t: 1000.0 * (t - 1.0), **PERFECT)
    volts = ramp.volts(times(2.0, 1000.0))
    assert volts.min() == pytest.approx(0.7) and volts.max() == pytest.approx(4.3)
    huge = sensor(lambda t: np.full_like(t, 1e9), seed=3)
    assert 0.0 <= huge.volts(times(0.1)).max() == pytest.approx(4.3)


@pytest.mark.parametrize("portion", [1, 7, 75, 10_000])
def test_the_same_times_in_other_portions_give_the_same_volts(portion: int) -> None:
    def force(t: np.ndarray) -> np.ndarray:
        return 50.0 * np.sin(40.0 * t)

    at = times(0.5)
    whole = sensor(force).volts(at)
    parts = sensor(force)
    pieces = [parts.volts(at[i : i + portion]) for i in range(0, at.size, portion)]
    assert np.concatenate(pieces) == pytest.approx(whole, abs=1e-9)
    assert not np.allclose(sensor(force, seed=1).volts(at), whole, atol=1e-4)


def test_after_a_pause_it_goes_on_where_time_is_now() -> None:
    paused = sensor(lambda t: np.where(t > 5.0, 80.0, 0.0), **PERFECT)
    paused.volts(times(0.1))
    assert paused.volts(times(0.1) + 3600.0) == pytest.approx(2.5 + 0.8)


@pytest.mark.parametrize(
    "wrong", [[0.2, 0.1], [float("nan")], [0.1, float("nan"), 0.2], [0.1, float("inf")]]
)
def test_times_that_do_not_rise_are_refused(wrong: list[float]) -> None:
    with pytest.raises(ValueError, match="must rise"):
        sensor().volts(np.array(wrong))


def test_no_times_give_no_volts() -> None:
    assert sensor().volts(np.empty(0)).shape == (0,)


def test_a_sensor_that_nothing_touches_reads_noise_and_drift() -> None:
    spare = ForceSensor("spare", shipped_settings().force_sensors["spare"], None, 0)
    volts = spare.volts(times(1.0))
    assert volts.std() == pytest.approx(0.004, rel=0.15)
    assert volts.mean() == pytest.approx(2.5, abs=0.02)


def test_a_dead_sensor_stands_at_its_zero_without_noise() -> None:
    dead = sensor(lambda t: np.full_like(t, 42.0))
    dead.dead = True
    assert set(dead.volts(times(0.01))) == {dead.true_zero_v}
