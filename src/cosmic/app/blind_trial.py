"""Blind trials: fibres are measured in a session whose truth is sealed until the analysis is final.

The session is another program, which draws sensor, jaws, standard and fibres from a secret, gives
the hash of the secret away first, answers what images and pushes show, and opens the truth once it
is handed the hash of the frozen analysis. It shares no code with the analysis.
"""

import hashlib
import json
import math
import subprocess
import sys
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Self

import numpy as np

from cosmic.autonomy.bending.curved import NaturalShape
from cosmic.autonomy.bending.fit import (
    Certificate,
    MeasuredFibre,
    assess_campaign,
    half_width_percent,
    measure_fibre,
)
from cosmic.autonomy.bending.plan import DRY_EI_N_M2, FARTHER, guess_ei, plan_spans
from cosmic.autonomy.bending.result import BendingError, BendingResult
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.bending.span import Span
from cosmic.frame.arrays import Floats
from cosmic.frame.errors import CosmicError
from cosmic.frame.platform_services import own_session

WORLDS: Final = ("friendly", "realistic", "harsh")
STANDARD: Final = -1
STEEPEST_DEG: Final = 40.0
TWICE: Final = 2.0
COLUMNS: Final = ("way_um", "force_un", "force_std_un", "time_s", "loading")
"""Of a push."""


class TrialError(CosmicError):
    """A sealed session does not answer as it should, or its seal is broken."""


@dataclass(frozen=True, slots=True)
class Measured:
    """One fibre as the analysis has it: this is frozen before the seal is opened."""

    number: int
    ei_n_m2: float
    ei_low_n_m2: float
    ei_high_n_m2: float
    trusted: bool
    half_percent: float
    reasons: tuple[str, ...] = ()

    @classmethod
    def of(cls, number: int, result: BendingResult) -> Self:
        """Return what counts of a result."""
        return cls(
            number,
            result.ei_n_m2,
            result.ei_low_n_m2,
            result.ei_high_n_m2,
            result.trusted,
            half_width_percent(result),
            result.reasons,
        )


@dataclass(frozen=True, slots=True)
class TrialRow:
    """One fibre with its truth."""

    measured: Measured
    true_n_m2: float

    @property
    def inside(self) -> bool:
        """Whether the interval holds the truth."""
        return self.measured.ei_low_n_m2 <= self.true_n_m2 <= self.measured.ei_high_n_m2

    @property
    def error_percent(self) -> float:
        """How much too high the value is."""
        return 100.0 * (self.measured.ei_n_m2 / self.true_n_m2 - 1.0)

    @property
    def off_by_twice(self) -> bool:
        """Whether the error is more than twice the half width of the interval."""
        return abs(self.error_percent) > TWICE * self.measured.half_percent


@dataclass(frozen=True, slots=True)
class TrialResult:
    """A session after its seal was opened.

    Attributes
    ----------
    seal, frozen : str
        Hash of the secret, given before the first push; hash of the analysis, given before the
        truth.
    scale : str
        How the scale of the force was known.
    exit_code : int
        How a whole campaign ended, as `cosmic campaign` says it; 0: as was asked.
    secret : str
        With which the same session can be had again; empty where a file has it.
    """

    seal: str
    frozen: str
    rows: tuple[TrialRow, ...]
    scale: str = ""
    exit_code: int = 0
    secret: str = ""


def sealed_program() -> Path:
    """Return the program of sealed sessions that comes with CoSMic.

    Raises
    ------
    TrialError
        It is not there.
    """
    package = Path(__file__).parents[1]
    for path in (
        package / "app" / "sealed_session.py",
        package.parents[1] / "tests" / "oracles" / "sealed_session.py",
    ):
        if path.is_file():
            return path
    raise TrialError("the program of sealed sessions is not installed: name one with --sealed-by")


UNSEEN: Final[Mapping[str, Any]] = {"shear_part": 0.8, "shear_std_part": 0.9}
"""Of fibres that no image shows: how wide they are is not known, and shear goes by that:
of some 12 um, with E/G up to 35."""


