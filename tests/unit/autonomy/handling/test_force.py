"""Means of the force over times to come."""

from typing import Any

import numpy as np
import pytest

from cosmic.autonomy.handling import force
from cosmic.autonomy.handling.careful_move import LOOK_S, CarefulMove
from cosmic.autonomy.handling.force import ForceWatch
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.scale import Scale
from cosmic.frame.clock import ManualClock, RatedClock
from cosmic.frame.errors import ConfigError, DeviceTimeout, NotAvailable


class Daqco:
    """As much of `rig.daqco` as a watch uses."""

    channels = ("aux", "force")
    problem = "the board is gone"
    running = True

    def __init__(self) -> None:
        self.receiver: Any = None

    def subscribe(self, receiver: Any) -> Any:
        self.receiver = receiver
        return lambda: setattr(self, "receiver", None)


def chunk(first: int, values: np.ndarray) -> DataChunk:
    scale = Scale("as it is", "uN", (0.0, 1.0))
    volts = np.vstack([np.zeros(values.size), values])
    return DataChunk(first, first / 1000.0, 1000.0, ("aux", "force"), volts, (scale, scale))


@pytest.fixture
def watched() -> tuple[Daqco, ManualClock, ForceWatch]:
    daqco, clock = Daqco(), ManualClock()
    watch = ForceWatch(daqco, "force", clock)  # type: ignore[arg-type]
    watch.open()
    return daqco, clock, watch


def test_a_mean_holds_the_samples_of_its_time_and_no_others(
    watched: tuple[Daqco, ManualClock, ForceWatch],
):
    daqco, clock, watch = watched
    clock.advance(0.1)
    wanted = watch.wanted(0.05, settle_s=0.02)
    values = np.where((np.arange(300) >= 120) & (np.arange(300) <= 170), 7.0, -100.0)
    daqco.receiver(chunk(0, values[:150]))
    assert not wanted.done, "the last samples of its time are missing"
    daqco.receiver(chunk(150, values[150:]))
    assert wanted.done
    mean = wanted.wait(0.0)
    assert (mean.mean_un, mean.std_un) == (7.0, 0.0)
    assert mean.time_s == pytest.approx(0.145)
    assert mean.samples == pytest.approx(50, abs=1)


def test_whoever_waits_hears_when_the_samples_are_there(
    watched: tuple[Daqco, ManualClock, ForceWatch],
):
    daqco, _, watch = watched
    wanted, received = watch.wanted(0.05), []
    wanted.add_callback(received.append)
    daqco.receiver(chunk(0, np.zeros(20)))
    assert received == []
    daqco.receiver(chunk(20, np.zeros(80)))
    daqco.receiver(chunk(100, np.zeros(80)))
    assert received == [wanted], "once"


def test_a_wait_ends_when_no_samples_come(
    watched: tuple[Daqco, ManualClock, ForceWatch], monkeypatch: pytest.MonkeyPatch
):
    _, _, watch = watched
    with pytest.raises(DeviceTimeout):
        watch.wanted(0.05).wait(0.01)
    monkeypatch.setattr(force, "LIMIT_WALL_S", -1.0)
    with pytest.raises(NotAvailable, match="the board is gone"):
        watch.wanted(0.05).wait(1.0)


def test_a_wait_ends_at_once_where_the_channel_was_renamed(
    watched: tuple[Daqco, ManualClock, ForceWatch], monkeypatch: pytest.MonkeyPatch
):
    daqco, _, watch = watched
    wanted = watch.wanted(0.05)
    assert not wanted.done
    monkeypatch.setattr(daqco, "channels", ("aux", "strain"))
    assert wanted.done
    with pytest.raises(NotAvailable, match="no channel force any more: renamed"):
        wanted.wait(1.0)


def test_the_peak_counts_either_sign_and_begins_anew_when_it_was_taken(
    watched: tuple[Daqco, ManualClock, ForceWatch],
):
    daqco, _, watch = watched
    daqco.receiver(chunk(0, np.array([3.0, -9.0, 4.0])))
    assert watch.take_peak_un() == 9.0
    daqco.receiver(chunk(3, np.array([1.0, 2.0])))
    assert watch.take_peak_un() == 2.0


def test_a_watch_names_the_channels_there_are():
    with pytest.raises(ConfigError, match="aux, force"):
        ForceWatch(Daqco(), "farce", ManualClock())  # type: ignore[arg-type]


def test_a_closed_watch_takes_no_more(watched: tuple[Daqco, ManualClock, ForceWatch]):
    daqco, _, watch = watched
    watch.close()
    watch.close()
    assert daqco.receiver is None


class Movement:
    """As much of a movement as one that is watched uses."""

    done = False

    def cancel(self) -> None:
        self.done = True


def on_a_fast_clock() -> tuple[Daqco, RatedClock, ForceWatch]:
    daqco, clock = Daqco(), RatedClock(20.0)
    watch = ForceWatch(daqco, "force", clock)  # type: ignore[arg-type]
    watch.open()
    return daqco, clock, watch


def next_expected_s(clock: RatedClock, after_s: float = -1.0) -> float:
    assert clock.expectations is not None
    return clock.expectations.next_s(after_s)


def test_on_a_fast_clock_a_reading_is_expected_at_its_end():
    _, clock, watch = on_a_fast_clock()
    begun_s = clock.now_s()
    watch.wanted(0.04, settle_s=0.02)
    assert begun_s + 0.06 <= next_expected_s(clock) <= clock.now_s() + 0.06


def test_on_a_fast_clock_a_careful_move_is_looked_at_often():
    daqco, clock, watch = on_a_fast_clock()
    CarefulMove(Movement(), watch, -5.0, 5.0)  # type: ignore[arg-type]
    first_s = next_expected_s(clock)
    assert first_s <= clock.now_s() + LOOK_S
    daqco.receiver(chunk(0, np.zeros(5)))
    assert next_expected_s(clock, first_s) == np.inf, "one look ahead is enough"
    clock.sleep(LOOK_S)
    daqco.receiver(chunk(5, np.zeros(5)))
    assert first_s < next_expected_s(clock, first_s) <= clock.now_s() + LOOK_S
    daqco.receiver(chunk(10, np.full(5, 9.0)))
    clock.sleep(LOOK_S)
    last_s = clock.now_s()
    daqco.receiver(chunk(15, np.zeros(5)))
    assert next_expected_s(clock, last_s) == np.inf, "what has ended is watched no longer"
