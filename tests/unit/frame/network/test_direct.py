"""Direct lines: what goes over them, who is kept out, and what happens when they break."""

import errno
import secrets
import socket
import ssl
import struct
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest

from contract.station_rig import Application, connected, free_port, listening, wait_until
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network import server_listener
from cosmic.frame.network.addresses import asks, client_liveliness, greetings
from cosmic.frame.network.certificates import make_certificates
from cosmic.frame.network.client_side_connection import ClientSideConnection
from cosmic.frame.network.codec import encode
from cosmic.frame.network.direct_line import FramedSocket, LineLost, client_context
from cosmic.frame.network.direct_listener import PENDING_LIMIT, DirectListener
from cosmic.frame.network.errors import StationAway, StationTimeout
from cosmic.frame.network.line_settings import Certificates, Line
from cosmic.frame.network.messages import read_answer
from cosmic.frame.network.remote import remote
from cosmic.frame.network.server_listener import ServerListener
from cosmic.frame.network.station import Station
from cosmic.frame.network.zenoh_wire import ZenohWire


class Stage(Application):
    """Tells as well in which thread it is called."""

    @remote
    def thread(self) -> str:
        return threading.current_thread().name

    @remote(at_once=True)
    def urgent_thread(self) -> str:
        return threading.current_thread().name

    @remote(at_once=True)
    def hang(self) -> None:
        self.entered.set()
        self.go_on.wait(5.0)


class Served:
    def __init__(self, line: Line, listener: ServerListener, stage: Stage, station: Station):
        self.line = line
        self.listener = listener
        self.stage = stage
        self.station = station
        self.files: dict[str, Certificates] = {}

    @property
    def endpoint(self) -> str:
        return self.line.endpoint


@pytest.fixture
def served() -> Iterator[Served]:
    station, stage = Station("fibres", FailurePolicy()), Stage()
    station.host("stage", stage)
    line = Line(f"tcp/127.0.0.1:{free_port()}", True, "fibres")
    with listening(station, line) as listener:
        yield Served(line, listener, stage, station)
        stage.go_on.set()


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Certificates]:
    folder: Path = tmp_path_factory.mktemp("certificates")
    return make_certificates(folder / "ours", "fibres", "vision", "other")


class Session:
    """A client that was let in, by hand."""

    def __init__(self, wire: ZenohWire, name: str = "rude") -> None:
        self.key = f"{name}/{secrets.token_hex(4)}"
        door = greetings("fibres", self.key)
        hello = encode(["hello", "", 1, 0.0, 1e18, "", "", {}])
        assert wait_until(lambda: answers(wire, door, hello, self))
        self.port: int = self.welcome["direct"]
        self.token: str = self.welcome["token"]

    welcome: dict[str, Any]
    number = 1

    def request(self, order: str, function: str = "", **arguments: object) -> bytes:
        self.number += 1
        return encode([order, self.token, self.number, 0.0, 1e18, "stage", function, arguments])


def answers(wire: ZenohWire, key: str, message: bytes, session: Session) -> bool:
    try:
        _, said, error = read_answer(wire.ask(key, message, timeout_s=2.0))
    except StationAway:
        return False
    assert error is None, error
    assert isinstance(said, dict)
    session.welcome = said
    return True


@pytest.fixture
def wire(served: Served) -> Iterator[ZenohWire]:
    made = ZenohWire(Line(served.endpoint, False, "fibres"))
    yield made
    made.close()


Attached = tuple[FramedSocket, CosmicError | None]
Attach = Callable[..., Attached]


@pytest.fixture
def attached() -> Iterator[Attach]:
    """Open a direct line by hand, and return why it was refused as well."""
    with ExitStack() as stack:

        def attach(port: int, *said: object) -> Attached:
            stream = stack.enter_context(socket.create_connection(("127.0.0.1", port), 2.0))
            framed = FramedSocket(stream, 10_000)
            framed.send(encode(list(said)))
            return framed, read_answer(framed.receive(2.0))[2]

        yield attach


# --- what goes over them


def test_calls_are_carried_out_by_the_thread_that_reads_them(served: Served) -> None:
    with connected(served.endpoint) as client:
        assert client.call("stage", "thread") == "fibres answers vision"
        assert client.call("stage", "urgent_thread") == "fibres answers vision"
        assert client.call("stage", "count") == 0