class SealedSession:
    """A sealed session in a process of its own; a context manager.

    Parameters
    ----------
    program : Path
        A Python file that answers requests, a line of JSON each: see docs/how-to/blind-trial.md.
    secret : int, optional
        For tests: the secret, which is drawn otherwise.
    """

    def __init__(
        self, program: Path, world: str, fibres: int, *, secret: int | None = None
    ) -> None:
        if not program.is_file():
            raise TrialError(f"{program}: there is no such program of sealed sessions")
        # What interrupts the trial ends the session from here, and not with words of its own.
        self._program = program
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(program)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            encoding="utf-8",
            **own_session(),
        )
        asked: dict[str, Any] = {"world": world, "fibres": fibres}
        if secret is not None:
            asked["seed"] = secret
        try:
            head = self._ask(asked)
            with self._understood(head):
                self.seal = str(head["seal"])
                ei, part = float(head["standard_ei_n_m2"]), float(head["standard_expanded_part"])
                self.settings = FitSettings(range_un=float(head["range_un"]), **UNSEEN)
            if not (0.0 < ei < math.inf and 0.0 <= part < 1.0):
                raise TrialError(
                    f"{self._program}: a standard of {ei:g} N m2 within {part:g} of it is none"
                )
            self.certificate = Certificate(ei, part)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the process; harmless the second time."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.communicate()

    def measure(self, number: int, part: float) -> MeasuredFibre | None:
        """Bend a fibre, or the standard, at spans planned as they come; None: too short."""
        shown = self._ask({"take": number, "part": part})
        with self._understood(shown):
            line = np.array(shown["line_um"], dtype=np.float64)
            rising = np.diff(line[:, 0]) > 0.0
            line = line[: len(line) if rising.all() else int(rising.argmin()) + 1]
            free = _gentle_um(line)
        spans: list[Span] = []
        guess = DRY_EI_N_M2
        try:
            while plan := plan_spans(free, guess, FARTHER, done=spans, settings=self.settings):
                one = plan[0]
                read = self._ask({"push": [one.span_um, one.stroke_um]})
                with self._understood(read):
                    spans.append(_span(read, line, one.span_um))
                if len(spans) == 1:
                    guess = guess_ei(spans, settings=self.settings) or guess
        except BendingError:
            return None
        certificate = self.certificate if number == STANDARD else None
        return measure_fibre(spans, settings=self.settings, part=part, certificate=certificate)

    def open(self, frozen: str) -> dict[str, Any]:
        """Return the truth, once the hash of the analysis is handed over.

        Raises
        ------
        TrialError
            The secret is not the one whose hash was given away at the begin.
        """
        truth = self._ask({"frozen": frozen})
        with self._understood(truth):
            truth["ei_n_m2"] = [math.nan if e is None else float(e) for e in truth["ei_n_m2"]]
            truth["seed"] = str(truth["seed"])
        if hashlib.sha256(truth["seed"].encode()).hexdigest() != self.seal:
            raise TrialError("the seal is broken: the secret is not the one of the begin")
        return truth

    @contextmanager
    def _understood(self, answer: dict[str, Any]) -> Generator[None]:
        """Turn an answer that is otherwise than it should be into words."""
        try:
            yield
        except (KeyError, IndexError, TypeError, ValueError) as exc:
            raise TrialError(
                f"{self._program}: the sealed session answers otherwise than it should "
                f"({type(exc).__name__}: {exc}): {json.dumps(answer)[:80]}"
            ) from exc

    def _ask(self, request: dict[str, Any]) -> dict[str, Any]:
        given, taken = self._process.stdin, self._process.stdout
        assert given is not None
        assert taken is not None
        try:
            given.write(json.dumps(request) + "\n")
            given.flush()
            line = taken.readline()
        except (OSError, ValueError) as exc:
            raise TrialError(f"{self._program}: the sealed session has ended: {exc}") from exc
        if not line:
            raise TrialError(
                f"{self._program}: the sealed session does not answer, it has ended; see what it "
                "printed above"
            )
        try:
            return dict(json.loads(line))
        except (TypeError, ValueError) as exc:
            raise TrialError(
                f"{self._program}: the sealed session does not answer with a line of JSON, "
                f"but with {line.strip()[:80]!r}"
            ) from exc


def _gentle_um(line_um: Floats) -> float:
    """Return how far from the jaws the fibre slopes little enough to be pushed."""
    along, aside = np.diff(line_um, axis=0).T
    steep = np.abs(np.degrees(np.arctan2(aside, along))) > STEEPEST_DEG
    return float(line_um[int(steep.argmax()), 0] if steep.any() else line_um[-1, 0])


