"""Whoever moves an axis from another process dies or freezes, and the axis stops."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from contract.mico_rig import HostedMico, hosted_mico, reachable, wait_for
from cosmic.frame.clock import WALL
from cosmic.mico.hw.interface import Channel

CHILD = Path(__file__).with_name("mico_child.py")
TESTS = CHILD.parents[1]


@pytest.fixture(scope="module")
def station() -> Iterator[HostedMico]:
    with hosted_mico() as made:
        yield made


@pytest.fixture
def hosted(station: HostedMico) -> Iterator[HostedMico]:
    station.begin_anew()
    with reachable(station) as listening:
        yield listening


@contextmanager
def mover(what: str, hosted: HostedMico) -> Iterator[subprocess.Popen[str]]:
    """Start a program that moves left.x, and wait until it does."""
    process = subprocess.Popen(
        [sys.executable, str(CHILD), what, hosted.endpoint],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS.parent / "src")])},
    )
    try:
        assert line_of(process) == "moving"
        wait_for(lambda: moves(hosted))
        yield process
    finally:
        process.kill()
        process.communicate(timeout=10)


def line_of(process: subprocess.Popen[str]) -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def moves(hosted: HostedMico) -> bool:
    return hosted.mico["left.x"].details.in_motion


def stops_within_s(hosted: HostedMico, monkeypatch: pytest.MonkeyPatch, limit_s: float) -> float:
    """Return after what time the first stop went to the controller; it must stand soon after."""
    stopped_s: list[float] = []
    controller = hosted.application.manager.controller
    stop = controller.stop

    def noted(channel: Channel) -> None:
        stopped_s.append(WALL.now_s())
        stop(channel)

    monkeypatch.setattr(controller, "stop", noted)
    began_s = WALL.now_s()
    wait_for(lambda: stopped_s, limit_s)
    wait_for(lambda: not moves(hosted))
    return stopped_s[0] - began_s


@pytest.mark.parametrize("what", ["jog", "travel", "trajectory"])
def test_an_axis_stops_when_the_program_that_moves_it_is_killed(
    hosted: HostedMico, what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with mover(what, hosted) as process:
        process.kill()
        # Sooner than by silence alone; the aim on a quiet machine is 0.1 s.
        took_s = stops_within_s(hosted, monkeypatch, limit_s=0.9)
    sys.stdout.write(f"{what}: stopped {1e3 * took_s:.0f} ms after the kill\n")
    wait_for(lambda: hosted.station.lease.state.local)
    hosted.mico["left.x"].move_by(1.0)


def test_an_axis_stops_when_the_program_freezes_and_does_not_move_when_it_wakes(
    hosted: HostedMico, monkeypatch: pytest.MonkeyPatch
) -> None:
    with mover("travel", hosted) as process:
        process.send_signal(signal.SIGSTOP)
        took_s = stops_within_s(hosted, monkeypatch, limit_s=3.0)
        sys.stdout.write(f"stopped {1e3 * took_s:.0f} ms after it froze\n")
        before = hosted.mico["left.x"].position_um
        process.send_signal(signal.SIGCONT)
        assert line_of(process).startswith("ended")
        assert hosted.mico["left.x"].position_um == pytest.approx(before, abs=2.0)
        assert not moves(hosted)