def test_more_calls_at_a_time_than_lines_are_all_answered(served: Served) -> None:
    with connected(served.endpoint) as client, ThreadPoolExecutor(12) as pool:
        sums = pool.map(lambda a: client.call("stage", "add", {"a": float(a)}), range(200))
        assert list(sums) == [a + 1.0 for a in range(200)]


def test_a_stop_waits_for_no_call_however_many_there_are(served: Served) -> None:
    with connected(served.endpoint) as client, ThreadPoolExecutor(8) as pool:
        waiting = [pool.submit(client.call, "stage", "wait_here", timeout_s=5.0) for _ in range(8)]
        assert served.stage.entered.wait(5.0)
        began_s = WALL.now_s()
        client.call("stage", "stop")
        took_s = WALL.now_s() - began_s
        assert not any(each.done() for each in waiting)
        served.stage.go_on.set()
        assert [each.result() for each in waiting] == ["done"] * 8
    assert took_s < 0.5
    assert served.stage.most_together == 1, "one after the other all the same"


def test_a_stop_passes_where_something_urgent_hangs(served: Served) -> None:
    with connected(served.endpoint) as client, ThreadPoolExecutor(1) as pool:
        hanging = pool.submit(client.call, "stage", "hang", timeout_s=5.0)
        assert served.stage.entered.wait(5.0)
        client.call("stage", "stop")
        assert served.stage.stops == 1
        served.stage.go_on.set()
        hanging.result(5.0)


def test_a_late_answer_is_not_taken_for_that_of_the_next_call(served: Served) -> None:
    with connected(served.endpoint) as client:
        with pytest.raises(StationTimeout, match=r"stage\.wait_here"):
            client.call("stage", "wait_here", timeout_s=0.05)
        served.stage.go_on.set()
        for number in range(5):
            assert client.call("stage", "add", {"a": float(number)}) == number + 1.0
        assert client.state.here


