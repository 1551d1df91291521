"""One long move as a series of short ones (fields MiCoCL.10 and MiCoCL.11)."""

import logging
import math
from threading import RLock

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import CosmicError, MoveCancelled, NotAvailable, refusal
from cosmic.frame.verdict import Reason, refuse
from cosmic.mico.api.axis import Axis
from cosmic.mico.api.axis_numbers import Number, as_number
from cosmic.mico.core.motion.movement import Movement

logger = logging.getLogger(__name__)


@checked_class
class StepwiseMove:
    """Moves an axis to a position in parts of at most `largest`, one after the other; any thread.

    Each part goes through the gate. Whatever ends a part early (a stop, a newer command, a
    failure) ends the whole. A target outside the limits is refused before the first part.
    The position it starts from is where the axis stands now, not where it may be going.

    Parameters
    ----------
    axis : Axis
        What to move.
    target : float or str
        Where to, in the unit of the axis, from the user's zero.
    largest : float or str
        The largest part, above 0.
    consent : bool
        Move although the position is not referenced.

    Raises
    ------
    MoveRefused
        The gate refused the target, or `largest` is not above 0; nothing moved.
    NotAvailable
        The position has not been read yet.
    """

    def __init__(
        self, axis: Axis, target: Number, largest: Number, *, consent: bool = False
    ) -> None:
        self._axis = axis
        self._largest = _above_zero(largest, axis)
        self._start, self._travel = _travel(axis, target, consent=consent)
        self._consent = consent
        self.planned = max(1, math.ceil(abs(self._travel) / self._largest - 1e-9))
        self._begun = 0
        self._lock = RLock()
        self._abandoned = False
        self._part: Movement | None = None
        self.movement = Movement()
        self.movement.on_cancel(self._cancel)
        self._next()

    @classmethod
    def by(
        cls, axis: Axis, distance: Number, largest: Number, *, consent: bool = False
    ) -> "StepwiseMove":
        """Move by `distance` from where the axis stands."""
        travel = as_number(distance, axis.unit, axis.key)
        return cls(axis, _position(axis) + travel, largest, consent=consent)

    @property
    def begun(self) -> int:
        """How many parts were begun; `planned` is how many there are."""
        return self._begun

    @property
    def done(self) -> bool:
        """True when the whole move has ended, well or not."""
        return self.movement.done

    def abandon(self) -> None:
        """Begin no further part; the one under way goes on, for a newer command to replace."""
        with self._lock:
            self._abandoned = True

    def _cancel(self) -> None:
        self.abandon()
        part = self._part
        if part is not None:
            part.cancel()

    def _next(self) -> None:
        """Begin the next part; the caller's thread at first, then the device's."""
        with self._lock:
            if self._abandoned:
                self.movement.fail(MoveCancelled(f"{self._axis.key}: the series was given up"))
                return
            self._begun += 1
            travel = min(self._begun * self._largest, abs(self._travel))
            # From where it began, even if the user has set another zero meanwhile.
            target = self._start + math.copysign(travel, self._travel) - self._axis.details.zero
            if self._part is None:
                part = self._axis.move_to(target, wait=False, consent=self._consent)
            else:
                part = self._axis.continue_to(target, self._part, consent=self._consent)
            self._part = part
        part.add_callback(self._on_part_ended)

    def _on_part_ended(self, part: Movement) -> None:
        error = part.exception()
        if error is not None:
            self.movement.fail(error)
        elif self._begun >= self.planned:
            self.movement.finish(part.wait())
        else:
            self._go_on()

    def _go_on(self) -> None:
        try:
            self._next()
        except CosmicError as exc:  # the device went away between two parts
            logger.warning("%s: %s", self._axis.key, exc)
            self.movement.fail(exc)


def _position(axis: Axis) -> float:
    position = axis.details.shown_position
    if position is None:
        raise NotAvailable(f"{axis.key}: no position has been read yet")
    return position


def _above_zero(largest: Number, axis: Axis) -> float:
    value = as_number(largest, axis.unit, axis.key)
    if not value > 0.0:
        text = f"{axis.key}: the largest part of a move must be above 0, not {value:g}"
        raise refusal(refuse(Reason.LIMIT, text, axis=axis.key, value=value, limit=0.0))
    return value


def _travel(axis: Axis, target: Number, *, consent: bool) -> tuple[float, float]:
    """Return where it starts, in gate coordinates, and how far it goes.

    The gate has then seen the whole of it.
    """
    verdict = axis.check(target, consent=consent)
    if not verdict.allowed:
        raise refusal(verdict)
    start = _position(axis)
    travel = as_number(target, axis.unit, axis.key) - start
    return start + axis.details.zero, travel
