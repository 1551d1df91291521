"""What the engine of procedures costs: a step, an operation, a drawing, and an abort."""

import threading
import time
from collections.abc import Callable

from benchmarks.figures import Figure, main, percentile
from cosmic.autonomy.procedures.failures import ProcedureAborted
from cosmic.autonomy.procedures.parts import (
    Guard,
    Parallel,
    Procedure,
    Repeat,
    Retry,
    Sequence,
    Steps,
    UnitOperation,
)
from cosmic.autonomy.procedures.procedure import Part
from cosmic.autonomy.procedures.run import ProcedureRun
from cosmic.frame.clock import RatedClock
from cosmic.frame.failure import FailurePolicy

NAME = "procedure_engine"
STEPS = 20


class Idle(UnitOperation[None]):
    """Yields so many times and waits for nothing."""

    def __init__(self, steps: int, wait_s: float = 0.0) -> None:
        self.name = "idle"
        self.steps, self.wait_s = steps, wait_s

    def run(self, work: None) -> Steps:  # noqa: ARG002 - what an operation looks like
        """Yield."""
        for _ in range(self.steps):
            yield self.wait_s


def run_of(part: Part[None]) -> ProcedureRun[None]:
    """Return a run on a clock of its own."""
    return ProcedureRun(Procedure("benchmark", part), None, RatedClock(), FailurePolicy())


def cost_us(part: Callable[[], Part[None]], count: int) -> float:
    """Return the CPU time of one round of `part`, in us."""
    rounds = iter(range(count))
    run = run_of(Repeat(part(), lambda _work: next(rounds, None) is None))
    before_s = time.thread_time()
    run.run_here()
    return 1e6 * (time.thread_time() - before_s) / count


def bare_us(count: int) -> float:
    """Return the CPU time of a step of a generator that nobody drives but a loop, in us."""
    before_s = time.thread_time()
    for _ in range(count):
        for _wish in Idle(STEPS).run(None):
            pass
    return 1e6 * (time.thread_time() - before_s) / (count * STEPS)


def large(parts: int) -> Part[None]:
    """Return a tree with retries and guards."""
    one = [Retry(Guard(Idle(1), lambda _work: True, "never"), 3) for _ in range(parts // 3)]
    return Sequence("large", *one)


def drawing_us(count: int) -> float:
    """Return the CPU time to look at a tree of a hundred parts, in us."""
    run = run_of(large(100))
    before_s = time.thread_time()
    for _ in range(count):
        _ = run.tree
    return 1e6 * (time.thread_time() - before_s) / count


def abort_ms(count: int) -> list[float]:
    """Return the wall times from the abort of a waiting run to its end, in ms."""
    found = []
    for _ in range(count):
        run = run_of(Parallel("both", Idle(1, 1000.0), Idle(1, 1000.0)))
        begun = threading.Event()
        run.subscribe(lambda event, begun=begun: begun.set() if event.path == (1,) else None)
        run.start()
        begun.wait(5.0)
        before_s = time.perf_counter()
        run.abort()
        try:
            run.wait(5.0)
        except ProcedureAborted:
            found.append(1e3 * (time.perf_counter() - before_s))
    return found


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    count = 20 if quick else 2000
    nothing = cost_us(lambda: Idle(0), count)
    step = (cost_us(lambda: Idle(STEPS), count) - nothing) / STEPS
    bare = bare_us(count)
    wrapped = cost_us(lambda: Retry(Guard(Idle(0), lambda _work: True, "never"), 3), count)
    aborts = abort_ms(5 if quick else 100)
    return [
        Figure(NAME, "step that waits for nothing", step, "us CPU", 20.0),
        Figure(NAME, "the same to a bare generator's", step / bare, "x"),
        Figure(NAME, "operation of no step, in a repeat", nothing, "us CPU"),
        Figure(NAME, "the same with retry and guard round it", wrapped, "us CPU"),
        Figure(NAME, "look at a tree of 100 parts", drawing_us(max(5, count // 10)), "us CPU"),
        Figure(NAME, "abort to the end of the run, p50", percentile(aborts, 50.0), "ms"),
        Figure(NAME, "abort to the end of the run, p99", percentile(aborts, 99.0), "ms", 50.0),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