def test_without_direct_lines_calls_go_over_the_engine(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(*_: object) -> DirectListener:
        raise OSError("a wall")

    monkeypatch.setattr(server_listener, "DirectListener", fail)
    station = Station("fibres", FailurePolicy())
    station.host("stage", Stage())
    line = Line(f"tcp/127.0.0.1:{free_port()}", True, "fibres")
    with listening(station, line), connected(line.endpoint) as client:
        assert client.call("stage", "thread") == "fibres calls stage"
    assert "calls use the slower connection: a wall" in caplog.text


# --- when they break


def test_what_a_client_moves_stops_when_its_direct_line_ends(
    served: Served, wire: ZenohWire, attached: Attach
) -> None:
    rude = Session(wire)
    framed, error = attached(rude.port, rude.key, rude.token, True)
    assert error is None
    wire_key = asks("fibres", rude.key)
    taken = rude.request("take lease")
    assert wait_until(lambda: _asked(wire, wire_key, taken))
    assert served.station.lease.state.holder == "rude"
    dead_man = served.station.lease.dead_man(rude.token)
    framed.shut()
    assert wait_until(lambda: dead_man.expired, 0.5), "long before a second of silence"
    assert served.station.lease.state.local
    assert served.listener.clients == [rude.key], "a stop over the engine still gets through"


def _asked(wire: ZenohWire, key: str, message: bytes) -> bool:
    with suppress(StationAway):
        wire.ask(key, message, timeout_s=2.0)
        return True
    return False


def test_a_line_lost_in_a_call_says_that_nobody_knows_and_a_stop_goes_the_other_way(
    served: Served, monkeypatch: pytest.MonkeyPatch
) -> None:
    with connected(served.endpoint) as client:
        send = FramedSocket.send

        def cut(framed: FramedSocket, message: bytes, timeout_s: float | None = None) -> None:
            if threading.current_thread() is threading.main_thread():
                raise LineLost("cut")
            send(framed, message, timeout_s)

        monkeypatch.setattr(FramedSocket, "send", cut)
        client.call("stage", "stop")
        assert served.stage.stops == 1
        with pytest.raises(StationAway, match="whether the call was carried out is not known"):
            client.call("stage", "add", {"a": 1.0})
        monkeypatch.setattr(FramedSocket, "send", send)
        assert wait_until(lambda: client.state.here)
        assert client.call("stage", "add", {"a": 1.0}) == 2.0


def test_a_call_in_progress_does_not_hold_up_the_end_of_its_session(
    served: Served, wire: ZenohWire, attached: Attach
) -> None:
    rude = Session(wire)
    liveliness = wire.liveliness(client_liveliness("fibres", rude.key))
    calls, _ = attached(rude.port, rude.key, rude.token, False)
    calls.send(rude.request("call", "wait_here"))
    assert served.stage.entered.wait(5.0)
    assert wait_until(lambda: served.listener.clients == [rude.key])
    liveliness.close()
    assert wait_until(lambda: served.listener.clients == [], 1.0), "the listener goes on"
    with connected(served.endpoint) as client:
        client.call("stage", "stop")
    served.stage.go_on.set()


# --- who is kept out


def test_who_was_not_let_in_gets_no_direct_line(
    served: Served, wire: ZenohWire, attached: Attach
) -> None:
    rude, other = Session(wire), Session(wire, "other")
    for said in (
        ("nobody/1", rude.token, False),
        (rude.key, "", False),
        (rude.key, "ä" * 32, True),
        (rude.key, other.token, True),
        (other.key, rude.token, False),
        (rude.key, rude.token, 1),
        (rude.key, rude.token),
        (rude.key, rude.token, False, "more"),
    ):
        assert isinstance(attached(rude.port, *said)[1], CosmicError), said
    assert len(served.listener.clients) == 2, "whoever bears its name is not touched"


def test_a_session_has_no_more_lines_than_it_needs(
    served: Served, wire: ZenohWire, attached: Attach
) -> None:
    rude = Session(wire)
    made = [attached(rude.port, rude.key, rude.token, False) for _ in range(9)]
    assert [error is None for _, error in made] == [True] * 8 + [False]


def test_messages_of_another_session_and_replayed_ones_are_refused(
    served: Served, wire: ZenohWire, attached: Attach
) -> None:
    rude, other = Session(wire), Session(wire, "other")
    framed, _ = attached(rude.port, rude.key, rude.token, False)

    def asked(message: bytes) -> tuple[object, CosmicError | None]:
        framed.send(message)
        return read_answer(framed.receive(2.0))[1:]

    good = rude.request("call", "add", a=1.0)
    assert asked(good) == (2.0, None)
    assert "second time" in str(asked(good)[1])
    assert "session is unknown" in str(asked(other.request("call", "add", a=1.0))[1])
    late = encode(["call", rude.token, 50, 0.0, -1.0, "stage", "add", {"a": 1.0}])
    assert "too late" in str(asked(late)[1])
    assert "NO_LEASE" in repr(asked(rude.request("call", "move", target_um=1.0))[1].verdict)  # type: ignore[union-attr]
    assert isinstance(asked(b"garbage")[1], CosmicError)
    framed.send(b"x" * 70_000)
    with pytest.raises(LineLost):
        framed.receive(2.0)


def test_strangers_that_are_silent_slow_half_or_huge_disturb_nobody(
    served: Served, wire: ZenohWire
) -> None:
    port = Session(wire).port
    with ExitStack() as stack:
        for start in (b"", b"\0", struct.pack(">I", 1000) + b"half", struct.pack(">I", 2**31)):
            for _ in range(PENDING_LIMIT // 2):
                rude = stack.enter_context(socket.create_connection(("127.0.0.1", port), 2.0))
                with suppress(OSError):
                    rude.sendall(start)
        client = stack.enter_context(connected(served.endpoint, "honest"))
        began_s = WALL.now_s()
        assert client.call("stage", "thread") == "fibres answers honest"
        client.call("stage", "stop")
        assert WALL.now_s() - began_s < 0.5


def test_a_flood_of_connections_leaves_those_who_are_here_and_lets_others_in(
    served: Served, wire: ZenohWire
) -> None:
    port = Session(wire).port
    with connected(served.endpoint) as client, ExitStack() as stack:
        for _ in range(300):
            rude = socket.create_connection(("127.0.0.1", port), 2.0)
            with suppress(OSError):
                rude.sendall(b"GET / HTTP/1.1\r\n\r\n")
            rude.close()
        assert client.call("stage", "thread") == "fibres answers vision"
        late = stack.enter_context(connected(served.endpoint, "late"))
        assert late.call("stage", "add", {"a": 1.0}) == 2.0, "over the engine, if need be"


def secure_line(port: int, files: Certificates) -> ssl.SSLSocket:
    with ExitStack() as stack:
        bare = stack.enter_context(socket.create_connection(("127.0.0.1", port), 2.0))
        made = client_context(files).wrap_socket(bare, server_hostname="127.0.0.1")
        stack.pop_all()
        return made


def test_with_certificates_a_direct_line_needs_the_one_of_its_session(
    files: dict[str, Certificates], tmp_path: Path
) -> None:
    station = Station("fibres", FailurePolicy())
    station.host("stage", Stage())
    endpoint = f"tls/127.0.0.1:{free_port()}"
    line = Line(endpoint, True, "fibres", files["fibres"], ("vision", "other"))
    rogue = make_certificates(tmp_path / "rogue", "vision")["vision"]
    rogue = Certificates(files["vision"].authority, rogue.certificate, rogue.key)
    with ExitStack() as stack:
        stack.enter_context(listening(station, line))
        good = stack.enter_context(connected(endpoint, certificates=files["vision"]))
        assert good.call("stage", "thread") == "fibres answers vision"
        wire = ZenohWire(Line(endpoint, False, "fibres", files["vision"]))
        stack.callback(wire.close)
        session = Session(wire, "vision")
        hello = encode([session.key, session.token, False])

        def greeted(files: Certificates) -> CosmicError | None:
            with secure_line(session.port, files) as stream:
                framed = FramedSocket(stream, 10_000)
                framed.send(hello)
                return read_answer(framed.receive(2.0))[2]

        assert greeted(files["vision"]) is None
        assert "session is unknown" in str(greeted(files["other"]))
        with pytest.raises(LineLost):
            greeted(rogue)
        bare = socket.create_connection(("127.0.0.1", session.port), 2.0)
        plain = FramedSocket(stack.enter_context(bare), 10_000)
        with pytest.raises(LineLost):
            plain.send(hello)
            plain.receive(2.0)
            raise LineLost("an alert of TLS is no message")
        assert good.call("stage", "thread") == "fibres answers vision"


def test_a_client_gives_its_secrets_to_no_other_station(
    files: dict[str, Certificates], tmp_path: Path
) -> None:
    theirs = make_certificates(tmp_path / "theirs", "fibres")["fibres"]
    line = Line(f"tls/127.0.0.1:{free_port()}", True, "fibres", theirs, ("vision",))
    heard: list[object] = []
    listener = DirectListener("theirs", line, FailurePolicy(), lambda *said: heard.append(said))
    listener.start()
    try:
        with pytest.raises(ssl.SSLCertVerificationError):
            secure_line(listener.port, files["vision"])
    finally:
        listener.request_end()
        listener.join()
    assert not heard


def test_a_program_without_free_files_does_not_spin_while_somebody_waits(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried: list[float] = []

    def full(_server: socket.socket) -> None:
        tried.append(WALL.now_s())
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(socket.socket, "accept", full)
    line = Line(f"tcp/127.0.0.1:{free_port()}", True, "fibres")
    listener = DirectListener("full", line, FailurePolicy(), lambda *_said: None)
    listener.start()
    try:
        with socket.create_connection(("127.0.0.1", listener.port), 2.0):
            assert wait_until(lambda: len(tried) > 1), "it is tried again"
            WALL.sleep(0.5)
    finally:
        listener.request_end()
        listener.join()
    assert len(tried) < 100


def test_a_client_comes_back_when_its_station_was_restarted(served: Served) -> None:
    line = Line(f"tcp/127.0.0.1:{free_port()}", True, "fibres")
    client = ClientSideConnection(
        "fibres",
        "vision",
        lambda: ZenohWire(Line(line.endpoint, False, "fibres")),
        FailurePolicy(),
    )
    try:
        client.start()
        for _ in range(2):
            station = Station("fibres", FailurePolicy())
            station.host("stage", Stage())
            with listening(station, line):
                assert client.wait_until_here(10.0)
                assert client.call("stage", "thread") == "fibres answers vision"
            assert wait_until(lambda: not client.state.here)
    finally:
        client.close()
