"""A station and its client over a line that holds back, repeats and loses messages."""

from collections.abc import Iterator
from dataclasses import dataclass

import pytest

from contract.station_rig import Application, wait_until
from cosmic.frame.errors import MoveRefused
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.addresses import greetings
from cosmic.frame.network.caller import Access
from cosmic.frame.network.client_side_connection import ClientSideConnection
from cosmic.frame.network.codec import decode, encode
from cosmic.frame.network.delivery import Backlog
from cosmic.frame.network.errors import CallRefused, CommandExpired, StationAway, StationTimeout
from cosmic.frame.network.messages import Order, read_answer
from cosmic.frame.network.refusals import AT_ONCE, HELD_LIMIT
from cosmic.frame.network.server_listener import OF_ONE_NAME, ServerListener
from cosmic.frame.network.station import Station
from cosmic.frame.network.transport import Presence, Rule
from unit.frame.network.memory_wire import MemoryHub, MemoryQuestion, MemoryWire


@dataclass
class Bench:
    hub: MemoryHub
    station: Station
    listener: ServerListener
    application: Application
    client: ClientSideConnection
    access: dict[str, Access]


@pytest.fixture
def bench() -> Iterator[Bench]:
    hub, policy, application = MemoryHub(), FailurePolicy(), Application()
    station = Station("fibres", policy)
    station.host("stage", application)
    access = {"vision": Access.MOVE, "viewer": Access.VIEW}
    listener = ServerListener(station, MemoryWire(hub), access)
    client = ClientSideConnection("fibres", "vision", lambda: MemoryWire(hub), policy)
    try:
        listener.start()
        client.start()
        assert client.wait_until_here(5.0)
        yield Bench(hub, station, listener, application, client, access)
    finally:
        client.close()
        listener.shut_down()


def is_call(question: MemoryQuestion) -> bool:
    return bool(decode(question.message)[0] == Order.CALL)


def test_a_command_that_was_held_back_is_not_carried_out(bench: Bench) -> None:
    held: list[MemoryQuestion] = []

    def hold(question: MemoryQuestion) -> list[MemoryQuestion]:
        if is_call(question):
            held.append(question)
            return []
        return [question]

    bench.client.take_lease()
    bench.hub.tamper = hold
    with pytest.raises(StationTimeout):
        bench.client.call("stage", "move", {"target_um": 1.0}, timeout_s=0.1)
    with pytest.raises(StationTimeout):
        bench.client.call("stage", "add", {"a": 1.0}, timeout_s=0.1)
    bench.hub.tamper = lambda question: [question]
    assert not wait_until(lambda: False, 0.15)
    for each in held:  # the line delivers after all
        inbox = bench.hub.find(each.key)
        assert inbox is not None
        inbox.put(each)
    assert bench.client.call("stage", "add", {"a": 1.0}) == 2.0
    assert bench.application.moved == []
    for each in held:
        assert "too late" in str(decode(each.answers.get(timeout=5.0)))


def test_a_command_that_comes_twice_is_carried_out_once(bench: Bench) -> None:
    def twice(question: MemoryQuestion) -> list[MemoryQuestion]:
        return [question, MemoryQuestion(question.key, question.message)]

    bench.client.take_lease()
    bench.hub.tamper = twice
    bench.client.call("stage", "move", {"target_um": 1.0})
    bench.hub.tamper = lambda question: [question]
    bench.client.call("stage", "add", {"a": 1.0})
    assert bench.application.moved == [1.0]


def test_when_signs_of_life_do_not_come_through_the_motion_stops_and_the_lease_goes(
    bench: Bench,
) -> None:
    bench.client.take_lease()
    bench.client.call("stage", "move", {"target_um": 1.0})
    dead_man = bench.application.dead_man
    assert dead_man is not None
    bench.hub.tamper = lambda _: []
    assert wait_until(lambda: dead_man.expired, 2.0)
    assert "nothing heard from vision" in dead_man.why
    assert wait_until(lambda: bench.station.lease.state.local, 3.0)
    assert wait_until(lambda: not bench.client.state.here, 3.0)
    bench.hub.tamper = lambda question: [question]
    assert bench.client.wait_until_here(5.0)
    with pytest.raises(MoveRefused):
        bench.client.call("stage", "move", {"target_um": 2.0})


