"""Movements that are ordered again: without an answer of the gate, stuck, or with an obstacle."""

import logging
from collections.abc import Callable, Iterable
from typing import Final, Protocol

from typing_extensions import override

from cosmic.autonomy.procedures.operation import Awaited
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, DeviceError, DeviceFault, DeviceTimeout, MoveRefused
from cosmic.frame.verdict import Reason
from cosmic.mico.api.mico import Mico

logger = logging.getLogger(__name__)

TRIES: Final = 5
UNANSWERED: Final = 20
"""Orders that the gate may leave without an answer: on a busy machine it takes long to restart."""
BUMPS: Final = 3
"""How often an axis may run into something, and go back from it, on one way."""
APART_WALL_S: Final = 0.5
BUMP_WALL_S: Final = 1.0
BACK_UM: Final = 50.0
BACK_DEG: Final = 0.5
"""How far an axis goes back from what it ran into."""
POLL_WALL_S: Final = 0.002


class Movement(Awaited, Protocol):
    """A movement, of one axis or of several."""

    @override
    def wait(self, timeout_s: float | None = None) -> object: ...

    def exception(self, timeout: float | None = 0.0) -> Exception | None:
        """Return what ended it."""
        ...


class RetryingMove:
    """A movement; refused without an answer it has not begun, and is ordered again.

    The gate answers late on a busy machine, and not at all while it is being restarted. Every
    other refusal ends it, as does a stop.

    Parameters
    ----------
    order : callable
        Orders the movement and returns it.
    to_a_position : bool
        It leads to a position, whatever it begins from: an axis that has not come on is ordered
        again as well.
    back : callable or None
        Orders a little of the way back, or returns None. Where an axis runs into something, as it
        does at the end of its travel, this is done, and some times the way is tried again.

    Raises
    ------
    MoveRefused
        The gate answered, and said no.
    """

    def __init__(
        self,
        order: Callable[[], Movement],
        *,
        to_a_position: bool = False,
        back: Callable[[], Movement | None] | None = None,
    ) -> None:
        self._order = order
        self._to_a_position = to_a_position
        self._back = back
        self._backing: Movement | None = None
        self._left, self._unanswered, self._bumps = TRIES - 1, UNANSWERED - 1, BUMPS
        self._again_wall_s = 0.0
        self._movement: Movement | None = None
        self._refusal: CosmicError | None = None
        self._cancelled = False
        self._callbacks: list[Callable[[RetryingMove], object]] = []
        self._begin()

    def add_callback(self, callback: Callable[["RetryingMove"], object]) -> None:
        """Call `callback(self)` whenever it may have ended, in the thread that ends a movement."""
        self._callbacks.append(callback)
        self._hear()

    def _hear(self) -> None:
        """Hear of the end of the movement ordered last, where it can tell of that."""
        add_callback = getattr(self._movement, "add_callback", None)
        if add_callback is not None:
            add_callback(self._on_end)

    def _on_end(self, _movement: object) -> None:
        for each in tuple(self._callbacks):
            each(self)

    def _begin(self) -> None:
        try:
            self._movement = self._order()
            if self._callbacks:
                self._hear()
        except MoveRefused as refusal:
            if refusal.verdict.reason is not Reason.NO_ANSWER or self._unanswered <= 0:
                raise
            self._unanswered -= 1
            self._later(refusal, APART_WALL_S)

    def _later(self, trouble: CosmicError, apart_wall_s: float) -> None:
        self._movement, self._refusal = None, trouble
        self._again_wall_s = WALL.now_s() + apart_wall_s

    @property
    def done(self) -> bool:
        """It has ended, well or not."""
        if self._cancelled:
            return all(each is None or each.done for each in (self._movement, self._backing))
        if self._backing is not None and not self._backing.done:
            return False
        if self._movement is None and WALL.now_s() >= self._again_wall_s:
            self._backing = None
            try:
                self._begin()
            except MoveRefused as refusal:
                self._refusal, self._cancelled = refusal, True
                return True
        return self._movement is not None and self._movement.done and not self._goes_on()

    def _goes_on(self) -> bool:
        """Return whether what ended the movement is no reason to end; it is ordered again then."""
        error = None if self._movement is None else self._movement.exception()
        if not self._to_a_position or not isinstance(error, DeviceError):
            return False
        if isinstance(error, DeviceTimeout) and self._left > 0:
            self._left -= 1
            self._later(error, APART_WALL_S)
            return True
        if error.fault is DeviceFault.END_STOP and self._back is not None and self._bumps > 0:
            self._bumps -= 1
            self._back_away(error)
            return True
        return False

    def _back_away(self, error: DeviceError) -> None:
        logger.warning("%s; the axis retracts a little and tries again", error)
        self._later(error, BUMP_WALL_S)
        try:
            self._backing = self._back() if self._back is not None else None
        except CosmicError as exc:
            logger.warning("the axis cannot retract: %s", exc)

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
        for each in (self._movement, self._backing):
            if each is not None:
                each.cancel()


def return_movement(mico: Mico, names: Iterable[str]) -> Callable[[], Movement | None]:
    """Return what orders a little of the way back to where these axes stand now."""
    began = {name: _position(mico, name) for name in names}

    def order() -> Movement | None:
        targets = {}
        for name, start in began.items():
            now = _position(mico, name)
            if start is not None and now is not None:
                most = BACK_DEG if mico[name].unit == "deg" else BACK_UM
                targets[name] = now + min(max(start - now, -most), most)
        return mico.move(targets, wait=False) if targets else None

    return order


def _position(mico: Mico, name: str) -> float | None:
    axis = mico[name]
    return axis.angle_deg if axis.unit == "deg" else axis.position_um
