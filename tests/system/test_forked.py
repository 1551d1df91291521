"""A process forked from the one that drives the platform harms nothing there, and says why not."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import cosmic
from contract.station_rig import free_port

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")

TRIES = """
def tried(what, call):
    try:
        print(what, "->", call(), flush=True)
    except cosmic.CosmicError as exc:
        print(what, "->", type(exc).__name__, exc, flush=True)
"""

COMMANDS = (
    """
import multiprocessing
import cosmic
"""
    + TRIES
    + """
def ask(mico, targets, times):
    return {str(mico.check(targets).reason) for _ in range(times)}

CLEAR, BLOCKED = {"left.x": -100.0}, {"left.z": -4900.0, "right.z": -4900.0}

with cosmic.connect(applications=("mico",)) as rig:
    mico, axis = rig.mico, rig.mico["left.x"]

    def child():
        tried("mico", lambda: rig.mico)
        tried("stop", rig.stop)
        tried("move", lambda: axis.move_to(5.0))
        tried("check", lambda: ask(mico, BLOCKED, 100))
        tried("close", rig.close)

    moving = axis.move_to(300.0, wait=False)
    forked = multiprocessing.get_context("fork").Process(target=child)
    forked.start()
    asked = set()
    while forked.is_alive():
        asked |= ask(mico, CLEAR, 1)
    forked.join()
    print("parent", asked, ask(mico, BLOCKED, 1), round(moving.wait(60)), forked.exitcode)
"""
)

REMOTE = (
    """
import os
import sys
import cosmic
"""
    + TRIES
    + """
with cosmic.connect(applications=("mico",), stations=["st=" + sys.argv[1]]) as rig:
    rig.take_control()
    mico, axis = rig.mico, rig.mico["left.x"]
    print("parent", round(axis.move_to(20.0)), flush=True)  # or the child has it too
    child = os.fork()
    if child == 0:
        tried("move", lambda: axis.move_to(500.0))
        tried("halt", axis.halt)
        tried("stop", lambda: mico.stop("child"))
        sys.exit(7)
    while not (ended := os.waitpid(child, os.WNOHANG))[0]:
        axis.move_to(22.0)
    print("parent", round(axis.move_to(30.0)), os.waitstatus_to_exitcode(ended[1]))
"""
)

RECORDS = """
import os
import sys
import time
import cosmic

with cosmic.connect(applications=("daqco",)) as rig, rig.daqco.record(sys.argv[1]):
    time.sleep(0.6)
    child = os.fork()
    if child == 0:
        time.sleep(0.8)
        sys.exit(7)
    heads = set()
    while not (ended := os.waitpid(child, os.WNOHANG))[0]:
        time.sleep(0.002)
    until_s = time.monotonic() + 0.6
    while time.monotonic() < until_s:
        with open(sys.argv[1], "rb") as file:
            heads.add(file.read(12)[11])
    print(os.waitstatus_to_exitcode(ended[1]), heads)
"""


def output_of(script: str, *arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", script, *arguments],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def test_a_forked_process_commands_nothing_and_takes_no_answer_of_the_gate() -> None:
    lines = dict(each.split(" -> ") for each in output_of(COMMANDS).splitlines() if "->" in each)
    for refused in ("mico", "stop", "move"):
        assert "forked from the one that drives the platform" in lines[refused]
    assert lines["check"] == "{'NO_ANSWER'}"
    assert lines["close"] == "None"


def test_the_platform_goes_on_beside_a_forked_process() -> None:
    assert "parent {'ALLOWED'} {'COLLISION'} 300 0" in output_of(COMMANDS)


def test_a_process_forked_from_a_client_says_nothing_to_the_station(tmp_path: Path) -> None:
    address = f"tcp/127.0.0.1:{free_port()}"
    command = ["serve", "--applications", "mico", "--name", "st", "--listen", address]
    with subprocess.Popen(
        [sys.executable, "-m", "cosmic", *command], cwd=tmp_path, stdout=subprocess.PIPE, text=True
    ) as station:
        try:
            assert station.stdout is not None
            assert "serves mico" in station.stdout.readline()
            lines = output_of(REMOTE, address).splitlines()
        finally:
            station.send_signal(signal.SIGINT)
            station.wait(60)
    assert [each for each in lines if each.startswith("parent")] == ["parent 20", "parent 30 7"]
    refused = [each for each in lines if "forked from the one that drives" in each]
    assert [each.split()[0] for each in refused] == ["move", "halt", "stop"]


def test_a_forked_process_that_ends_writes_nothing_into_a_recording(tmp_path: Path) -> None:
    file = tmp_path / "run.h5"
    assert output_of(RECORDS, str(file)) == "7 {5}\n"
    recording = cosmic.open_recording(file)
    assert recording.complete
    assert len(recording.values("force")) > 1000
