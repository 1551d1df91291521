"""A cable that is cut without a word, and healed: two network name spaces and a bridge."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from contract.station_rig import Application, free_port, listening, wait_until
from cosmic.frame.clock import WALL
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.certificates import make_certificates
from cosmic.frame.network.line_settings import Line
from cosmic.frame.network.station import Station

CHILD = Path(__file__).with_name("network_child.py")
TESTS = CHILD.parents[1]
# Its own: another run beside this one, or what a killed one left, must be in nobody's way.
SPACE = f"cosmic{os.getpid()}"
BRIDGE, OUTER, INNER = f"{SPACE}b", f"{SPACE}o", f"{SPACE}i"
HERE, THERE = (f"10.231.{os.getpid() % 256}.{last}" for last in (1, 2))


def ip(*words: str) -> bool:
    done = subprocess.run(["ip", *words], capture_output=True, timeout=10, check=False)
    return done.returncode == 0


@pytest.fixture
def line() -> Iterator[None]:
    """Yield while there is a second network name space, joined to this one by a bridge."""
    if sys.platform != "linux" or os.geteuid() != 0 or shutil.which("ip") is None:
        pytest.skip("needs root and `ip` to make a network name space")
    with ExitStack() as stack:
        if not ip("netns", "add", SPACE):
            pytest.skip("network name spaces cannot be made here")
        stack.callback(ip, "netns", "del", SPACE)
        stack.callback(ip, "link", "del", BRIDGE)
        stack.callback(ip, "link", "del", OUTER)  # a dying connection keeps the name space alive
        made = (
            ip("link", "add", "name", BRIDGE, "type", "bridge")
            and ip("link", "add", OUTER, "type", "veth", "peer", "name", INNER)
            and ip("link", "set", INNER, "netns", SPACE)
            and ip("addr", "add", f"{HERE}/24", "dev", BRIDGE)
            and ip("link", "set", BRIDGE, "up")
            and ip("link", "set", OUTER, "master", BRIDGE)
            and ip("link", "set", OUTER, "up")
            and ip("-n", SPACE, "addr", "add", f"{THERE}/24", "dev", INNER)
            and ip("-n", SPACE, "link", "set", INNER, "up")
        )
        if not made:
            pytest.skip("bridges between name spaces cannot be made here")
        yield


def cut() -> None:
    assert ip("link", "set", OUTER, "nomaster")  # the carrier stays up on both sides


def heal() -> None:
    assert ip("link", "set", OUTER, "master", BRIDGE)


@pytest.mark.slow
@pytest.mark.parametrize("cut_s", [10.0, 60.0])
def test_a_cut_stops_the_motion_and_no_old_command_is_carried_out_later(
    line: None, tmp_path: Path, cut_s: float
) -> None:
    files = make_certificates(tmp_path, "fibres", "holder", addresses={"fibres": [HERE]})
    station, application = Station("fibres", FailurePolicy()), Application()
    station.host("stage", application)
    endpoint = f"tls/{HERE}:{free_port()}"
    with ExitStack() as stack:
        own = Line(endpoint, True, "fibres", files["fibres"], ("holder",))
        listener = stack.enter_context(listening(station, own))
        command = ["ip", "netns", "exec", SPACE, sys.executable, str(CHILD), "hold"]
        process = subprocess.Popen(
            [*command, endpoint, str(tmp_path / "holder")],
            stdout=subprocess.DEVNULL,
            env=os.environ
            | {"PYTHONPATH": os.pathsep.join([str(TESTS), str(TESTS.parent / "src")])},
        )
        stack.callback(process.wait, 10)
        stack.callback(process.kill)
        assert wait_until(lambda: len(application.moved) > 20, 20.0)
        dead_man = application.dead_man
        assert dead_man is not None

        cut()
        cut_at_s = WALL.now_s()
        assert wait_until(lambda: dead_man.expired, 3.0)
        assert WALL.now_s() - cut_at_s < 0.3 + 1.0, "the target is 0.3 s + 0.2 s"
        assert wait_until(lambda: station.lease.state.local, 5.0)
        assert WALL.now_s() - cut_at_s < 1.0 + 1.0, "the target is 1 s + 0.2 s"
        assert wait_until(lambda: not listener.clients, 8.0)
        moved = len(application.moved)
        assert not wait_until(lambda: len(application.moved) > moved, cut_s)

        heal()
        healed_s = WALL.now_s()
        assert wait_until(lambda: len(application.moved) > moved + 5, 15.0)
        assert WALL.now_s() - healed_s < 6.0, "the target is 3 s"
    ages_s = [
        received_s - sent_s
        for received_s, sent_s in zip(application.moved_at_s, application.moved, strict=True)
    ]
    assert max(ages_s) <= 1.01, "no command is carried out later than its time to live"
