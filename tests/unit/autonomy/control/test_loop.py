"""A control loop when its thread stands still, or its axis is gone."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from cosmic.autonomy.control.law import Answer, ControlState
from cosmic.autonomy.control.loop import ControlLoop
from cosmic.autonomy.control.settings import ControlSettings
from cosmic.autonomy.control.sources import Sample
from cosmic.frame.clock import WALL, ManualClock
from cosmic.frame.errors import NotConnectedError
from cosmic.frame.failure import FailurePolicy
from unit.mico.rigs import wait_until

STILL_S = 0.3


class StallingLaw:
    """Stands still in its third cycle, as a computer that swaps or collects garbage does."""

    def __init__(self) -> None:
        self.given_s: list[float] = []

    def step(self, measured: float, position: float, dt_s: float) -> Answer:
        self.given_s.append(dt_s)
        if len(self.given_s) == 3:
            WALL.sleep(STILL_S)
        return Answer(1.0, measured, ControlState.HOLDING)


def source() -> Any:
    """Ten of something, whenever it is asked for."""
    return SimpleNamespace(
        name="force",
        stale_s=1.0,
        pause_s=1.0,
        begin=lambda _on_limit: None,
        clock=WALL,
        newest=lambda: Sample(10.0, WALL.now_s(), WALL.now_s()),
        end=lambda: None,
    )


def sink(
    moved_s: list[float],
    close: Callable[[object], object] = lambda _error: None,
    braked_s: list[float] | None = None,
) -> Any:
    """An axis that notes for how long it was to move."""
    return SimpleNamespace(
        name="probe.y",
        zero=0.0,
        target=0.0,
        packets=0,
        begin=lambda: None,
        move=lambda _velocity, dt_s: moved_s.append(dt_s),
        brake=braked_s.append if braked_s is not None else lambda _dt_s: None,
        close=close,
    )


@pytest.mark.parametrize("rate", [1.0, 2.0])
def test_a_cycle_that_comes_late_counts_no_longer_than_the_latency(rate: float):
    settings = ControlSettings(real_time=False)
    law, moved_s = StallingLaw(), list[float]()
    loop = ControlLoop(source(), law, sink(moved_s), settings, rate=rate, policy=FailurePolicy())
    loop.begin()
    try:
        wait_until(lambda: len(law.given_s) > 5)
    finally:
        loop.finish()
        loop.join()
    assert max(law.given_s) <= settings.latency_s
    assert max(moved_s) <= settings.latency_s


def test_a_loop_whose_axis_cannot_be_stopped_any_more_ends_and_says_so(
    caplog: pytest.LogCaptureFixture,
) -> None:
    def close(_error: object) -> None:
        raise NotConnectedError("the station fibres does not answer")

    settings = ControlSettings(real_time=False)
    moved_s: list[float] = []
    loop = ControlLoop(
        source(), StallingLaw(), sink(moved_s, close), settings, rate=1.0, policy=FailurePolicy()
    )
    loop.begin()
    wait_until(lambda: moved_s)
    loop.finish()
    assert loop.over.wait(5.0) == "asked to"
    assert loop.join()
    assert "probe.y could not be stopped: the station fibres does not answer" in caplog.text


def test_what_is_silent_ends_a_loop_by_the_clock_of_the_source_alone() -> None:
    clock, settings = ManualClock(), ControlSettings(real_time=False)
    silent = source()
    begun_wall_s = WALL.now_s()
    silent.clock, silent.stale_s, silent.pause_s = clock, 0.1, 0.05
    silent.newest = lambda: Sample(10.0, begun_wall_s, 0.0)
    moved_s, braked_s = list[float](), list[float]()
    loop = ControlLoop(
        silent,
        StallingLaw(),
        sink(moved_s, braked_s=braked_s),
        settings,
        rate=1.0,
        policy=FailurePolicy(),
    )
    loop.begin()
    try:
        wait_until(lambda: len(braked_s) > 0)  # the axis waits
        wait_until(lambda: WALL.now_s() > begun_wall_s + 0.3)
        assert loop.ending is None
        clock.advance(0.2)
        assert loop.over.wait(5.0) == "no data"
    finally:
        loop.finish()
        loop.join()
