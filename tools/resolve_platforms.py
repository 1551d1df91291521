"""Resolve what pyproject.toml asks for, from wheels alone, for every platform and Python.

    python tools/resolve_platforms.py                       # the core and every extra, everywhere
    python tools/resolve_platforms.py --core windows:3.14 aarch64-manylinux_2_39:3.11
    python tools/resolve_platforms.py --table               # for docs/reference/platforms.md
    python tools/resolve_platforms.py --released            # when each package was released

Needs uv and the network. Ends with 0 where everything that is promised resolves or where there is
nothing to resolve with (it says "skipped"), with 1 where not.
"""

import argparse
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
# uv's "linux" and "aarch64-unknown-linux-gnu" have glibc 2.28; PySide6 asks for more.
PLATFORMS = {
    "windows": "Windows x86-64",
    "aarch64-apple-darwin": "macOS arm64",
    "x86_64-manylinux_2_34": "Linux x86-64, glibc 2.34",
    "aarch64-manylinux_2_39": "Linux aarch64, glibc 2.39",
}
PYTHONS = ("3.11", "3.12", "3.13", "3.14")
CORE = "core"
NOT_FOR_USERS = ("dev", "docs")
AT_ONCE = 4
LONGEST_PROBLEM = 300
UNREACHABLE = ("Failed to fetch", "error sending request", "dns error", "No route", "timed out")


@dataclass(frozen=True)
class Task:
    """One part of the requirements on one platform and one Python."""

    part: str
    platform: str
    python: str


@dataclass(frozen=True)
class Answer:
    """What the resolver said: `problem` is empty where it resolves."""

    task: Task
    problem: str


class NoNetworkError(Exception):
    """The resolver cannot reach what it resolves from."""


def requirements() -> dict[str, list[str]]:
    """Return the requirements of the core, and of the core with each extra."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    core = project["dependencies"]
    extras = project["optional-dependencies"]
    return {CORE: core} | {
        name: [*core, *lines] for name, lines in extras.items() if name not in NOT_FOR_USERS
    }


def find_uv() -> str | None:
    """Return the resolver beside this Python or on the path."""
    beside = Path(sys.executable).with_name("uv")
    return str(beside) if beside.exists() else shutil.which("uv")


def resolve(uv: str, task: Task, lines: list[str], within_s: float) -> Answer:
    """Ask the resolver about one task."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "requirements.in"
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")
        command = [uv, "pip", "compile", "--quiet", "--no-header", "--only-binary", ":all:"]
        command += ["--python-platform", task.platform, "--python-version", task.python, str(file)]
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=within_s, check=False, cwd=folder
        )
    if done.returncode == 0:
        return Answer(task, "")
    if any(word in done.stderr for word in UNREACHABLE):
        raise NoNetworkError(done.stderr.strip())
    return Answer(task, " ".join(done.stderr.split())[:LONGEST_PROBLEM])


def resolve_place(
    uv: str, parts: dict[str, list[str]], place: tuple[str, str], within_s: float
) -> list[Answer]:
    """Ask about all parts for one platform and Python: about all at once, and one by one after."""
    everything = sorted({line for lines in parts.values() for line in lines})
    answer = resolve(uv, Task(CORE, *place), everything, within_s)
    if not answer.problem:
        return [Answer(Task(part, *place), "") for part in parts]
    return [resolve(uv, Task(part, *place), lines, within_s) for part, lines in parts.items()]


def table(answers: list[Answer]) -> str:
    """Return the answers as a table: a line for each part, a column for each platform."""
    lines = [
        "| part | " + " | ".join(PLATFORMS.values()) + " |",
        "|---" * (len(PLATFORMS) + 1) + "|",
    ]
    for part in dict.fromkeys(answer.task.part for answer in answers):
        cells = []
        for platform in PLATFORMS:
            good = [
                answer.task.python
                for answer in answers
                if (answer.task.part, answer.task.platform) == (part, platform)
                and not answer.problem
            ]
            cells.append(", ".join(good) or "none")
        lines.append(f"| {part} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def released(uv: str, within_s: float) -> list[str]:
    """Return name, version and date of each package that is asked for, as the resolver locks it.

    The versions are those of constraints.txt, as far as they are there for every Python.
    """
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    lines = {line for part in requirements().values() for line in part}
    pinned = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pinned = [line for line in pinned if re.match(r"[\w.-]+==", line)]
    with tempfile.TemporaryDirectory() as folder:
        asked = Path(folder) / "pyproject.toml"
        asked.write_text(
            f'[project]\nname = "asked"\nversion = "0"\n'
            f'requires-python = "{project["requires-python"]}"\n'
            f"dependencies = {sorted(lines)}\n[tool.uv]\nconstraint-dependencies = {pinned}\n",
            encoding="utf-8",
        )
        done = subprocess.run(
            [uv, "lock", "--quiet"],
            capture_output=True,
            text=True,
            timeout=within_s,
            check=False,
            cwd=folder,
        )
        if done.returncode != 0:
            raise NoNetworkError(done.stderr.strip())
        locked = tomllib.loads((Path(folder) / "uv.lock").read_text(encoding="utf-8"))
    names = {re.split(r"[^\w.-]", line)[0].lower().replace("_", "-") for line in lines}
    told = []
    for each in locked["package"]:
        if each["name"] not in names:
            continue
        files = [*each.get("wheels", []), *filter(None, [each.get("sdist")])]
        dates = sorted(str(file["upload-time"])[:10] for file in files if "upload-time" in file)
        told.append(f"{each['name']} {each['version']} {dates[0] if dates else 'unknown'}")
    return told


def say(text: str) -> None:
    """Tell it on standard output."""
    sys.stdout.write(text + "\n")


def main() -> int:
    """Resolve, tell, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--core", action="store_true", help="without the extras")
    parser.add_argument("--table", action="store_true", help="print a table for the docs")
    parser.add_argument("--released", action="store_true", help="say when each was released")
    parser.add_argument("--within", type=float, default=120.0, metavar="SECONDS", help="of each")
    parser.add_argument("places", nargs="*", metavar="PLATFORM:PYTHON")
    chosen = parser.parse_args()
    uv = find_uv()
    if uv is None:
        say("resolving for other platforms: skipped, there is no uv")
        return 0
    if chosen.released:
        say("\n".join(released(uv, chosen.within)))
        return 0
    parts = requirements()
    if chosen.core:
        parts = {CORE: parts[CORE]}
    places = [tuple(place.split(":", 1)) for place in chosen.places]
    places = places or list(product(PLATFORMS, PYTHONS))
    pool = ThreadPoolExecutor(AT_ONCE)
    try:
        waiting = [pool.submit(resolve_place, uv, parts, place, chosen.within) for place in places]
        answers = [answer for each in waiting for answer in each.result()]
    except (NoNetworkError, subprocess.TimeoutExpired) as exc:
        say(f"resolving for other platforms: skipped, no answer ({str(exc)[-200:]})")
        return 0
    finally:
        pool.shutdown(cancel_futures=True)  # where one got no answer, none is waited for
    if chosen.table:
        say(table(answers))
    bad = [answer for answer in answers if answer.problem]
    for answer in bad:
        task = answer.task
        say(f"{task.part}, {task.platform}, Python {task.python}: {answer.problem}")
    say(f"resolved {len(answers) - len(bad)} of {len(answers)}")
    return 1 if any(answer.task.part == CORE for answer in bad) else 0


if __name__ == "__main__":
    sys.exit(main())
