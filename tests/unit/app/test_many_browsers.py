"""What is told to many browsers: less often the more there are, and in one go."""

import asyncio
import gc

import pytest

from cosmic.app.gateways.http_answers import ended
from cosmic.app.gateways.hub import LONGEST_S, SHORTEST_S, published_every_s
from cosmic.app.gateways.websocket_line import Handover
from cosmic.frame.operation import Operation


@pytest.mark.parametrize(
    ("followers", "every_s"), [(1, SHORTEST_S), (10, SHORTEST_S), (20, 0.1), (500, LONGEST_S)]
)
def test_many_followers_get_less_often_what_is_published(followers: int, every_s: float) -> None:
    assert published_every_s(followers) == pytest.approx(every_s)


def test_a_loop_is_woken_once_for_all_that_is_handed_over_from_a_thread() -> None:
    async def run() -> tuple[list[int], int]:
        loop, came, wakes = asyncio.get_running_loop(), [], []
        handover, done = Handover(), asyncio.Event()
        wake = loop.call_soon_threadsafe
        loop.call_soon_threadsafe = lambda *call: (wakes.append(call), wake(*call))[1]
        for number in range(20):
            handover.put(lambda number=number: came.append(number))
        handover.put(done.set)
        await asyncio.wait_for(done.wait(), 5.0)
        woken = len(wakes)
        await asyncio.to_thread(handover.put, lambda: came.append(20))
        await asyncio.sleep(0)
        return came, woken

    came, woken = asyncio.run(run())
    assert came == list(range(21))
    assert woken == 1


def test_who_waits_for_hours_costs_no_memory() -> None:
    def looks() -> int:
        gc.collect()
        return sum(isinstance(each, asyncio.Event) for each in gc.get_objects())

    async def run() -> int:
        campaign: Operation[None] = Operation("a campaign of a day")
        before = looks()
        for _ in range(100):
            await ended(campaign, 0.0)
        kept = looks() - before
        campaign.finish(None)
        await asyncio.wait_for(ended(campaign, 60.0), 5.0)
        return kept

    assert asyncio.run(run()) == 0
