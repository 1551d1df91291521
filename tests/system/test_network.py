"""Stations and clients in processes of their own: what dies, freezes, lies or is cut off."""

import os
import random
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import pytest

from contract.station_rig import (
    Application,
    connected,
    free_port,
    listening,
    wait_until,
)
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import Failure, FailurePolicy
from cosmic.frame.network.addresses import asks, greetings
from cosmic.frame.network.certificates import make_certificates
from cosmic.frame.network.codec import encode
from cosmic.frame.network.errors import StationAway
from cosmic.frame.network.line_settings import Certificates, Line
from cosmic.frame.network.messages import read_answer
from cosmic.frame.network.server_listener import ServerListener
from cosmic.frame.network.station import Station
from cosmic.frame.network.zenoh_wire import ZenohWire
from cosmic.frame.threads import running_threads

CHILD = Path(__file__).with_name("network_child.py")
TESTS = CHILD.parents[1]


class Served:
    """A station in this process."""

    def __init__(self) -> None:
        self.foreign = _sockets()
        self.policy = FailurePolicy()
        self.failures: list[Failure] = []
        self.policy.subscribe(self.failures.append)
        self.station = Station("fibres", self.policy)
        self.application = Application()
        self.station.host("stage", self.application)
        self.port = free_port()
        self.endpoint = f"tcp/127.0.0.1:{self.port}"
        self.listener: ServerListener


@pytest.fixture
def served() -> Iterator[Served]:
    made = Served()
    with listening(made.station, Line(made.endpoint, True, "fibres")) as made.listener:
        yield made


@contextmanager
def child(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [sys.executable, str(CHILD), *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS.parent / "src")])},
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate(timeout=10)


