"""Limits are watched sample by sample, and nothing beyond one is missed."""

import math
from threading import Thread

import numpy as np
import pytest

from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.limits import SILENCE_S, Crossing, Limit, LimitGuard
from cosmic.daqco.core.scale import VOLTS, Scale
from cosmic.frame.clock import WALL, ManualClock, RatedClock
from cosmic.frame.errors import ConfigError, NotAvailable
from unit.mico.rigs import wait_until

FORCE = Scale("force", "uN", (-250.0, 100.0))


def chunk(volts: object, first: int = 0, rate_hz: float = 1000.0, time_s: float = 0.0) -> DataChunk:
    values = np.array(volts, dtype=float).reshape(1, -1)
    return DataChunk(first, time_s, rate_hz, ("force",), values, (FORCE,))


class Rig:
    def __init__(self) -> None:
        self.clock = ManualClock()
        self.stops: list[str] = []
        self.crossings: list[Crossing] = []
        self.guard = LimitGuard(self.clock, self.stops.append)
        self.guard.subscribe(self.crossings.append)
        self.guard.set_rate(1000.0)

    def arm(self, **changes: float) -> None:
        fields: dict[str, float] = {"low": -100.0, "high": 100.0, "hysteresis": 10.0} | changes
        self.guard.set_limit(Limit("force", armed=True, **fields))


def test_the_first_sample_beyond_stops_and_is_reported_with_its_value() -> None:
    rig = Rig()
    rig.arm()
    rig.guard.look(chunk([2.5, 3.0, 3.6, 3.7], first=500, time_s=2.0))
    assert len(rig.stops) == 1
    (crossing,) = rig.crossings
    assert crossing.sample == 502
    assert crossing.value == pytest.approx(110.0)
    assert crossing.limit == 100.0
    assert crossing.time_s == pytest.approx(2.002)
    assert crossing.unit == "uN"
    assert "force reached 110" in rig.stops[0]


def test_a_limit_that_is_not_armed_stops_nothing() -> None:
    rig = Rig()
    rig.guard.set_limit(Limit("force", low=-100.0, high=100.0))
    rig.guard.look(chunk([9.0]))
    assert not rig.stops


def test_what_is_armed_is_reported_once_with_its_unit() -> None:
    rig, notes = Rig(), list[str]()
    rig.guard.unit_of = {"force": "uN"}.__getitem__
    rig.guard.on_note(lambda channel, text: notes.append(f"{channel}: {text}"))
    rig.arm()
    rig.arm()
    assert notes == ["force: its limit is armed: -100 to 100 uN"]
    rig.arm(high=90.0)
    assert notes[1:] == ["force: its limit is armed: -100 to 90 uN"]


@pytest.mark.parametrize("volts", [4.0, 1.0, math.nan, math.inf, -math.inf])
def test_both_sides_and_what_is_no_number_count_as_crossed(volts: float) -> None:
    rig = Rig()
    rig.arm()
    rig.guard.look(chunk([2.5, volts]))
    assert len(rig.stops) == 1


@pytest.mark.parametrize("volts", [3.5, 1.5])
def test_a_force_exactly_at_its_limit_as_of_a_saturated_input_counts_as_crossed(
    volts: float,
) -> None:
    rig = Rig()
    rig.arm()
    rig.guard.look(chunk([2.5, volts, volts]))
    (crossing,) = rig.crossings
    assert abs(crossing.value) == 100.0
    assert crossing.sample == 1
    assert len(rig.stops) == 1


def test_missing_samples_trip_limits_that_are_armed_and_not_crossed_already() -> None:
    rig = Rig()
    rig.guard.set_limit(Limit("force", low=-100.0, high=100.0))
    rig.guard.trip_all("samples were lost")
    assert not rig.stops
    rig.arm()
    rig.guard.trip_all("samples were lost")
    rig.guard.trip_all("samples were lost")
    assert rig.stops == ["samples were lost while the limit of force is armed"]


