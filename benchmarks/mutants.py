"""Break the safety path on purpose, and see whether the tests notice.

    python -m benchmarks.mutants                        # the forty of tests/mutants/safety.toml
    python -m benchmarks.mutants --only "no margin"     # some of them
    python -m benchmarks.mutants --random 60 --seed 1   # random edits of the same modules
    python -m benchmarks.mutants --root PATH            # of another checkout
    python -m benchmarks.mutants --keep FILE            # write the result; --against FILE compares

Each edit is made in a copy of the sources, never in the checkout, and the tests named for it run
there until one fails. What fails is tried once more alone, so that a test which fails only on a
busy computer kills nothing. An edit whose text is not found exactly once does not apply, which is a
failure: write it anew for the code as it is.
"""

import argparse
import json
import os
import queue
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from benchmarks.mutations import Edit, random_edits

ROOT: Final = Path(__file__).resolve().parents[1]
DESCRIBED: Final = "tests/mutants/safety.toml"
LONGEST_S: Final = 300.0
PATIENCE: Final = 2.0
"""A run may always take so many times what all tests together take unharmed."""
TRIES: Final = 2
KILLED, HUNG, SURVIVED, NOT_APPLIED = "killed", "hung", "survived", "does not apply"
_PASSED: Final = 0
_NOTHING_RUN: Final = (4, 5)
"""What pytest returns when it does not find the tests."""


class DoesNotApplyError(Exception):
    """The text of an edit is not there, or more than once; or its tests are gone."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """One broken promise.

    Attributes
    ----------
    file : str
        Relative to src/cosmic.
    tests : tuple of str
        Files of tests that should notice.
    """

    name: str
    area: str
    behaviour: str
    file: str
    edit: Callable[[str], str]
    tests: tuple[str, ...]
    operator: str = ""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a mutant, and by which test."""

    mutant: Mutant
    what: str
    by: str
    took_s: float


class Copy:
    """A copy of the sources and tests in which edits are made one at a time."""

    def __init__(self, root: Path, folder: Path) -> None:
        self.folder = folder
        left_out = shutil.ignore_patterns(".*", "__pycache__", "*.egg-info")
        shutil.copytree(root, folder, ignore=left_out, dirs_exist_ok=True)
        self._environment = {
            **os.environ,
            "PYTHONPATH": str(folder / "src"),
            "QT_QPA_PLATFORM": "offscreen",
        }
        self._environment.pop("PYTHONDONTWRITEBYTECODE", None)
        self._check_is_seen()

    def _check_is_seen(self) -> None:
        command = [sys.executable, "-c", "import cosmic; print(cosmic.__file__)"]
        found = subprocess.run(
            command,
            cwd=self.folder,
            env=self._environment,
            capture_output=True,
            text=True,
            check=True,
        )
        seen = Path(found.stdout.strip()).resolve()
        if not seen.is_relative_to(self.folder.resolve()):
            raise SystemExit(f"tests would run {seen}, not the copy")

    def file_of(self, mutant: Mutant) -> Path:
        """Return the file that a mutant is made in: the one named, or the only one that fits."""
        package = self.folder / "src" / "cosmic"
        named = package / mutant.file
        if named.is_file() and _applies(mutant, named):
            return named
        fitting = [file for file in package.rglob("*.py") if _applies(mutant, file)]
        if len(fitting) != 1:
            raise DoesNotApplyError(f"its text fits {len(fitting)} files")
        return fitting[0]

    def run_on(self, mutant: Mutant, longest_s: float) -> Outcome:
        """Make the edit, run the tests, and undo it."""
        began_s = time.monotonic()
        try:
            file = self.file_of(mutant)
            missing = [each for each in mutant.tests if not (self.folder / each).is_file()]
            if missing:
                raise DoesNotApplyError(f"there are no tests {', '.join(missing)}")
        except DoesNotApplyError as exc:
            return Outcome(mutant, NOT_APPLIED, str(exc), 0.0)
        before = file.read_text(encoding="utf-8")
        try:
            _write(file, mutant.edit(before))
            what, by = self._noticed(mutant.tests, longest_s)
        finally:
            _write(file, before)
        return Outcome(mutant, what, by, time.monotonic() - began_s)

    def _noticed(self, tests: Sequence[str], longest_s: float) -> tuple[str, str]:
        shaken = ""
        for _ in range(TRIES):
            code, failed = self.run(tests, longest_s)
            if code == _PASSED:
                return SURVIVED, shaken
            if code is None:
                return HUNG, f"more than {longest_s:g} s"
            if code in _NOTHING_RUN:
                return NOT_APPLIED, "no tests were run"
            if not failed or self.run([failed], longest_s)[0] != _PASSED:
                return KILLED, failed or "they cannot even be collected"
            shaken = f"{failed} failed once and not again"
        return SURVIVED, shaken

    def run(self, tests: Sequence[str], longest_s: float) -> tuple[int | None, str]:
        """Run tests to the first failure; returns pytest's code, None when it hangs, and which."""
        options = ["-x", "-q", "-rfE", "-m", "not slow", "--tb=no", "--hypothesis-seed=0"]
        command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *options, *tests]
        with subprocess.Popen(
            command,
            cwd=self.folder,
            env=self._environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            encoding="utf-8",
            errors="replace",
            start_new_session=True,
        ) as process:
            try:
                said, _ = process.communicate(timeout=longest_s)
            except subprocess.TimeoutExpired:
                _end(process)
                return None, ""
        found = re.search(r"^(?:FAILED|ERROR) (\S+?::.*?)(?: - .*)?$", said, flags=re.MULTILINE)
        return process.returncode, found.group(1) if found else ""


