"""Movements that are ordered again where the gate had no answer, or the axis did not come on."""

from collections.abc import Callable
from typing import Final, Protocol

from typing_extensions import override

from cosmic.autonomy.procedures.operation import Awaited
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, DeviceTimeout, MoveRefused
from cosmic.frame.verdict import Reason

TRIES: Final = 5
APART_WALL_S: Final = 0.5
POLL_WALL_S: Final = 0.002


class Moving(Awaited, Protocol):
    """A movement, of one axis or of several."""

    @override
    def wait(self, timeout_s: float | None = None) -> object: ...

    def exception(self, timeout: float | None = 0.0) -> Exception | None:
        """Return what ended it."""
        ...


class PatientMove:
    """A movement; refused without an answer it has not begun, and is ordered again.

    The gate answers late on a busy machine, and not at all while it is being restarted. Every
    other refusal ends it, as does a stop.

    Parameters
    ----------
    order : callable
        Orders the movement and returns it.
    to_a_place : bool
        It leads to a place, whatever it begins from: where an axis has not come on, it is ordered
        again as well.

    Raises
    ------
    MoveRefused
        The gate answered, and said no.
    """

    def __init__(self, order: Callable[[], Moving], *, to_a_place: bool = False) -> None:
        self._order = order
        self._to_a_place = to_a_place
        self._left = TRIES
        self._again_wall_s = 0.0
        self._movement: Moving | None = None
        self._refusal: CosmicError | None = None
        self._cancelled = False
        self._begin()

    def _begin(self) -> None:
        self._left -= 1
        try:
            self._movement = self._order()
        except MoveRefused as refusal:
            self._refused(refusal)

    def _refused(self, refusal: MoveRefused) -> None:
        if refusal.verdict.reason is not Reason.NO_ANSWER or self._left <= 0:
            raise refusal
        self._movement, self._refusal = None, refusal
        self._again_wall_s = WALL.now_s() + APART_WALL_S

    @property
    def done(self) -> bool:
        """It has ended, well or not."""
        if self._cancelled:
            return self._movement is None or self._movement.done
        if self._movement is None and WALL.now_s() >= self._again_wall_s:
            try:
                self._begin()
            except MoveRefused as refusal:
                self._refusal, self._cancelled = refusal, True
                return True
        return self._movement is not None and self._movement.done and not self._stuck()

    def _stuck(self) -> bool:
        """Return whether an axis did not come on, and have it ordered again."""
        if not self._to_a_place or self._left <= 0 or self._movement is None:
            return False
        error = self._movement.exception()
        if not isinstance(error, DeviceTimeout):
            return False
        self._refusal = error
        self._movement, self._again_wall_s = None, WALL.now_s() + APART_WALL_S
        return True

    def wait(self, timeout_s: float | None = None) -> object:
        """Wait for the end, and return what the movement returns; raises what ended it."""
        until_wall_s = WALL.now_s() + (1e9 if timeout_s is None else timeout_s)
        while not self.done:
            left_s = until_wall_s - WALL.now_s()
            if left_s <= 0.0:
                raise DeviceTimeout("the movement has not ended yet")
            WALL.sleep(min(left_s, POLL_WALL_S))
        if self._movement is None:
            assert self._refusal is not None
            raise self._refusal
        return self._movement.wait(0.0)

    def cancel(self) -> None:
        """End it; what it has set in motion stops."""
        self._cancelled = True
        if self._movement is not None:
            self._movement.cancel()
