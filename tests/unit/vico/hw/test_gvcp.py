"""Whether a camera on the network is there: a dialogue of datagrams."""

import socket
import struct
from collections.abc import Callable, Iterator

import pytest

from cosmic.vico.hw.gvcp import GvcpWatch

CONTROL = 0x2


class Peer:
    """What answers at the camera's address."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(5.0)
        self.port: int = self.socket.getsockname()[1]

    def request(self) -> tuple[bytes, tuple[str, int]]:
        message, whom = self.socket.recvfrom(100)
        return message, whom

    def answer(self, privilege: int = CONTROL, *, status: int = 0, shift: int = 0) -> None:
        message, whom = self.request()
        number = struct.unpack(">H", message[6:8])[0] + shift
        self.socket.sendto(struct.pack(">HHHHI", status, 0x81, 4, number, privilege), whom)


@pytest.fixture
def peer() -> Iterator[Peer]:
    made = Peer()
    yield made
    made.socket.close()


@pytest.fixture
def watch(peer: Peer) -> Iterator[GvcpWatch]:
    made = GvcpWatch("127.0.0.1", 0.0, port=peer.port)
    yield made
    made.close()


def polled(watch: GvcpWatch, now_s: float, until: Callable[[str], bool] = bool) -> str:
    """Poll at one moment until an answer on the loopback address has arrived."""
    for _ in range(100_000):
        reason = watch.poll(now_s)
        if until(reason) or watch.controlled is not None:
            return reason
    return ""


def test_a_camera_that_was_heard_is_not_asked(peer: Peer, watch: GvcpWatch) -> None:
    watch.alive(10.0)
    assert watch.poll(10.3) == ""
    peer.socket.setblocking(False)
    with pytest.raises(BlockingIOError):
        peer.request()


def test_the_question_is_a_read_of_the_control_channel_privilege(
    peer: Peer, watch: GvcpWatch
) -> None:
    watch.poll(1.0)
    message, _ = peer.request()
    assert message[:2] == b"\x42\x01"  # key; an answer is asked for
    assert message[2:6] == b"\x00\x80\x00\x04"  # read register, four bytes follow
    assert message[8:] == b"\x00\x00\x0a\x00"


def test_a_camera_that_answers_is_there(peer: Peer, watch: GvcpWatch) -> None:
    watch.poll(1.0)
    peer.answer()
    assert polled(watch, 1.1) == ""
    assert watch.controlled is True
    assert watch.poll(1.45) == ""


def test_a_camera_that_nobody_controls_was_started_anew(peer: Peer, watch: GvcpWatch) -> None:
    watch.poll(1.0)
    peer.answer(0)
    assert "restarted" in polled(watch, 1.1)
    assert watch.controlled is False


def test_a_refusal_is_a_sign_of_life(peer: Peer, watch: GvcpWatch) -> None:
    watch.poll(1.0)
    peer.answer(0, status=0x8006)  # access denied
    assert polled(watch, 1.1) == ""
    assert watch.controlled is True


def test_a_camera_that_stays_silent_is_gone_after_three_questions(
    peer: Peer, watch: GvcpWatch
) -> None:
    said = {now: watch.poll(now) for now in (0.3, 0.4, 0.6, 0.66, 0.92, 1.18)}
    assert [bool(reason) for reason in said.values()] == [False] * 5 + [True]
    assert "127.0.0.1" in said[1.18]
    assert len({peer.request()[0][6:8] for _ in range(3)}) == 3


def test_garbage_and_answers_to_others_are_not_its_answer(peer: Peer, watch: GvcpWatch) -> None:
    watch.poll(1.0)
    _, whom = peer.request()
    peer.socket.sendto(b"", whom)
    peer.socket.sendto(b"\x00" * 5, whom)
    peer.socket.sendto(struct.pack(">HHHHI", 0, 0x81, 4, 999, CONTROL), whom)
    peer.socket.sendto(struct.pack(">HHHHI", 0, 0x83, 4, 1, CONTROL), whom)
    for _ in range(100):
        assert watch.poll(1.1) == ""
    assert watch.controlled is None


def test_frames_that_come_again_end_the_questions(peer: Peer, watch: GvcpWatch) -> None:
    watch.poll(1.0)
    watch.alive(1.2)
    assert [watch.poll(now) for now in (1.3, 1.5)] == ["", ""]