def test_after_a_crossing_it_trips_again_only_when_the_value_has_come_well_back() -> None:
    rig = Rig()
    rig.arm()
    rig.guard.look(chunk([3.6]))
    rig.guard.look(chunk([3.7]))
    rig.guard.look(chunk([3.45, 3.6]))  # 95 uN: inside, but not by the hysteresis
    assert len(rig.stops) == 1
    rig.guard.look(chunk([3.3]))
    rig.guard.look(chunk([3.6]))
    assert len(rig.stops) == 2


def test_coming_back_and_crossing_again_within_one_chunk_is_seen() -> None:
    rig = Rig()
    rig.arm()
    rig.guard.look(chunk([3.6]))
    rig.guard.look(chunk([3.6, 2.5, 3.6, 2.5], first=10))
    assert [each.sample for each in rig.crossings] == [0, 12]


def test_of_a_million_samples_none_beyond_the_limit_is_missed() -> None:
    rig = Rig()
    random = np.random.default_rng(1)
    wanted = 0
    rig.arm(hysteresis=0.0)
    for number in range(1000):
        volts = random.uniform(1.6, 3.4, 1000)
        if random.random() < 0.3:
            volts[random.integers(1000)] = random.choice([1.4999, 3.5001])
            wanted += 1
        before = len(rig.stops)
        rig.guard.look(chunk(volts, first=1000 * number))
        assert len(rig.stops) - before == int(((volts < 1.5) | (volts > 3.5)).any())
    assert len(rig.stops) == wanted


def test_silence_while_armed_counts_as_crossed() -> None:
    rig = Rig()
    rig.arm()
    rig.guard.look(chunk([2.5]))
    rig.guard.look_for_silence()
    assert not rig.stops
    rig.clock.advance(1.5 * SILENCE_S)
    rig.guard.look_for_silence()
    rig.guard.look_for_silence()
    assert len(rig.stops) == 1
    assert math.isnan(rig.crossings[0].value)


def test_slow_channels_cannot_be_armed_and_are_disarmed_when_they_get_slow() -> None:
    rig = Rig()
    rig.guard.set_rate(100.0)
    with pytest.raises(NotAvailable, match="200 Hz"):
        rig.arm()
    rig.guard.set_rate(200.0)
    rig.arm()
    rig.guard.set_rate(100.0)
    assert not rig.guard.armed


def test_what_cannot_be_armed_any_more_is_disarmed_when_acquisition_starts_again() -> None:
    rig, notes = Rig(), list[str]()
    rig.arm()
    rig.guard.on_note(lambda _channel, text: notes.append(text))
    rig.guard.set_rate(0.0)

    def refuse(_limit: Limit) -> None:
        raise ConfigError("there is no such channel")

    rig.guard.check = refuse
    rig.guard.set_rate(1000.0)
    assert not rig.guard.armed
    assert notes[-1] == "its limit is disarmed: there is no such channel"


@pytest.mark.parametrize(
    ("low", "high", "hysteresis"),
    [(1.0, 1.0, 0.0), (2.0, 1.0, 0.0), (math.nan, 1.0, 0.0), (0.0, 1.0, 0.6), (0.0, 1.0, -0.1)],
)
def test_limits_that_leave_nothing_between_are_refused(
    low: float, high: float, hysteresis: float
) -> None:
    with pytest.raises(ConfigError, match="force"):
        Rig().guard.set_limit(Limit("force", low=low, high=high, hysteresis=hysteresis))


def test_a_listener_that_fails_keeps_nobody_from_being_stopped() -> None:
    rig = Rig()

    def fails(_: Crossing) -> None:
        raise RuntimeError("no")

    rig.guard.subscribe(fails)
    rig.arm()
    rig.guard.look(chunk([9.0]))
    assert len(rig.stops) == 1


@pytest.mark.parametrize(
    "coefficients", [(), (math.nan,), (1.0, math.inf), (0.0,) * 11, (1e13, 1.0)]
)
def test_a_scale_that_makes_no_sense_is_refused(coefficients: tuple[float, ...]) -> None:
    with pytest.raises(ConfigError, match="odd"):
        Scale("odd", "uN", coefficients)


