"""Faults of the simulated boards, injected by name."""

from threading import Condition
from typing import Final

from cosmic.frame.arguments import check_fault

NAMES: Final = ("unplugged", "reserved", "stalled", "overrun", "no_driver")
_ONCE: Final = ("overrun",)


class BoardFaults:
    """Faults in force; any thread.

    Notes
    -----
    - `unplugged`: the board is gone; what runs ends with an error, and nothing can be opened or
      started until it is cleared.
    - `reserved`: another program has the board; configuring and starting fail.
    - `stalled`: no samples come, and no error either, until it is cleared; what the board took
      meanwhile comes then.
    - `overrun`: the next chunk is lost; happens once.
    - `no_driver`: the driver is not installed; for the whole library.
    """

    def __init__(self) -> None:
        self.changed = Condition()
        """Notified when a fault comes or goes, and when a board is stopped."""
        self._active: tuple[tuple[str, str | None], ...] = ()

    @property
    def active(self) -> tuple[tuple[str, str | None], ...]:
        """Name and board (None for all) of each fault in force."""
        return self._active

    def inject(self, name: str, *, board: str | None = None) -> None:
        """Put the fault `name` in force at one board, or at all; raises `ArgumentError`."""
        check_fault(name, NAMES)
        with self.changed:
            self._active = (*self._active, (name, board))
            self.changed.notify_all()

    def clear(self, name: str | None = None, *, board: str | None = None) -> None:
        """End the fault `name`, or all; with a board only what was injected there."""
        if name is not None:
            check_fault(name, NAMES)
        with self.changed:
            self._active = tuple(
                (what, where)
                for what, where in self._active
                if not (name in (None, what) and board in (None, where))
            )
            self.changed.notify_all()

    def hit(self, name: str, board: str) -> bool:
        """Whether the fault `name` is in force at `board`; one that happens once ends here."""
        for fault in self._active:
            if fault[0] == name and fault[1] in (None, board):
                if name in _ONCE:
                    with self.changed:
                        self._active = tuple(each for each in self._active if each is not fault)
                return True
        return False
