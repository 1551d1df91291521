"""The simulated library never holds its lock for the twin's physics, however much waits."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType

import numpy as np
import pytest
from tests.unit.mico.sim_client import FOR_EVER, STOPPED, Client

from cosmic.frame.clock import ManualClock
from cosmic.mico.hw import sim_device, sim_scu3d
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings

LONGEST_S = 1e-3
ADDRESSES = {"left.x": (0, 0), "left.y": (0, 1), "left.z": (0, 2), "probe.y": (2, 1)}


class MeasuredLock:
    """A lock that knows how much CPU time its holders spent with it."""

    made: "list[MeasuredLock]" = []  # noqa: RUF012 - emptied by the fixture

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._since_s = 0.0
        self.held_s: list[float] = []
        self.made.append(self)

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        got = self._lock.acquire(blocking, timeout)
        if got:
            self._since_s = time.thread_time()
        return got

    def release(self) -> None:
        self.held_s.append(time.thread_time() - self._since_s)
        self._lock.release()

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.release()


@pytest.fixture
def client(monkeypatch: pytest.MonkeyPatch) -> Client:
    MeasuredLock.made.clear()
    monkeypatch.setattr(sim_device, "Lock", MeasuredLock)
    scene = Scene.from_settings(shipped_settings(), ManualClock(auto_advance=True), seed=3)
    return Client(sim_scu3d.load_simulated_library(scene=scene))


def put_before_the_probe(client: Client) -> None:
    """Bring the fibre in the left gripper near the probe, as an operator would."""
    for name, place_um in (("left.x", 3600.0), ("left.z", -810.0), ("probe.y", -4975.0)):
        client.ok("MovePositionAbsolute_A", *ADDRESSES[name], round(place_um * 10), FOR_EVER)
        client.advance(20.0)
    for device in range(4):
        client.drain(device)


def journey(client: Client, moves: int) -> None:
    """Jog the probe to and fro at the fibre, and receive nothing."""
    for number in range(moves):
        way = -250 if number % 2 == 0 else 250
        client.ok("MovePositionRelative_A", *ADDRESSES["probe.y"], way, FOR_EVER)
        client.advance(0.02)


def test_a_long_journey_unseen_costs_no_call_more_than_a_millisecond_with_the_lock(
    client: Client,
) -> None:
    put_before_the_probe(client)
    (lock,) = MeasuredLock.made
    lock.held_s.clear()
    journey(client, 150)
    for name in ("GetStatus_A", "GetPosition_A", "Stop_A"):
        for device, channel in ADDRESSES.values():
            client.ok(name, device, channel)
    for device in range(4):
        client.drain(device)
    # The least of the longest few: a time slice that another program took counts as CPU at times.
    assert sorted(lock.held_s)[-3] < LONGEST_S


def felt(client: Client, *, looks: bool, receives: bool) -> list[float]:
    side = client.library.scene.force_side
    assert side is not None
    for _ in range(30):
        journey(client, 4)
        if looks:
            side.timeline.force_un(np.array([client.clock.now_s()]))
        if receives:
            client.drain(2)
    journey(client, 1)  # and there the probe stays
    ends_s = client.clock.now_s() + np.linspace(-0.2, 0.0, 11)
    return [float(each) for each in side.timeline.force_un(ends_s)]


@pytest.mark.parametrize("receives", [False, True])
def test_what_is_felt_does_not_depend_on_who_looked_before(client: Client, receives: bool) -> None:
    put_before_the_probe(client)
    scene = Scene.from_settings(shipped_settings(), ManualClock(auto_advance=True), seed=3)
    other = Client(sim_scu3d.load_simulated_library(scene=scene))
    put_before_the_probe(other)
    watched = felt(client, looks=True, receives=False)
    assert felt(other, looks=False, receives=receives) == pytest.approx(watched, rel=0.02, abs=0.5)
    assert max(map(abs, watched)) > 1.0  # there was something to feel


def test_movements_that_nobody_looks_at_do_not_pile_up(client: Client) -> None:
    put_before_the_probe(client)
    side = client.library.scene.force_side
    assert side is not None
    piled = []
    for _ in range(300):  # a listener receives some forty times a second, moving or not
        journey(client, 2)
        client.drain(2)
        piled.append(side.timeline.unseen)
    assert max(piled) < 250
    assert max(piled[150:]) <= 1.2 * max(piled[:150])


@contextmanager
def busy_with(client: Client, name: str) -> Iterator[None]:
    """Have another thread in the middle of a call, with the lock, as one that is held up."""
    inside, go_on = threading.Event(), threading.Event()

    def wait(_path: object) -> None:
        inside.set()
        assert go_on.wait(20.0)

    stage = client.library.scene.stages[name]
    before, stage.planned = stage.planned, wait
    order = (*ADDRESSES[name], 5000, FOR_EVER)
    thread = threading.Thread(target=client.call, args=("MovePositionAbsolute_A", *order))
    thread.start()
    assert inside.wait(20.0)
    stage.planned = before
    try:
        yield
    finally:
        go_on.set()
        thread.join()


def test_a_stop_waits_for_no_other_call_and_counts_from_when_it_was_made(client: Client) -> None:
    client.ok("SetClosedLoopMaxFrequency_A", *ADDRESSES["left.x"], 100)
    client.ok("MovePositionAbsolute_A", *ADDRESSES["left.x"], 30_000, FOR_EVER)
    client.advance(1.0)
    stage = client.library.scene.stages["left.x"]
    with busy_with(client, "left.y"):
        at_s = client.clock.now_s()
        client.ok("Stop_A", *ADDRESSES["left.x"])  # and comes back
        client.advance(1.0)
    assert client.status(*ADDRESSES["left.x"]) == STOPPED
    step_s = 1.0 / 100.0  # the step that was begun is finished
    assert stage.position(client.clock.now_s()) == pytest.approx(
        stage.position_then(at_s + step_s), abs=0.01
    )


def test_what_follows_a_stop_finds_it_carried_out(client: Client) -> None:
    stops = []
    for number in range(20):
        client.ok("MovePositionAbsolute_A", *ADDRESSES["left.x"], 100 * number, FOR_EVER)
        with busy_with(client, "left.y"):
            client.ok("Stop_A", *ADDRESSES["left.x"])
            asked = threading.Thread(
                target=lambda: stops.append(client.status(*ADDRESSES["left.x"]))
            )
            asked.start()
        asked.join()
    assert stops == [STOPPED] * 20


def test_what_was_left_and_fails_harms_no_other_call(caplog: pytest.LogCaptureFixture) -> None:
    lock, done = sim_device.LibraryLock(), list[str]()

    def fail() -> None:
        raise ValueError("this")

    with lock:
        lock.leave(fail)
        lock.leave(lambda: done.append("that"))
        assert not done
    assert done == ["that"]
    assert "this" in caplog.text
    assert lock.acquire(blocking=False)
    lock.release()
