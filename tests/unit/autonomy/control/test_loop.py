"""A loop whose thread stands still for a while does not make up for it."""

from types import SimpleNamespace
from typing import Any

import pytest

from cosmic.autonomy.control.law import Answer, ControlState
from cosmic.autonomy.control.loop import ControlLoop
from cosmic.autonomy.control.settings import ControlSettings
from cosmic.autonomy.control.sources import Sample
from cosmic.frame.clock import WALL
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


@pytest.mark.parametrize("rate", [1.0, 2.0])
def test_a_cycle_that_comes_late_counts_no_longer_than_the_latency(rate: float):
    settings = ControlSettings(real_time=False)
    law, moved_s = StallingLaw(), []
    source: Any = SimpleNamespace(
        name="force",
        stale_s=1.0,
        pause_s=1.0,
        begin=lambda _on_limit: None,
        newest=lambda: Sample(10.0, WALL.now_s()),
        end=lambda: None,
    )
    sink: Any = SimpleNamespace(
        name="probe.y",
        zero=0.0,
        target=0.0,
        packets=0,
        begin=lambda: None,
        move=lambda _velocity, dt_s: moved_s.append(dt_s),
        close=lambda _error: None,
    )
    loop = ControlLoop(source, law, sink, settings, rate=rate, policy=FailurePolicy())
    loop.begin()
    try:
        wait_until(lambda: len(law.given_s) > 5)
    finally:
        loop.finish()
        loop.join()
    assert max(law.given_s) <= settings.latency_s
    assert max(moved_s) <= settings.latency_s
