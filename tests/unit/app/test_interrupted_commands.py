"""Ctrl+C and SIGTERM end every command in order: one line, and the exit code of the signal."""

import argparse
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import pytest

from cosmic.app.cli import main
from cosmic.app.commands import check, chosen_rig
from cosmic.app.commands.chosen_rig import carry_out
from cosmic.autonomy.procedures.run import RunState
from cosmic.frame.interruption import Interrupted, interruptible
from unit.autonomy.procedures.parts import MOVE, Op, Work, run_of

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")

SESSION = """
import sys, time
sys.stdin.readline()
sys.stderr.write("the session is asked\\n")
sys.stderr.flush()
sys.stdin.readline()
"""


@pytest.mark.parametrize(("one", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_signal_is_one_line_and_an_exit_code(
    one: signal.Signals,
    code: int,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(check, "find_mistakes", lambda _: signal.raise_signal(one))
    assert main(["check", "platform.toml"]) == code
    assert capsys.readouterr().err == f"cosmic: interrupted by {one.name}\n"


def test_a_procedure_is_aborted_in_order_before_the_signal_is_heard() -> None:
    work = Work()
    work.at_point = lambda n: os.kill(os.getpid(), signal.SIGTERM) if n == 2 else None
    run = run_of(Op("push", steps=(MOVE,) * 5000), work)
    with pytest.raises(Interrupted, match="SIGTERM"), interruptible():
        carry_out(run)
    assert run.state is RunState.ABORTED
    assert "ended by SIGTERM" in str(run.failure)
    assert not work.moving


def test_a_platform_is_started_and_closed_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []

    @contextmanager
    def connect(*_: object, **__: object) -> Iterator[None]:
        signal.raise_signal(signal.SIGTERM)
        done.append("started")
        yield
        signal.raise_signal(signal.SIGTERM)
        done.append("closed")

    monkeypatch.setattr(chosen_rig, "connect", connect)
    options = ("config", "rate", "sample", "truth", "world", "connect", "certificates")
    chosen = argparse.Namespace(cold=False, **dict.fromkeys(options))
    with pytest.raises(Interrupted), interruptible(), chosen_rig.chosen_rig(chosen):
        done.append("used")
    assert done == ["started", "closed"]


# The whole program


@contextmanager
def started(folder: Path, *arguments: str) -> "Iterator[subprocess.Popen[str]]":
    own = {f"XDG_{each}_HOME": str(folder) for each in ("CONFIG", "DATA", "STATE")}
    process = subprocess.Popen(
        [sys.executable, "-m", "cosmic", *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | own,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def read_until(stream: IO[str] | None, wanted: str) -> None:
    assert stream is not None
    text = ""
    while wanted not in text:
        one = stream.read(1)
        assert one, text
        text += one


def end_of(process: "subprocess.Popen[str]") -> list[str]:
    """Return the last lines on standard error."""
    _, said = process.communicate(timeout=60)
    assert "Traceback" not in said
    return said.splitlines()


def test_a_calibration_that_is_ended_stops_what_moves(tmp_path: Path) -> None:
    with started(tmp_path, "calibrate") as process:
        read_until(process.stderr, ": done\n")
        process.terminate()
        said = end_of(process)
    assert process.returncode == 143
    assert said[-1] == "cosmic: interrupted by SIGTERM"
    assert any("calibrate aborted: calibrate: ended by SIGTERM" in line for line in said)


def test_whoever_is_asked_for_weights_may_press_ctrl_c(tmp_path: Path) -> None:
    with started(tmp_path, "calibrate-force", "--weights", "1,2") as process:
        read_until(process.stdout, "Then press Enter")
        os.killpg(process.pid, signal.SIGINT)
        said = end_of(process)
    assert process.returncode == 130
    assert said[-1] == "cosmic: interrupted by SIGINT"


def test_ctrl_c_on_a_blind_trial_reaches_its_session_through_the_trial_alone(
    tmp_path: Path,
) -> None:
    program = tmp_path / "session.py"
    program.write_text(SESSION, encoding="utf-8")
    with started(tmp_path, "blind-trial", "--sealed-by", str(program)) as process:
        read_until(process.stderr, "the session is asked\n")
        os.killpg(process.pid, signal.SIGINT)
        said = end_of(process)
    assert process.returncode == 130
    assert said == ["cosmic: interrupted by SIGINT"]
