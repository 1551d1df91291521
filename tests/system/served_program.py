"""`cosmic serve` in a process of its own, as tests and benchmarks of the gateways start it."""

import os
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import httpx

ROOT: Final = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class ServedProgram:
    """What is known of it once it listens.

    Attributes
    ----------
    http : httpx.Client
        With the token of its owner.
    """

    http: httpx.Client
    token: str


@contextmanager
def served_program(
    folder: Path, web: int, line: int, *more: str, variables: Mapping[str, str] | None = None
) -> Iterator[ServedProgram]:
    """Serve the simulated platform over HTTP at port `web` and to stations at `line`.

    Its configuration, data and logs are those of `folder`, not of whoever runs it.
    """
    own = {f"XDG_{each}_HOME": str(folder) for each in ("CONFIG", "DATA", "STATE")}
    command = [sys.executable, "-m", "cosmic", "serve", *more]
    command += ["--http", f"127.0.0.1:{web}", "--listen", f"tcp/127.0.0.1:{line}"]
    process = subprocess.Popen(
        command,
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT / "src")} | own | dict(variables or {}),
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    try:
        address, token = _said(process, r"HTTP at (\S+) \(token (\S+)\)")
        if "--epics" in more:
            _said(process, r"EPICS at port")
        headers = {"Authorization": f"Bearer {token}"}
        with httpx.Client(base_url=address, headers=headers, timeout=90.0) as http:
            yield ServedProgram(http, token)
    finally:
        process.terminate()
        process.communicate(timeout=60)


def _said(process: "subprocess.Popen[str]", pattern: str) -> Sequence[str]:
    """Return what is found in the next line that says it."""
    assert process.stdout is not None
    while True:
        line = process.stdout.readline()
        assert line, "the station did not start"
        found = re.search(pattern, line)
        if found:
            return found.groups()
