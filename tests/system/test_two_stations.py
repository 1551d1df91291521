"""The tutorial of two stations, step by step, with a process for each station."""

import os
import re
import shlex
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, chdir
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import pytest

import cosmic
from contract.station_rig import free_port, wait_until
from cosmic.app.cli import main
from cosmic.frame.errors import NotAvailable
from system.docs_blocks import ROOT, blocks

PAGE: Final = ROOT / "docs" / "tutorials" / "two-stations.md"
COMMANDS: Final = [
    shlex.split(line)[1:]
    for block in blocks(PAGE)
    if block.language == "console"
    for line in block.text.splitlines()
]
ENDS_WITHIN_S: Final = 20.0
"""The target is 2 s; a loaded machine takes longer to take a process apart."""
DYING: Final = """
import signal, sys
from cosmic.app.cli import main

def die(*_):
    raise RuntimeError("the main thread dies")

signal.signal(signal.SIGUSR1, die)
sys.exit(main(sys.argv[1:]))
"""


class Started:
    """A ``cosmic serve`` in a process of its own, whose main thread dies of SIGUSR1."""

    def __init__(self, arguments: list[str], folder: Path) -> None:
        self._log = folder / f"{arguments[-1].replace('/', '-')}.log"
        with self._log.open("w") as log:
            self.process = subprocess.Popen(
                [sys.executable, "-c", DYING, *arguments],
                cwd=folder,
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
            )

    def ready(self) -> str:
        """Wait for the line that says that it serves."""
        assert self.process.stdout is not None
        said = self.process.stdout.readline().strip()
        assert said, self.log
        return said

    @property
    def log(self) -> str:
        """What it logged."""
        return self._log.read_text(encoding="utf-8")

    def end(self, number: signal.Signals) -> int:
        """End it by a signal and return its exit code."""
        self.process.send_signal(number)
        return self.process.wait(ENDS_WITHIN_S)


@dataclass
class Stations:
    """The stations of the tutorial: those of its first commands, and the one with certificates."""

    folder: Path
    ports: dict[str, str]
    first: Started
    second: Started
    encrypted: Started

    def moved(self, text: str) -> str:
        """Return text of the page with the ports in use here."""
        return re.sub("7447|7448", lambda found: self.ports[found[0]], text)


@pytest.fixture(scope="module")
def stations(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stations]:
    """Start them all at once, for they take their time to load."""
    folder = tmp_path_factory.mktemp("stations")
    ports = {"7447": str(free_port()), "7448": str(free_port())}
    encrypted_at = f"tls/127.0.0.1:{free_port()}"
    with chdir(folder):
        assert main(_command("certificates")) == 0
        assert main(["init", "lab"]) == 0
    (section,) = (block.text for block in blocks(PAGE) if block.language == "toml")
    with (folder / "lab" / "platform.toml").open("a", encoding="utf-8") as file:
        file.write(f"\n{section}")
    serve = [each for each in COMMANDS if each[0] == "serve"]
    with ExitStack() as at_end:

        def start(arguments: list[str]) -> Started:
            made = Started(arguments, folder)
            at_end.callback(made.process.communicate)
            at_end.callback(made.process.kill)
            return made

        first, second = (
            start([re.sub("7447|7448", lambda found: ports[found[0]], each) for each in arguments])
            for arguments in serve[:2]
        )
        encrypted = start([*serve[2][:-1], encrypted_at])
        yield Stations(folder, ports, first, second, encrypted)


def _command(name: str) -> list[str]:
    return next(each for each in COMMANDS if each[0] == name)


def test_the_tutorial_does_what_it_says(
    stations: Stations, capsys: pytest.CaptureFixture[str]
) -> None:
    (said,) = (block.text for block in blocks(PAGE) if block.language == "")
    assert [stations.first.ready(), stations.second.ready()] == stations.moved(said).splitlines()
    namespace: dict[str, Any] = {"__name__": "page"}
    try:
        for block in blocks(PAGE):
            if block.language == "python":
                code = "\n" * (block.line - 1) + stations.moved(block.text)
                exec(compile(code, str(PAGE), "exec"), namespace)
    finally:
        if "rig" in namespace:
            namespace["rig"].close()
    out = capsys.readouterr().out
    assert "(1200, 1600)" in out
    assert "NO_LEASE" in out
    assert "the operator at fiberstation" in out
    assert f"script-{os.getpid()}" in out
    assert "enough" in out
    log = stations.first.log
    sent = [line for line in log.splitlines() if f"script-{os.getpid()}: mico.axes.begin" in line]
    assert any("left.x" in line for line in sent), "who sent which command"


def test_with_certificates_the_script_works_as_well(stations: Stations) -> None:
    where = stations.encrypted.ready().split()[-1]
    assert where.startswith("tls/127.0.0.1:")
    keys = stations.folder / "keys" / "desk"
    with cosmic.connect(applications=(), stations={"fibervision": where}, certificates=keys) as rig:
        assert rig.vico.snap().shape == (1200, 1600)
        rig.take_control()
        assert rig.stations["fibervision"].holder == "desk", "the name that the certificate proves"
    assert stations.encrypted.end(signal.SIGINT) == 0
    assert "ended by SIGINT" in stations.encrypted.log


def test_a_station_ends_in_order_and_answers_no_more(stations: Stations) -> None:
    at = {
        "fiberstation": stations.moved("tcp/127.0.0.1:7447"),
        "fibervision": stations.moved("tcp/127.0.0.1:7448"),
    }
    with cosmic.connect(applications=(), stations=at) as rig:
        assert stations.second.end(signal.SIGUSR1) == 1
        assert "RuntimeError: the main thread dies" in stations.second.log
        assert wait_until(lambda: rig.stations["fibervision"].away)
        with pytest.raises(NotAvailable, match="fibervision is away"):
            rig.vico.snap()
        assert rig.daqco.latest(), "the other one goes on"

        with pytest.raises(NotAvailable, match="fibervision is away"):
            rig.take_control()
        rig.take_control("fiberstation")
        move = rig.mico["left.x"].move_by(4000.0, wait=False)
        assert stations.first.end(signal.SIGTERM) == 0
        assert isinstance(move.exception(5.0), cosmic.CosmicError)
        assert "ended by SIGTERM" in stations.first.log
        with pytest.raises(NotAvailable, match="fiberstation is away"):
            rig.stop()