def test_a_scale_is_a_polynomial_from_the_constant_upwards() -> None:
    scale = Scale("square", "uN", (1.0, 2.0, 3.0))
    assert scale.apply([0.0, 1.0, 2.0]).tolist() == [1.0, 6.0, 17.0]
    assert VOLTS.apply(-3.5).tolist() == -3.5


def test_a_crossing_is_reported_until_it_is_acknowledged_which_needs_the_value_back() -> None:
    rig = Rig()
    rig.arm()
    rig.guard.look(chunk([3.6]))
    with pytest.raises(NotAvailable, match="still beyond"):
        rig.guard.acknowledge("force")
    rig.guard.look(chunk([2.5]))
    assert rig.guard.limits["force"].tripped
    rig.guard.acknowledge("force")
    limit = rig.guard.limits["force"]
    assert limit.armed
    assert not limit.tripped


def test_a_simulation_that_runs_faster_may_be_silent_longer():
    stops: list[str] = []
    guard = LimitGuard(RatedClock(10.0), stops.append)
    guard.set_rate(1000.0)
    guard.set_limit(Limit("force", high=100.0, armed=True))
    until_s = WALL.now_s() + 1.5 * SILENCE_S
    wait_until(lambda: WALL.now_s() > until_s)
    guard.look_for_silence()
    assert not stops


def test_who_asks_after_a_stop_hears_of_the_crossing_that_made_it() -> None:
    rig = Rig()
    answers: list[tuple[Crossing, ...]] = []
    reader = Thread(target=lambda: answers.append(rig.guard.crossings))

    def trip(_why: str) -> None:
        reader.start()  # as a script does that the stop has woken
        reader.join(0.1)

    rig.guard.trip = trip
    rig.arm()
    rig.guard.look(chunk([4.5]))
    reader.join(2.0)
    assert [len(each) for each in answers] == [1]


def test_an_armed_channel_that_is_missing_in_the_data_counts_as_silent() -> None:
    rig = Rig()
    rig.arm()
    other = DataChunk(0, 0.0, 1000.0, ("spare",), np.zeros((1, 3)), (FORCE,))
    for _ in range(4):
        rig.clock.advance(0.5 * SILENCE_S)
        rig.guard.look(other)
        rig.guard.look_for_silence()
    assert len(rig.stops) == 1
    assert rig.stops[0] == "no data from force for 0.1 s while the limit of force is armed"
    with pytest.raises(NotAvailable, match="no data from force"):
        rig.guard.acknowledge("force")


def test_a_scale_that_changes_under_an_armed_limit_stops_whoever_changed_it() -> None:
    rig = Rig()
    rig.arm()
    rig.guard.look(chunk([2.5]))
    weak = DataChunk(1, 0.0, 1000.0, ("force",), np.full((1, 3), 2.5), (Scale("x", "uN", (0.0,)),))
    rig.guard.look(weak)
    assert len(rig.stops) == 1
    assert "scale of force changed" in rig.stops[0]


@pytest.mark.parametrize("simulated", [True, False])
def test_simulated_data_are_missed_by_the_platforms_clock_and_real_ones_by_the_wall(
    simulated: bool,
) -> None:
    rig = Rig()
    rig.guard.watch_silence(0.02, simulated=simulated)
    rig.arm()
    until_s = WALL.now_s() + 0.03
    wait_until(lambda: WALL.now_s() > until_s)  # the platform's clock is held meanwhile
    rig.guard.look_for_silence()
    assert len(rig.stops) == (0 if simulated else 1)
    rig.clock.advance(0.03)
    rig.guard.look_for_silence()
    assert len(rig.stops) == 1


def test_one_acknowledged_while_nothing_is_acquired_trips_anew_where_the_force_still_is() -> None:
    rig = Rig()
    rig.arm()
    rig.guard.look(chunk([4.0]))
    rig.guard.set_rate(0.0)
    rig.guard.acknowledge("force")
    rig.guard.set_rate(1000.0)
    assert rig.guard.limits["force"].armed
    rig.guard.look(chunk([4.0]))
    assert len(rig.stops) == 2
    assert rig.guard.limits["force"].tripped
