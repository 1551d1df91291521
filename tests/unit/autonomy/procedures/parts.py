"""Operations that do as a test tells them, and note all that happens."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

from typing_extensions import override

from cosmic.autonomy.procedures.operation import (
    SAFE_POINT,
    Awaited,
    OperationFailed,
    SafePoint,
    Steps,
    UnitOperation,
)
from cosmic.autonomy.procedures.procedure import Part, Procedure
from cosmic.autonomy.procedures.run import ProcedureRun
from cosmic.autonomy.procedures.tree import NodeEvent, NodeState
from cosmic.frame.clock import Clock, ManualClock
from cosmic.frame.errors import DeviceTimeout, MoveCancelled, StoppedError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.verdict import Reason, refuse

MOVE: Final = "move"
PHASES: Final = ("precondition", "run", "verify")
Does = float | SafePoint | str


@dataclass
class Work:
    """What happened, in order, and what was set in motion."""

    clock: Clock = field(default_factory=lambda: ManualClock(auto_advance=True))
    log: list[str] = field(default_factory=list)
    moves: list["FakeMove"] = field(default_factory=list)
    coasts_s: float = 0.0
    points: int = 0
    at_point: Callable[[int], None] = lambda _number: None

    def point(self) -> None:
        """Say that an operation is about to yield."""
        self.points += 1
        self.at_point(self.points - 1)

    @property
    def moving(self) -> list[str]:
        return [move.name for move in self.moves if not move.done]


class FakeMove:
    """A movement that takes a second of the platform's time, and coasts when cancelled."""

    def __init__(self, work: Work, name: str, error: Exception | None = None) -> None:
        self._work = work
        self.name = name
        self._until_s = work.clock.now_s() + 1.0
        self._error = error
        self.cancelled = False
        work.moves.append(self)

    @property
    def done(self) -> bool:
        return self._work.clock.now_s() >= self._until_s

    def wait(self, timeout_s: float | None = None) -> object:
        if not self.done:
            raise DeviceTimeout("it has not ended")
        if self.cancelled:
            raise MoveCancelled("it was cancelled")
        if self._error is not None:
            raise self._error
        return f"{self.name} is there"

    def cancel(self) -> None:
        if not self.done:
            self._work.log.append(f"cancel {self.name}")
            self.cancelled = True
            self._until_s = self._work.clock.now_s() + self._work.coasts_s


def missed() -> OperationFailed:
    return OperationFailed("missed grasp", "nothing between the jaws; shift and try again")


def stop() -> StoppedError:
    return StoppedError(refuse(Reason.STOPPED, "the stop is latched: pressed; reset it first"))


class Op(UnitOperation[Work]):
    """Waits as told in each phase, and fails where and as often as told.

    Parameters
    ----------
    steps : sequence
        What `run` yields: seconds, SAFE_POINT, or "move".
    fails_in : str
        "precondition", "run", "verify", "move" or "undo".
    times : int
        How often it fails there.
    """

    def __init__(
        self,
        name: str,
        *,
        steps: Sequence[Does] = (1.0,),
        looks: Sequence[Does] | None = None,
        undoes: Sequence[Does] | None = (),
        fails_in: str = "",
        times: int = 1_000_000,
        error: Callable[[], Exception] = missed,
    ) -> None:
        self.name = name
        self._steps, self._looks, self._undoes = steps, looks, undoes
        self._fails_in, self._left, self._error = fails_in, times, error

    @override
    def precondition(self, work: Work) -> None:
        self._maybe_fail("precondition")

    @override
    def run(self, work: Work) -> Steps:
        work.log.append(self.name)
        yield from self._do(work, self._steps)
        self._maybe_fail("run")
        work.log.append(f"{self.name} ran")

    @override
    def verify(self, work: Work) -> Steps | None:
        if self._looks is None and self._fails_in != "verify":
            return None
        return self._verify(work)

    def _verify(self, work: Work) -> Steps:
        work.log.append(f"see {self.name}")
        yield from self._do(work, self._looks or ())
        self._maybe_fail("verify")

    @override
    def undo(self, work: Work) -> Steps | None:
        return None if self._undoes is None else self._undo(work, self._undoes)

    def _undo(self, work: Work, steps: Sequence[Does]) -> Steps:
        work.log.append(f"undo {self.name}")
        yield from self._do(work, steps)
        self._maybe_fail("undo")

    def _do(self, work: Work, steps: Sequence[Does]) -> Steps:
        for step in steps:
            wish = self._move(work) if isinstance(step, str) else step
            work.point()
            answer = yield wish
            assert (answer is None) == (not isinstance(step, str))

    def _move(self, work: Work) -> Awaited:
        error = self._error() if self._fails_in == "move" and self._again() else None
        return FakeMove(work, self.name, error)

    def _maybe_fail(self, phase: str) -> None:
        if phase == self._fails_in and self._again():
            raise self._error()

    def _again(self) -> bool:
        self._left -= 1
        return self._left >= 0


def run_of(part: Part[Work], work: Work | None = None) -> ProcedureRun[Work]:
    """Return a run that is ready to begin."""
    work = work or Work()
    return ProcedureRun(Procedure("trial", part, make_safe), work, work.clock, FailurePolicy())


def make_safe(work: Work) -> Steps:
    """Draw back, as the last thing that is done."""
    work.log.append("safe")
    yield SAFE_POINT
    yield 0.5


def done(run: ProcedureRun[Work]) -> list[str]:
    """Return what happened, without the notes that an operation ran through."""
    return [each for each in run.work.log if not each.endswith(" ran")]


def ends(run: ProcedureRun[Work]) -> Iterator[tuple[str, str]]:
    """Return name and state of each part of the tree."""
    for view in run.tree.walk():
        yield view.name, str(view.state)


def moving_when_undone(run: ProcedureRun[Work]) -> list[list[str]]:
    """Return the list that grows by what moves whenever something is undone."""
    seen: list[list[str]] = []

    def note(event: NodeEvent) -> None:
        if event.state is NodeState.UNDOING:
            seen.append(run.work.moving)

    run.subscribe(note)
    return seen