def _end(process: subprocess.Popen[str]) -> None:
    """End tests that hang, and what they started."""
    if hasattr(os, "killpg"):
        os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()


def _applies(mutant: Mutant, file: Path) -> bool:
    try:
        mutant.edit(file.read_text(encoding="utf-8"))
    except DoesNotApplyError:
        return False
    return True


def _write(file: Path, text: str) -> None:
    """Write a module, and forget what was compiled of it: within a second the two look alike."""
    file.write_text(text, encoding="utf-8")
    for compiled in (file.parent / "__pycache__").glob(f"{file.stem}.*.pyc"):
        compiled.unlink()


def _replacing(before: str, after: str) -> Callable[[str], str]:
    def edit(text: str) -> str:
        found = text.count(before)
        if found != 1:
            raise DoesNotApplyError(f"its text stands {found} times in the file")
        return text.replace(before, after)

    return edit


def described() -> list[Mutant]:
    """Return the mutants that are described by their behaviour."""
    with (ROOT / DESCRIBED).open("rb") as file:
        read = tomllib.load(file)
    return [
        Mutant(
            name=each["name"],
            area=each["area"],
            behaviour=each["behaviour"],
            file=each["file"],
            edit=_replacing(each["before"], each["after"]),
            tests=tuple(each["tests"]),
        )
        for each in read["mutant"]
    ]


def _changed_by(edit: Edit) -> Callable[[str], str]:
    def change(text: str) -> str:
        data = text.encode()
        if data[edit.begin : edit.end] != edit.before.encode():
            raise DoesNotApplyError("another file")
        return (data[: edit.begin] + edit.after.encode() + data[edit.end :]).decode()

    return change


def at_random(root: Path, count: int, seed: int) -> list[Mutant]:
    """Return `count` random mutants, as many of each area, of each operator equally likely."""
    with (ROOT / DESCRIBED).open("rb") as file:
        areas = tomllib.load(file)["area"]
    found: list[Mutant] = []
    for number, (area, read) in enumerate(sorted(areas.items())):
        many = count // len(areas) + (number < count % len(areas))
        texts = _texts(root / "src" / "cosmic", read["modules"], area)
        for edit in random_edits(texts, many, f"{seed} {area}"):
            found.append(
                Mutant(
                    name=f"{area} {edit.file}:{edit.line} {edit.operator}",
                    area=area,
                    behaviour=f"`{_short(edit.before)}` becomes `{_short(edit.after)}`",
                    file=edit.file,
                    edit=_changed_by(edit),
                    tests=tuple(read["tests"]),
                    operator=edit.operator,
                )
            )
    return found


def _texts(package: Path, named: Iterable[str], area: str) -> dict[str, str]:
    """Return the modules of an area by path; a folder stands for all of its modules."""
    files: list[Path] = []
    for each in named:
        place = package / each
        if not place.exists():
            raise SystemExit(f"{DESCRIBED}: area {area}: there is no {each}")
        files += sorted(place.rglob("*.py")) if place.is_dir() else [place]
    return {
        file.relative_to(package).as_posix(): file.read_text(encoding="utf-8") for file in files
    }


def _short(text: str) -> str:
    text = " ".join(text.split()).replace("|", "\\|")
    return text if len(text) <= 60 else f"{text[:57]}..."


