"""A movement under way, as seen by whoever asked for it."""

from threading import Lock
from typing import Any, ClassVar, Self

from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.operation import Operation


class Movement(Operation[float | None]):
    """The operation that one movement is; its result is the position reached, if it is known.

    Besides what `Operation.wait` raises: `MoveRefused` where the gate refused it or a stop ended it
    (`StoppedError`), `MoveCancelled` where it was cancelled or replaced by a newer command, and
    `DeviceError` where it failed at the hardware.
    """

    sent_kind: ClassVar[Any] = float | None
    _title = "the movement"
    _clock = WALL

    def __init__(self) -> None:
        # Not by the base class: one is made between a command and the call of the library.
        self._began_s = WALL.now_s()
        self._lock = Lock()
        self._ordered = False

    @classmethod
    @override
    def followed(cls, title: str) -> Self:
        return cls()

    def order(self) -> bool:
        """Note that a device takes its order now; False where one did before. Any thread."""
        with self._lock:
            before, self._ordered = self._ordered, True
        return not before

    @property
    def cancelled(self) -> bool:
        """True once `cancel` was called."""
        return self.cancel_requested