def first_line(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def holder_moves(served: Served) -> None:
    assert wait_until(lambda: len(served.application.moved) > 3)
    assert served.station.lease.state.holder == "holder"


# --- whoever moves is lost --------------------------------------------------------------------


def test_when_the_holder_is_killed_its_motion_stops(served: Served) -> None:
    with child("hold", served.endpoint) as process:
        holder_moves(served)
        process.send_signal(signal.SIGKILL)
        killed_s = WALL.now_s()
        dead_man = served.application.dead_man
        assert dead_man is not None
        assert wait_until(lambda: dead_man.expired, 2.0)
        took_s = WALL.now_s() - killed_s
        assert wait_until(lambda: served.station.lease.state.local)
        assert took_s < 1.0, "the heartbeat goes with the process"
        assert wait_until(lambda: served.listener.clients == [])


def test_when_the_holder_freezes_its_motion_stops_and_nothing_old_is_done_later(
    served: Served,
) -> None:
    with child("hold", served.endpoint) as process:
        holder_moves(served)
        process.send_signal(signal.SIGSTOP)
        frozen_s = WALL.now_s()
        dead_man = served.application.dead_man
        assert dead_man is not None
        assert wait_until(lambda: dead_man.expired, 3.0)
        took_s = WALL.now_s() - frozen_s
        assert 0.1 < took_s < 2.0, "0.3 s of silence are allowed"
        assert wait_until(lambda: served.station.lease.state.local, 3.0)
        moved = list(served.application.moved)
        process.send_signal(signal.SIGCONT)
        with connected(served.endpoint, "another") as other:
            assert wait_until(lambda: len(served.listener.clients) == 2, 5.0), "it is back"
            other.take_lease()
            other.call("stage", "move", {"target_um": -1.0})
        assert served.application.moved == [*moved, -1.0], "it has to take the lease again"


# --- whoever serves is lost -------------------------------------------------------------------


def test_a_station_whose_main_thread_dies_is_gone() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with child("serve", endpoint) as process:
        assert first_line(process) == "serving"
        with connected(endpoint) as client:
            assert client.call("stage", "add", {"a": 1.0}) == 2.0
            assert process.stdin is not None
            process.stdin.write("\n")
            process.stdin.flush()
            assert process.wait(10.0) == 1
            assert wait_until(lambda: not client.state.here)
            with pytest.raises(StationAway, match="not running or not reachable"):
                client.call("stage", "add", {"a": 1.0})


def test_a_client_says_why_it_is_away_and_comes_back_by_itself() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with connected(endpoint, timeout_s=0.0) as client:
        began_s = WALL.now_s()
        with pytest.raises(StationAway, match="fibres is away"):
            client.call("stage", "add", {"a": 1.0})
        assert WALL.now_s() - began_s < 0.5, "at once"
        for _ in range(2):
            station = Station("fibres", FailurePolicy())
            station.host("stage", Application())
            with listening(station, Line(endpoint, True, "fibres")):
                assert client.wait_until_here(10.0), client.state
                assert client.call("stage", "add", {"a": 1.0}) == 2.0
            assert wait_until(lambda: not client.state.here)
        assert client.state.why


# --- whoever does not keep to the rules -------------------------------------------------------


def request(token: str, *rest: object, order: str = "call", number: int = 1) -> bytes:
    return encode([order, token, number, 0.0, 1e18, *rest])


def nested(token: str, times: int) -> bytes:
    """Return a call whose argument is a list in a list in a list."""
    empty = request(token, "stage", "echo", {"value": None}, number=45 + times)
    head = empty[6:].replace(b"\xa5value\xc0", b"\xa5value" + b"\x91" * times + b"\xc0")
    return empty[:2] + struct.pack(">I", len(head)) + head


def bad_messages(token: str) -> list[bytes]:
    chance = random.Random(7)
    good = request(token, "stage", "add", {"a": 1.0})
    deep: object = 1.0
    for _ in range(12):
        deep = (deep,)
    return [
        b"",
        b"\xc5",
        good[: len(good) // 2],
        good[:6] + b"\xff" * 40,
        b"\xc5\x02" + good[2:],
        b"\x80\x04K\x01.",  # a pickle
        encode({"a": 1}),
        encode(["call"]),
        encode(["fly", token, 1, 0.0, 1e18, "stage", "add", {}]),
        request(token, "stage", "add", {1: 1.0}),
        request(token, "stage", "add", {"a": "x" * 70_000}),
        request(token, "stage", "add", {"a": deep}),
        request(token, "stage", "echo", {"value": float("nan")}, number=-(2**62)),
        nested(token, 1000),
        nested(token, 40),
        request(token, "", "station/lease", {}, order="publish", number=38),
        request(token, "\0" * 100, "", {}, number=39),
        request("", "stage", "add", {"a": 1.0}, number=40),
        request("ä" * 32, "stage", "add", {"a": 1.0}, number=41),
        request(token[:-1] + "?", "stage", "add", {"a": 1.0}, number=42),
        *(chance.randbytes(size) for size in (1, 10, 100, 60_000)),
        *(good[:6] + chance.randbytes(size) for size in (10, 100, 1000)),
    ]


def test_what_breaks_the_rules_is_refused_and_logged_and_nobody_else_notices(
    served: Served, caplog: pytest.LogCaptureFixture
) -> None:
    with ExitStack() as stack:
        honest = stack.enter_context(connected(served.endpoint, "honest"))
        wire = ZenohWire(Line(served.endpoint, False, "fibres"))
        stack.callback(wire.close)
        door, key = greetings("fibres", "rude/1"), asks("fibres", "rude/1")

        def ask(message: bytes, key: str = key) -> tuple[float, object, CosmicError | None]:
            return read_answer(wire.ask(key, message, timeout_s=2.0))

        assert wait_until(lambda: _answers(wire, door, b"hm"))
        with pytest.raises(StationAway):
            ask(b"hm")
        for message in bad_messages(""):
            assert isinstance(ask(message, door)[2], CosmicError), "it has to greet first"
        _, welcome, _ = ask(request("", "", "", {}, order="hello"), door)
        assert isinstance(welcome, dict)
        assert isinstance(ask(request("", "", "", {}, order="hello"), door)[2], CosmicError)
        assert wait_until(lambda: _answers(wire, key, b"hm"))
        token = welcome["token"]
        for number, message in enumerate(bad_messages(token)):
            error = ask(message)[2]
            assert isinstance(error, CosmicError), f"message {number} was let through"
            assert honest.call("stage", "add", {"a": 1.0}) == 2.0
        assert ask(request(token, "stage", "add", {"a": 1.0}, number=50))[1] == 2.0
        assert ask(request(token, "", "shared/x", {}, order="publish", number=51))[2] is None
        assert ask(request(token, "", "none", {}, order="cancel", number=52))[2] is None
        again = ask(request(token, "stage", "add", {"a": 1.0}, number=50))[2]
        assert "second time" in str(again)
    assert not served.failures
    assert "refused rude" in caplog.text


@pytest.mark.parametrize("client", ["*/*", "honest/*", "**", "a b/1", "a\nb/1", "\u00e9/1"])
def test_a_name_that_could_stand_for_others_is_let_in_nowhere(served: Served, client: str) -> None:
    with ExitStack() as stack:
        honest = stack.enter_context(connected(served.endpoint, "honest"))
        wire = ZenohWire(Line(served.endpoint, False, "fibres"))
        stack.callback(wire.close)
        door = greetings("fibres", client)
        assert wait_until(lambda: _answers(wire, door, b"hm"))
        said = wire.ask(door, request("", "", "", {}, order="hello"), timeout_s=2.0)
        for _ in range(50):
            assert honest.call("stage", "echo", {"value": 1.0}) == 1.0
            honest.take_lease()
            honest.release_lease()
        assert isinstance(read_answer(said)[2], CosmicError)


def _answers(wire: ZenohWire, key: str, message: bytes) -> bool:
    try:
        wire.ask(key, message, timeout_s=2.0)
    except StationAway:
        return False
    return True


def test_a_huge_message_is_dropped_and_nobody_else_notices(served: Served) -> None:
    with ExitStack() as stack:
        honest = stack.enter_context(connected(served.endpoint, "honest"))
        line = Line(served.endpoint, False, "fibres", shared_memory=False)
        wire = ZenohWire(line)
        stack.callback(wire.close)
        key = greetings("fibres", "rude/1")
        assert wait_until(lambda: _answers(wire, key, b"hm"))
        with pytest.raises(CosmicError):
            wire.ask(key, b"\0" * 20_000_000, timeout_s=0.3)
        assert honest.call("stage", "add", {"a": 1.0}) == 2.0


def test_garbage_on_the_bare_line_disturbs_nobody(served: Served) -> None:
    chance = random.Random(7)
    with connected(served.endpoint, "honest") as honest, ExitStack() as stack:
        for size in (0, 1, 2, 100, 70_000):
            rude = stack.enter_context(socket.create_connection(("127.0.0.1", served.port), 2.0))
            with suppress(ConnectionError):  # it may have hung up already
                rude.sendall(chance.randbytes(size))
            assert honest.call("stage", "add", {"a": 1.0}) == 2.0
        assert honest.call("stage", "add", {"a": 1.0}) == 2.0


def test_a_frozen_receiver_delays_no_command_of_others(served: Served) -> None:
    with child("watch", served.endpoint) as process:
        assert first_line(process) == "watching"
        with connected(served.endpoint, "honest") as honest:
            process.send_signal(signal.SIGSTOP)
            longest_s = 0.0
            for _ in range(40):
                served.station.publish("frames", bytes(1_000_000))
                began_s = WALL.now_s()
                assert honest.call("stage", "add", {"a": 1.0}) == 2.0
                longest_s = max(longest_s, WALL.now_s() - began_s)
            assert longest_s < 1.0
            assert wait_until(lambda: len(served.listener.clients) == 1, 8.0), "it is dropped"


def test_a_stop_overtakes_a_flood_of_calls_and_frames_of_its_own_and_of_others(
    served: Served,
) -> None:
    frame = bytes(1_000_000)
    with child("flood", served.endpoint) as process, connected(served.endpoint, "other") as other:
        assert first_line(process) == "flooding"
        longest_s = 0.0
        for number in range(60):  # 60 frames a second for a second
            served.station.publish("frames", frame)
            assert not wait_until(lambda: False, 0.01)
            if number % 3 == 0:
                began_s = WALL.now_s()
                other.call("stage", "stop")
                longest_s = max(longest_s, WALL.now_s() - began_s)
        assert wait_until(lambda: served.application.stops == 40)
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
        own_s = float(first_line(process))
    sys.stdout.write(f"worst stop {1e3 * longest_s:.1f} ms, own {1e3 * own_s:.1f} ms\n")
    assert max(longest_s, own_s) < 0.3, "some milliseconds, on a quiet machine"


# --- nothing is left over ---------------------------------------------------------------------


def memory_kb() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks into /proc")
@pytest.mark.parametrize("count", [30, pytest.param(100, marks=pytest.mark.slow)])
def test_connections_leave_no_thread_no_file_and_no_memory(served: Served, count: int) -> None:
    def connect_and_go() -> None:
        with connected(served.endpoint) as client:
            assert client.call("stage", "add", {"a": 1.0}) == 2.0

    def files() -> int:
        # The engine gathers up its pages of shared memory now and then, not at once.
        return sum(".zenoh" not in each for each in _open_files())

    def threads() -> int:
        return len(list(Path("/proc/self/task").iterdir()))

    def handlers() -> list[str]:
        return [each.name for each in running_threads() if "serves" in each.name]

    for _ in range(5):
        connect_and_go()
    assert wait_until(lambda: not handlers())
    workers_before, threads_before = len(running_threads()), threads()
    files_before, memory_before_kb = files(), memory_kb()
    for _ in range(count):
        connect_and_go()
    assert wait_until(lambda: not handlers())
    # The last may still be ending, and one of the first five may have been.
    assert wait_until(lambda: len(running_threads()) <= workers_before), "threads"
    # The engine keeps some threads of its own for a while.
    assert wait_until(lambda: threads() < threads_before + count // 3, 3.0)
    assert wait_until(lambda: files() <= files_before + 4), "open files"
    grown_kb = memory_kb() - memory_before_kb
    assert grown_kb < 40_000


def _sockets() -> set[str]:
    """Return the inodes of this process's sockets; other tests may have left some."""
    return {each[8:-1] for each in _open_files() if each.startswith("socket:[")}


def _open_files() -> list[str]:
    found = []
    for each in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            found.append(str(each.readlink()))
    return found


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks into /proc")
def test_nothing_listens_beyond_this_computer(served: Served) -> None:
    with connected(served.endpoint):
        own = _sockets() - served.foreign
        listening_at = set()
        for table, state in (("tcp", "0A"), ("tcp6", "0A"), ("udp", "07"), ("udp6", "07")):
            for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
                fields = line.split()
                if fields[9] in own and fields[3] == state:
                    listening_at.add((table, fields[1]))
    assert {(table, where[:9]) for table, where in listening_at} == {("tcp", "0100007F:")}
    assert ("tcp", f"0100007F:{served.port:04X}") in listening_at
    assert len(listening_at) == 2, "the engine, and where direct lines are taken"


# --- certificates -----------------------------------------------------------------------------


def test_with_certificates_only_those_who_prove_their_name_are_let_in(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    ours = make_certificates(tmp_path / "ours", "fibres", "vision", "unlisted")
    rogue = make_certificates(tmp_path / "rogue", "vision")["vision"]
    # It trusts our station, so that the station has to do the refusing.
    rogue = Certificates(ours["vision"].authority, rogue.certificate, rogue.key)
    port = free_port()
    endpoint = f"tls/127.0.0.1:{port}"
    station = Station("fibres", FailurePolicy())
    station.host("stage", Application())
    line = Line(endpoint, True, "fibres", ours["fibres"], ("vision", "other"))
    with ExitStack() as stack:
        stack.enter_context(listening(station, line))
        refused = [
            stack.enter_context(connected(where, name, timeout_s=0.0, certificates=certificates))
            for where, name, certificates in (
                (endpoint, "vision", rogue),
                (endpoint, "unlisted", ours["unlisted"]),
                (endpoint, "vision", ours["unlisted"]),
                (endpoint, "other", ours["vision"]),
                (f"tcp/127.0.0.1:{port}", "vision", None),
            )
        ]
        good = stack.enter_context(connected(endpoint, "vision", certificates=ours["vision"]))
        good.take_lease()
        assert good.call("stage", "move", {"target_um": 1.0}) == 1.0
        assert not wait_until(lambda: any(each.state.here for each in refused), 1.0)
        assert [each.split("/")[0] for each in _clients(station)] == ["vision"]


def test_where_the_date_is_beyond_the_certificates_both_ends_say_so(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    # Valid until now, as where a computer's date is set years ahead.
    ended = make_certificates(tmp_path, "fibres", "vision", valid_days=0)
    time.sleep(1.1)  # one is valid to the end of its last second
    endpoint = f"tls/127.0.0.1:{free_port()}"
    station = Station("fibres", FailurePolicy())
    why = "is valid from .* check the date of this computer, or make new certificates"
    with ExitStack() as stack:
        line = Line(endpoint, True, "fibres", ended["fibres"], ("vision",))
        stack.enter_context(listening(station, line))
        client = connected(endpoint, timeout_s=0.0, certificates=ended["vision"])
        vision = stack.enter_context(client)
        assert wait_until(lambda: "valid from" in vision.state.why, 10.0), vision.state
        with pytest.raises(StationAway, match=why):
            vision.call("stage", "add", {"a": 1.0})
    assert any("nobody is let in" in each.getMessage() for each in caplog.records)


def _clients(station: Station) -> list[str]:
    found: list[str] = []
    station.presence(lambda presence: found.append(presence.name))()
    return found
