"""What a run waits for: movements, time, a rest, a turn; and what is asked of it meanwhile."""

import logging
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager, suppress
from threading import Condition
from typing import Final, cast

from typing_extensions import override

from cosmic.autonomy.procedures.operation import Awaited, SafePoint
from cosmic.frame.clock import Clock
from cosmic.frame.errors import CosmicError
from cosmic.frame.time_scale import Worker

logger = logging.getLogger(__name__)

POLL_WALL_S: Final = 0.05
"""How often at least whoever waits looks whether it was ended."""
LOOK_WALL_S: Final = 0.002
"""How often something is looked at that cannot tell of its end."""
LOOK_S: Final = 0.01
"""The same where a test moves the time."""


class OperationEnd(SafePoint):
    """Yielded after each unit operation: one who goes step by step rests there."""


OPERATION_END: Final = OperationEnd()


class RunControl:
    """What others want of a run, and what wakes its thread; any thread."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self.wakeup = Condition()
        self.abort_reason: str | None = None
        self.aborts = 0
        self.pausing = False
        self.stepping = False
        self.turn = 0
        self._woken = False
        self._worker = Worker()

    @property
    def poll_s(self) -> float:
        """The longest wait between two looks, in the platform's time."""
        return POLL_WALL_S * self.clock.rate or math.inf

    @property
    def look_s(self) -> float:
        """The wait between two looks at something that cannot tell of its end."""
        return LOOK_WALL_S * self.clock.rate or LOOK_S

    def rests_at(self, point: SafePoint) -> bool:
        """Tell whether the run is to rest at `place`."""
        return self.stepping if isinstance(point, OperationEnd) else self.pausing

    @contextmanager
    def carrying_out(self) -> Generator[None]:
        """Run a procedure inside: what its thread does between its waits takes wall time."""
        self._worker = self.clock.worker(leads=True)
        self._worker.busy()
        try:
            yield
        finally:
            self._worker.close()

    def wake(self, *_who: object) -> None:
        """Have the thread of the run look again at once."""
        with self.wakeup:
            self._woken = True
            self._worker.busy()
            self.wakeup.notify_all()

    def wait(self, until_s: float) -> None:
        """Wait until `wake` is called, or until `until_s`."""
        with self.wakeup:
            if not self._woken:
                self._worker.idle()
                self.clock.wait(self.wakeup, until_s)
                self._worker.busy()
            self._woken = False


GUARD_S: Final = 0.02
"""How often the condition of a guard is looked at, in the platform's time."""


class Pending(ABC):
    """Something that a branch of a procedure waits for; the run's thread."""

    @property
    def resting(self) -> bool:
        """True while it waits for nothing but the end of a pause."""
        return False

    @abstractmethod
    def ready(self) -> bool:
        """Tell whether the branch may go on."""

    @abstractmethod
    def look_again_s(self, now_s: float) -> float:
        """Return when to look again at the latest, on the platform's clock."""

    def result(self) -> object:
        """Return what is sent back into the operation, or raise what is thrown into it."""
        return None

    def cancel(self) -> None:
        """End what was begun; harmless the second time."""
        return

    def running(self) -> bool:
        """Tell whether something begun has not yet ended, cancelled or not."""
        return False


class ForNothing(Pending):
    """Nothing: the branch has not begun yet."""

    @override
    def ready(self) -> bool:
        return True

    @override
    def look_again_s(self, now_s: float) -> float:
        return now_s


class ForTime(Pending):
    """Seconds of the platform's time."""

    def __init__(self, control: RunControl, duration_s: float) -> None:
        self._clock = control.clock
        self._until_s = control.clock.now_s() + duration_s

    @override
    def ready(self) -> bool:
        return self._clock.now_s() >= self._until_s

    @override
    def look_again_s(self, now_s: float) -> float:
        return self._until_s


class ForRest(Pending):
    """The end of a pause; ready at once where nobody wants one."""

    def __init__(self, control: RunControl, point: SafePoint) -> None:
        self._control = control
        self._point = point
        self._turn = control.turn

    @property
    @override
    def resting(self) -> bool:
        return self._control.turn == self._turn and self._control.rests_at(self._point)

    @override
    def ready(self) -> bool:
        return not self.resting

    @override
    def look_again_s(self, now_s: float) -> float:
        return math.inf


class ForAwaited(Pending):
    """A movement, a task or a status."""

    def __init__(self, control: RunControl, awaited: Awaited) -> None:
        self._awaited = awaited
        self._look_s = control.look_s
        self._cancelled = False
        add_callback: Callable[[Callable[..., None]], object] | None
        add_callback = getattr(awaited, "add_callback", None)
        if add_callback is not None and not awaited.done:
            add_callback(control.wake)
            self._look_s = min(control.poll_s, 5 * control.look_s)

    @override
    def ready(self) -> bool:
        return self._awaited.done

    @override
    def look_again_s(self, now_s: float) -> float:
        return now_s + self._look_s

    @override
    def result(self) -> object:
        return self._awaited.wait(0.0)

    @override
    def cancel(self) -> None:
        if self._cancelled or self._awaited.done:
            return
        self._cancelled = True
        try:
            self._awaited.cancel()
        except CosmicError as exc:  # what ends a procedure must reach the rest of it
            logger.warning("could not be cancelled: %s", exc)

    @override
    def running(self) -> bool:
        return not self._awaited.done