def _span(read: dict[str, Any], line: Floats, place_um: float) -> Span:
    if len({len(read[column]) for column in COLUMNS}) > 1:
        raise ValueError(f"{', '.join(COLUMNS)} differ in length")
    return Span(
        nominal_um=place_um,
        probe_x_um=place_um,
        hold_x_um=0.0,
        probe_um=np.array(read["way_um"], dtype=np.float64),
        force_un=np.array(read["force_un"], dtype=np.float64),
        force_std_un=np.array(read["force_std_un"], dtype=np.float64),
        time_s=np.array(read["time_s"], dtype=np.float64),
        loading=np.array(read["loading"], dtype=np.bool_),
        shape=NaturalShape(line[:, 0], line[:, 1], place_um),
    )


def run_session(
    world: str,
    fibres: int,
    *,
    program: Path | None = None,
    standard: bool = True,
    secret: int | None = None,
    publish: Callable[[str], object] = str,
) -> TrialResult:
    """Measure in a sealed session, freeze the analysis, open the seal.

    Parameters
    ----------
    standard : bool
        The standard is bent at the begin, in the middle and at the end.
    publish : callable
        Called with the seal before anything is measured, and with the hash of the analysis before
        the truth is asked for.

    Raises
    ------
    TrialError
        The session does not answer, or its seal is broken.
    """
    with SealedSession(program or sealed_program(), world, fibres, secret=secret) as session:
        publish(f"sealed: {session.seal}")
        kept: dict[int, MeasuredFibre] = {}
        standards = []
        for number in range(fibres):
            part = number / max(fibres - 1, 1)
            if standard and number in (0, fibres // 2, fibres - 1):
                standards.append(session.measure(STANDARD, part))
            if (measured := session.measure(number, part)) is not None:
                kept[number] = measured
        found = assess_campaign(
            list(kept.values()),
            standards=[each for each in standards if each is not None],
            settings=session.settings,
        )
        final = [Measured.of(n, each) for n, each in zip(kept, found.fibres, strict=True)]
        frozen = digest_of(final)
        publish(f"frozen: {frozen}")
        opened = session.open(frozen)
        truth = opened["ei_n_m2"]
        if len(truth) != fibres:
            raise TrialError(f"the sealed session tells {len(truth)} truths of {fibres} fibres")
        rows = tuple(TrialRow(each, truth[each.number]) for each in final)
        said = "verified" if found.scale.verified else "not verified"
        return TrialResult(
            session.seal,
            frozen,
            rows,
            f"{said}, {100.0 * found.scale.off_part:+.1f} %",
            secret=opened["seed"],
        )


def digest_of(measured: Sequence[Measured]) -> str:
    """Return the hash of an analysis: it cannot be changed any more once this is known."""
    text = json.dumps([asdict(each) for each in measured], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def table_of(results: Sequence[TrialResult]) -> list[str]:
    """Return the table of a trial: each fibre of a single session, and what all come to."""
    lines = [
        f"seal {each.seal}, analysis frozen as {each.frozen}"
        + (f", secret {each.secret}" if each.secret else "")
        for each in results
    ]
    rows = [row for each in results for row in each.rows]
    if len(results) == 1:
        lines.append(f"scale of the force: {results[0].scale}")
        lines.append(f"{'fibre':>5} {'true':>10} {'measured':>10} {'95 % interval':>23} {'':<12}")
        lines += [_line(row) for row in rows]
    good = [row for row in rows if row.measured.trusted]
    lines.append(f"measured {len(rows)}, good {len(good)}")
    if not good:
        return [*lines, "no value is good: there is nothing to compare"]
    inside = sum(row.inside for row in good)
    off = sum(row.off_by_twice for row in good)
    right = [row for row in rows if row.inside and row.measured.half_percent <= 30.0]
    thrown = sum(not row.measured.trusted for row in right)
    halves = [row.measured.half_percent for row in good]
    part = inside / len(good)
    error = 196.0 * math.sqrt(max(part * (1.0 - part), 0.02) / len(good))
    lines += [
        f"interval holds the truth: {inside} of {len(good)}, {100.0 * part:.1f} "
        f"± {error:.1f} % (95 % expected)",
        f"good and off by more than twice the half width: {off}",
        f"right and thrown away: {thrown} of {len(right)}",
        f"half width, median: {np.median(halves):.1f} %",
    ]
    return lines


def _line(row: TrialRow) -> str:
    one = row.measured
    word = "not trusted" if not one.trusted else "" if row.inside else "OUTSIDE"
    return (
        f"{one.number:>5} {row.true_n_m2:>10.3e} {one.ei_n_m2:>10.3e} "
        f"{one.ei_low_n_m2:>10.3e} to {one.ei_high_n_m2:>9.3e} {word:<12}"
    ).rstrip()
