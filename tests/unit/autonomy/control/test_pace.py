"""A fixed period, on a clock that a test moves."""

import os
import sys

import pytest
from typing_extensions import override

from cosmic.autonomy.control.pace import LoopTimer, ask_real_time, quick_switching
from cosmic.frame.clock import ManualClock


class Late(ManualClock):
    """Wakes whoever waits later than it was asked to."""

    def __init__(self) -> None:
        super().__init__(auto_advance=True)
        self.late_s = 0.0

    @override
    def wait(self, condition: object, until_s: float) -> None:
        super().wait(condition, until_s)  # type: ignore[arg-type]
        late_s, self.late_s = self.late_s, 0.0
        self.advance(late_s)


def test_deadlines_do_not_drift_with_lateness() -> None:
    clock = Late()
    timer = LoopTimer(0.005, clock)
    timer.begin()
    for number in range(400):
        clock.late_s = 0.001 if number % 2 else 0.002
        timer.wait()
    assert clock.now_s() == pytest.approx(400 * 0.005 + 0.001)
    seen = timer.meter.statistics()
    assert seen.cycles == 400
    assert seen.missed == 0
    assert seen.late_p99_s == pytest.approx(0.002)
    assert seen.deviation_p99_s == pytest.approx(0.001, rel=0.1)


def test_missed_periods_are_counted_and_not_caught_up() -> None:
    clock = Late()
    timer = LoopTimer(0.005, clock)
    timer.begin()
    timer.wait()
    clock.late_s = 0.0174
    assert timer.wait() == pytest.approx(0.0224)
    assert timer.wait() == pytest.approx(0.0026), "the grid of deadlines stays"
    seen = timer.meter.statistics()
    assert seen.missed == 3
    assert seen.longest_s == pytest.approx(0.0224)
    assert seen.histogram.sum() == 3
    assert seen.histogram[-1] == 1, "what lies beyond is in the outermost bin"


def test_an_end_wakes_it() -> None:
    timer = LoopTimer(1000.0)
    timer.begin()
    timer.end()
    assert timer.wait() == 0.0


def test_refused_priority_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_args: object) -> None:
        raise PermissionError(1, "Operation not permitted")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    assert "not permitted" in ask_real_time(10)
    monkeypatch.setattr(sys, "platform", "darwin")
    assert "no real-time" in ask_real_time(10)


def test_threads_switch_sooner_while_any_loop_runs() -> None:
    before_s = sys.getswitchinterval()
    with quick_switching():
        with quick_switching():
            assert sys.getswitchinterval() < 0.001
        assert sys.getswitchinterval() < 0.001
    assert sys.getswitchinterval() == before_s