def test_a_client_knows_whether_it_holds_the_lease(bench: Bench) -> None:
    assert not bench.client.holds_lease
    bench.client.take_lease()
    assert bench.client.holds_lease
    assert not wait_until(lambda: not bench.client.holds_lease, 0.3), "heartbeats keep it"
    bench.client.release_lease()
    assert not bench.client.holds_lease
    bench.client.take_lease()
    bench.station.lease.take_over()
    assert wait_until(lambda: not bench.client.holds_lease), "the next heartbeat tells"


def test_signs_of_life_that_come_late_do_not_keep_a_motion_alive(bench: Bench) -> None:
    held: list[MemoryQuestion] = []

    def hold(question: MemoryQuestion) -> list[MemoryQuestion]:
        held.append(question)
        return []

    bench.client.take_lease()
    bench.client.call("stage", "move", {"target_um": 1.0})
    dead_man = bench.application.dead_man
    assert dead_man is not None
    bench.hub.tamper = hold
    assert wait_until(lambda: bool(held))
    assert wait_until(lambda: dead_man.expired, 2.0)
    for each in held:
        inbox = bench.hub.find(each.key)
        if inbox is not None:
            inbox.put(each)
    assert dead_man.expired


def test_why_a_station_is_away_is_said_once(bench: Bench) -> None:
    seen: list[Presence] = []
    bench.client.presence(seen.append)
    bench.hub.asked.clear()
    assert wait_until(lambda: not bench.client.state.here)
    assert not wait_until(lambda: False, 0.3), "it is tried again meanwhile"
    with pytest.raises(StationAway) as told:
        bench.client.call("stage", "add", {"a": 1.0})
    assert str(told.value) == "fibres is away: no answer"
    assert [each.why for each in seen if not each.here] == ["no answer"]


def test_a_task_ends_here_when_the_connection_is_lost(bench: Bench) -> None:
    bench.client.take_lease()
    task = bench.client.call("stage", "travel")
    seen: list[Presence] = []
    bench.client.presence(seen.append)
    bench.hub.tamper = lambda _: []
    for key, inlets in bench.hub.inlets.items():
        if "/to/" in key:
            inlets.clear()
    with pytest.raises(StationAway, match="is away"):
        task.wait(5.0)  # type: ignore[attr-defined]
    assert not seen[-1].here
    there = bench.application.tasks[0]
    assert wait_until(lambda: there.done), "what moved for the client was cancelled"


def test_a_gap_in_what_should_be_complete_is_counted(bench: Bench) -> None:
    received: list[object] = []
    subscription = bench.client.subscribe("chunks", Rule.ALL, received.append)

    def published() -> bool:
        bench.station.publish("chunks", "first")
        return bool(received)

    assert wait_until(published)
    bench.station.publish("chunks", "settled")
    assert wait_until(lambda: received[-1] == "settled")
    inlets = bench.hub.inlets["cosmic/fibres/topic/all/chunks"]
    (kept,) = inlets
    nowhere: Backlog[bytes] = Backlog(Rule.ALL)
    inlets[:] = [nowhere]
    for _ in range(3):
        bench.station.publish("chunks", "lost")
    assert wait_until(lambda: len(nowhere) == 3)
    inlets[:] = [kept]
    bench.station.publish("chunks", "last")
    assert wait_until(lambda: received[-1] == "last")
    assert subscription.lost == 3
    assert "lost" not in received


