"""What a procedure waits for, in one shape: movements, time, a rest, or any of several."""

import logging
import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Final, cast

from typing_extensions import override

from cosmic.autonomy.procedures.operation import Awaited, SafePoint
from cosmic.autonomy.procedures.reins import Reins
from cosmic.frame.errors import CosmicError

logger = logging.getLogger(__name__)

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

    def under_way(self) -> bool:
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

    def __init__(self, reins: Reins, duration_s: float) -> None:
        self._clock = reins.clock
        self._until_s = reins.clock.now_s() + duration_s

    @override
    def ready(self) -> bool:
        return self._clock.now_s() >= self._until_s

    @override
    def look_again_s(self, now_s: float) -> float:
        return self._until_s


class ForRest(Pending):
    """The end of a pause; ready at once where nobody wants one."""

    def __init__(self, reins: Reins, place: SafePoint) -> None:
        self._reins = reins
        self._place = place
        self._turn = reins.turn

    @property
    @override
    def resting(self) -> bool:
        return self._reins.turn == self._turn and self._reins.rests_at(self._place)

    @override
    def ready(self) -> bool:
        return not self.resting

    @override
    def look_again_s(self, now_s: float) -> float:
        return math.inf


class ForAwaited(Pending):
    """A movement, a task or a status."""

    def __init__(self, reins: Reins, awaited: Awaited) -> None:
        self._awaited = awaited
        self._look_s = reins.look_s
        self._cancelled = False
        add_callback: Callable[[Callable[..., None]], object] | None
        add_callback = getattr(awaited, "add_callback", None)
        if add_callback is not None and not awaited.done:
            add_callback(reins.ring)
            self._look_s = min(reins.poll_s, 5 * reins.look_s)

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
    def under_way(self) -> bool:
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
    def under_way(self) -> bool:
        return any(part.under_way() for part in self._parts)


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
    def under_way(self) -> bool:
        return self._part.under_way()


class ForEnd(Pending):
    """The end of what was cancelled, well or not, but no longer than `limit_s`."""

    def __init__(self, reins: Reins, parts: Sequence[Pending], limit_s: float) -> None:
        self._parts = tuple(parts)
        self._look_s = reins.look_s
        self._clock = reins.clock
        self._until_s = reins.clock.now_s() + limit_s

    @override
    def ready(self) -> bool:
        return not self.under_way() or self._clock.now_s() >= self._until_s

    @override
    def look_again_s(self, now_s: float) -> float:
        return min(now_s + self._look_s, self._until_s)

    @override
    def under_way(self) -> bool:
        return any(part.under_way() for part in self._parts)


def pending_of(wish: object, reins: Reins) -> Pending:
    """Return what `wish`, as an operation yielded it, means.

    Raises
    ------
    TypeError, ValueError
        It means nothing.
    """
    if isinstance(wish, Pending):
        return wish
    if isinstance(wish, SafePoint):
        return ForRest(reins, wish)
    if isinstance(wish, (int, float)) and not isinstance(wish, bool):
        if not 0.0 <= wish < math.inf:
            raise ValueError(f"an operation can wait for 0 s or more, got {wish!r}")
        return ForTime(reins, float(wish))
    if all(hasattr(wish, name) for name in ("done", "wait", "cancel")):
        return ForAwaited(reins, cast("Awaited", wish))
    raise TypeError(
        f"an operation yielded {wish!r}; yield a movement or task, seconds, or SAFE_POINT"
    )