def judge_all(root: Path, mutants: Sequence[Mutant], jobs: int, longest_s: float) -> list[Outcome]:
    """Judge all, `jobs` at a time, each in a copy of its own; first see that all tests pass."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        copies: queue.SimpleQueue[Copy] = queue.SimpleQueue()
        for number in range(jobs):
            place = Path(folder) / str(number)
            place.mkdir()
            copies.put(Copy(root, place))

        unharmed_s = _run_unharmed(copies, mutants)
        longest_s = max(longest_s, PATIENCE * unharmed_s)

        def checked(mutant: Mutant) -> Outcome:
            copy = copies.get()
            try:
                outcome = copy.run_on(mutant, longest_s)
            finally:
                copies.put(copy)
            print(f"{outcome.what}: {mutant.name} ({outcome.by})", file=sys.stderr, flush=True)
            return outcome

        with ThreadPoolExecutor(jobs) as pool:
            return list(pool.map(checked, mutants))


def _run_unharmed(copies: "queue.SimpleQueue[Copy]", mutants: Iterable[Mutant]) -> float:
    """Return how long the tests take, in s; stop where they fail without any mutant."""
    copy = copies.get()
    tests = dict.fromkeys(test for mutant in mutants for test in mutant.tests)
    there = [each for each in tests if (copy.folder / each).is_file()]
    began_s = time.monotonic()
    code, failed = copy.run(there, longest_s=3600.0)
    took_s = time.monotonic() - began_s
    if code != _PASSED and (not failed or copy.run([failed], LONGEST_S)[0] != _PASSED):
        raise SystemExit(f"tests fail without a mutant: {failed or code}")
    copies.put(copy)
    return took_s


def table(outcomes: Sequence[Outcome]) -> str:
    """Return what became of each in a Markdown table."""
    lines = ["| mutant | what is broken | | by |", "|---|---|---|---|"]
    for each in outcomes:
        by = each.by.rpartition("::")[2].replace("|", "\\|")
        lines.append(f"| {each.mutant.name} | {each.mutant.behaviour} | {each.what} | {by} |")
    return "\n".join(lines)


def rates(outcomes: Sequence[Outcome], group: Callable[[Mutant], str], title: str) -> str:
    """Return how many were noticed of each kind."""
    noticed = Counter(group(each.mutant) for each in outcomes if each.what in (KILLED, HUNG))
    made = Counter(group(each.mutant) for each in outcomes)
    lines = [f"| {title} | killed | of |", "|---|---:|---:|"]
    lines += [f"| {name} | {noticed[name]} | {made[name]} |" for name in sorted(made)]
    lines.append(f"| all | {noticed.total()} | {made.total()} |")
    return "\n".join(lines)


def newly_surviving(outcomes: Iterable[Outcome], kept: Mapping[str, str]) -> list[str]:
    """Return the mutants that were noticed once and are not any more."""
    return [
        each.mutant.name
        for each in outcomes
        if each.what not in (KILLED, HUNG) and kept.get(each.mutant.name) in (KILLED, HUNG)
    ]


def _commit(root: Path) -> str:
    command = ["git", "-C", str(root), "rev-parse", "--short", "HEAD"]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()


def _kept(outcomes: Iterable[Outcome], root: Path) -> str:
    results = {each.mutant.name: each.what for each in outcomes}
    return json.dumps({"commit": _commit(root), "result": results}, indent=2) + "\n"


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", metavar="NAME", help="these mutants alone")
    parser.add_argument("--random", type=int, default=0, metavar="N", help="so many random ones")
    parser.add_argument("--seed", type=int, default=1, help="of the random ones")
    parser.add_argument("--root", type=Path, default=ROOT, help="the checkout that is broken")
    parser.add_argument("--jobs", type=int, default=1, help="how many at a time")
    parser.add_argument("--timeout", type=float, default=LONGEST_S, help="s for one run of tests")
    parser.add_argument("--keep", type=Path, metavar="FILE", help="write the result")
    parser.add_argument("--against", type=Path, metavar="FILE", help="a result to compare with")
    parser.add_argument("--list", action="store_true", help="name them and run nothing")
    return parser.parse_args()


def main() -> int:
    """Read the command line and run."""
    asked = _arguments()
    root = asked.root.resolve()
    mutants = at_random(root, asked.random, asked.seed) if asked.random else described()
    if asked.only:
        unknown = set(asked.only) - {each.name for each in mutants}
        if unknown:
            raise SystemExit(f"there is no mutant {', '.join(sorted(unknown))}")
        mutants = [each for each in mutants if each.name in asked.only]
    if asked.list:
        print("\n".join(f"{each.name}: {each.behaviour}" for each in mutants))
        return 0
    outcomes = judge_all(root, mutants, asked.jobs, asked.timeout)
    print(table(outcomes), end="\n\n")
    print(rates(outcomes, lambda each: each.area, "area"), end="\n\n")
    if asked.random:
        print(rates(outcomes, lambda each: each.operator, "operator"))
    if asked.keep:
        asked.keep.write_text(_kept(outcomes, root), encoding="utf-8")
    if asked.against:
        kept = json.loads(asked.against.read_text(encoding="utf-8"))["result"]
        newly = newly_surviving(outcomes, kept)
        print(f"newly surviving: {', '.join(newly) or 'none'}")
        return 1 if newly else 0
    return 0 if asked.random or all(each.what in (KILLED, HUNG) for each in outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
