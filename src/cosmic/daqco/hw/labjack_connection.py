"""The one handle by which a LabJack board is reached, for its inputs and its outputs."""

from threading import RLock
from typing import Any

from cosmic.daqco.hw.labjack_errors import board_error


class Connection:
    """A board's handle: opened when it is first needed, closed when nobody needs it; any thread.

    LJM gives a process the same handle however often a board is opened, so that closing it once
    would close it for all.

    Parameters
    ----------
    api : module
        ``labjack.ljm``.
    kind : str
        "T4", "T7" or "T8".
    bus : str
        "ANY", "USB", "ETHERNET" or "WIFI".
    """

    def __init__(self, api: Any, board: str, kind: str, serial: int, bus: str) -> None:
        self._api = api
        self._board = board
        self._where = (kind, bus, str(serial))
        self._lock = RLock()
        self._users: set[object] = set()
        self._handle: int | None = None

    def take(self, user: object) -> int:
        """Return the handle, and keep it open for `user`; raises what LJM says."""
        with self._lock:
            if self._handle is None:
                try:
                    self._handle = int(self._api.openS(*self._where))
                except self._api.LJMError as exc:
                    raise board_error(exc, "open", self._board) from exc
            self._users.add(user)
            return self._handle

    def leave(self, user: object) -> None:
        """Close the handle when `user` was the last; harmless the second time."""
        with self._lock:
            self._users.discard(user)
            if not self._users:
                self._close()

    def renew(self) -> None:
        """Forget the handle after a failure; whoever takes it next opens the board anew."""
        with self._lock:
            self._close()

    def _close(self) -> None:
        handle, self._handle = self._handle, None
        if handle is None:
            return
        try:
            self._api.close(handle)
        except self._api.LJMError:
            return  # a board that is gone has no handle to give back