def test_who_is_not_on_the_list_is_refused_with_the_reason(bench: Bench) -> None:
    stranger = ClientSideConnection(
        "fibres", "stranger", lambda: MemoryWire(bench.hub), FailurePolicy()
    )
    try:
        stranger.start()
        assert wait_until(lambda: "not on the list" in stranger.state.why)
        with pytest.raises(StationAway, match="not on the list"):
            stranger.call("stage", "add", {"a": 1.0})
    finally:
        stranger.close()


def test_a_viewer_looks_and_stops_only(bench: Bench) -> None:
    viewer = ClientSideConnection(
        "fibres", "viewer", lambda: MemoryWire(bench.hub), FailurePolicy()
    )
    try:
        viewer.start()
        assert viewer.wait_until_here(5.0)
        assert viewer.call("stage", "count") == 0
        viewer.call("stage", "stop")
        for refused in (viewer.take_lease, lambda: viewer.publish("shared/a", 1)):
            with pytest.raises(CallRefused):
                refused()
        with pytest.raises(CallRefused):
            viewer.call("stage", "add", {"a": 1.0})
    finally:
        viewer.close()


def test_the_station_reports_who_is_here(bench: Bench) -> None:
    seen: list[Presence] = []
    bench.station.presence(seen.append)
    assert [(each.name, each.here) for each in seen] == [("vision", True)]
    bench.client.close()
    assert wait_until(lambda: len(seen) == 2)
    assert not seen[-1].here


def test_a_stale_stop_stops_all_the_same(bench: Bench) -> None:
    stale: list[MemoryQuestion] = []

    def hold(question: MemoryQuestion) -> list[MemoryQuestion]:
        if is_call(question):
            stale.append(question)
            return []
        return [question]

    bench.hub.tamper = hold
    with pytest.raises((StationTimeout, CommandExpired)):
        bench.client.call("stage", "stop", timeout_s=0.05)
    assert not wait_until(lambda: False, 0.1)
    inbox = bench.hub.find(stale[0].key)
    assert inbox is not None
    inbox.put(stale[0])
    assert wait_until(lambda: bench.application.stops == 1)


# --- whoever asks again and again


def greet(bench: Bench, key: str, order: str = "hello") -> MemoryQuestion:
    """Greet as `key` without waiting for the answer."""
    message = encode([order, "", 1, 0.0, 1e18, "", "", {}])
    question = MemoryQuestion(greetings("fibres", key), message)
    inbox = bench.hub.find(question.key)
    assert inbox is not None
    inbox.put(question)
    return question


def test_a_flood_of_refused_greetings_is_answered_later_and_later_and_keeps_nobody_out(
    bench: Bench,
) -> None:
    asked = [greet(bench, f"stranger/{number}") for number in range(2000)]
    begun = greet(bench, "vision/new")
    assert read_answer(begun.answers.get(timeout=5.0))[2] is None, "an honest one gets in"
    at_once = sum(not each.answers.empty() for each in asked)
    assert at_once <= AT_ONCE + HELD_LIMIT
    assert bench.client.call("stage", "add", {"a": 1.0}) == 2.0
    assert wait_until(lambda: not asked[AT_ONCE].answers.empty()), "a second later, or two"
    assert asked[-1].answers.empty(), "there is no room for as many"


def test_a_flood_in_an_honest_name_does_not_keep_its_owner_out(bench: Bench) -> None:
    for number in range(500):
        greet(bench, f"vision/x{number}", order="call")
    begun = greet(bench, "vision/honest")
    assert read_answer(begun.answers.get(timeout=5.0))[2] is None


def test_one_name_cannot_take_every_place(bench: Bench) -> None:
    answers = [greet(bench, f"viewer/{number}") for number in range(32)]
    errors = [read_answer(each.answers.get(timeout=5.0))[2] for each in answers]
    assert sum(error is None for error in errors) == OF_ONE_NAME
    assert read_answer(greet(bench, "vision/2").answers.get(timeout=5.0))[2] is None