class ForAny(Pending):
    """What the branches of a parallel wait for: ready when one of them is."""

    def __init__(self, parts: Sequence[Pending]) -> None:
        self._parts = tuple(parts)

    @property
    @override
    def resting(self) -> bool:
        return bool(self._parts) and all(part.resting for part in self._parts)

    @override
    def ready(self) -> bool:
        return not self._parts or any(part.ready() for part in self._parts)

    @override
    def look_again_s(self, now_s: float) -> float:
        return min((part.look_again_s(now_s) for part in self._parts), default=now_s)

    @override
    def cancel(self) -> None:
        for part in self._parts:
            part.cancel()

    @override
    def running(self) -> bool:
        return any(part.running() for part in self._parts)


class Watch:
    """The condition of a guard; once broken it stays so."""

    def __init__(self, holds: Callable[[], bool]) -> None:
        self._holds = holds
        self._broken = False
        self.error: Exception | None = None
        """What the condition raised, to be raised again where the guard stands."""

    def broken(self) -> bool:
        """Tell whether the condition is broken; one that cannot answer is."""
        if not self._broken:
            try:
                self._broken = not self._holds()
            except Exception as exc:  # noqa: BLE001 - raised again by the guard
                self.error, self._broken = exc, True
        return self._broken


class Watched(Pending):
    """What a guarded part waits for, and the condition that may not break meanwhile.

    Nobody looks at the condition during a pause: what it would set going is not wanted then.
    """

    def __init__(self, part: Pending, watch: Watch) -> None:
        self._part = part
        self._watch = watch

    @property
    @override
    def resting(self) -> bool:
        return self._part.resting

    @override
    def ready(self) -> bool:
        return self._part.ready() or (not self._part.resting and self._watch.broken())

    @override
    def look_again_s(self, now_s: float) -> float:
        return min(self._part.look_again_s(now_s), now_s + GUARD_S)

    @override
    def cancel(self) -> None:
        self._part.cancel()

    @override
    def running(self) -> bool:
        return self._part.running()


class ForEnd(Pending):
    """The end of what was cancelled, well or not, but no longer than `limit_s`."""

    def __init__(self, control: RunControl, parts: Sequence[Pending], limit_s: float) -> None:
        self._parts = tuple(parts)
        self._look_s = control.look_s
        self._clock = control.clock
        self._until_s = control.clock.now_s() + limit_s

    @override
    def ready(self) -> bool:
        return not self.running() or self._clock.now_s() >= self._until_s

    @override
    def look_again_s(self, now_s: float) -> float:
        return min(now_s + self._look_s, self._until_s)

    @override
    def running(self) -> bool:
        return any(part.running() for part in self._parts)


def pending_of(yielded: object, control: RunControl) -> Pending:
    """Return what `yielded`, as an operation yielded it, means.

    Raises
    ------
    TypeError, ValueError
        It means nothing.
    """
    if isinstance(yielded, Pending):
        return yielded
    if isinstance(yielded, SafePoint):
        return ForRest(control, yielded)
    if isinstance(yielded, (int, float)) and not isinstance(yielded, bool):
        if not 0.0 <= yielded < math.inf:
            raise ValueError(f"an operation can wait for 0 s or more, got {yielded!r}")
        return ForTime(control, float(yielded))
    if all(hasattr(yielded, name) for name in ("done", "wait", "cancel")):
        return ForAwaited(control, cast("Awaited", yielded))
    raise TypeError(
        f"an operation yielded {yielded!r}; yield a movement or task, seconds, or SAFE_POINT"
    )


class Resource:
    """Something that one branch of a procedure uses at a time; belongs to the thread of the run.

    Whoever came first gets it first.

    Parameters
    ----------
    name : str
        As shown in the tree, such as "the probe".
    rank : int
        Branches take several in the order of their ranks, so that two never wait for each other.
    """

    def __init__(self, name: str, rank: int = 0) -> None:
        self.name: Final = name
        self.rank: Final = rank
        self._queue: list[object] = []

    @property
    def free(self) -> bool:
        """True when nobody has it, and nobody waits for it."""
        return not self._queue

    def ask(self, who: object) -> None:
        """Queue up for it; harmless the second time."""
        if who not in self._queue:
            self._queue.append(who)

    def held_by(self, who: object) -> bool:
        """Tell whether it is the turn of `who`."""
        return bool(self._queue) and self._queue[0] is who

    def release(self, who: object) -> None:
        """Let the next one have it, or wait for it no longer."""
        with suppress(ValueError):
            self._queue.remove(who)


class ForTurn(Pending):
    """The moment when a resource is one's own."""

    def __init__(self, resource: Resource, who: object, control: RunControl) -> None:
        self._resource = resource
        self._who = who
        self._control = control

    @property
    @override
    def resting(self) -> bool:
        # Nothing is lost by waiting: in a pause this is as good a point of rest as any.
        return (self._control.pausing or self._control.stepping) and not self.ready()

    @override
    def ready(self) -> bool:
        return self._resource.held_by(self._who)

    @override
    def look_again_s(self, now_s: float) -> float:
        return math.inf  # it is given back by a branch of the same thread
