"""Asks a GigE Vision camera whether it is there and still ours.

Aravis itself notices a camera that is gone only after some six seconds. Any program may read
registers of a camera; this reads the one that says who controls it (GigE Vision, GVCP).
"""

import select
import socket
import struct
from typing import Final

from cosmic.frame.clock import WALL

_PORT: Final = 3956
_COMMAND: Final = struct.Struct(">BBHHHI")
_ACKNOWLEDGE: Final = struct.Struct(">HHHHI")
_KEY, _ACKNOWLEDGE_REQUIRED = 0x42, 0x01
_READ_REGISTER, _READ_REGISTER_ACKNOWLEDGE = 0x0080, 0x0081
_CONTROL_CHANNEL_PRIVILEGE: Final = 0x0A00
_EXCLUSIVE_OR_CONTROL: Final = 0x3

QUIET_S: Final = 0.4
_ANSWER_S: Final = 0.25
_TRIES: Final = 3


def ask_camera(address: str) -> str:
    """Return why a camera that this program controls is lost, or "" if it is not.

    Takes up to 0.75 s where it is; Aravis takes five seconds a call to find out.
    """
    watch = GvcpWatch(address, WALL.now_s())
    try:
        return watch.ask()
    finally:
        watch.close()


def controlled(address: str) -> bool | None:
    """Return whether any program controls the camera at an address; None: it does not answer."""
    watch = GvcpWatch(address, WALL.now_s())
    try:
        watch.ask()
        return watch.controlled
    finally:
        watch.close()


class GvcpWatch:
    """Finds out within 1.3 s of silence that a camera is gone; one thread.

    Parameters
    ----------
    address : str
        IP address of the camera.
    now_s : float
        Wall time of the last sign of life.

    Attributes
    ----------
    controlled : bool or None
        Whether any program controls it; None before it said so.
    """

    def __init__(self, address: str, now_s: float, *, port: int = _PORT) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._peer = (address, port)
        self._alive_s = now_s
        self._asked_s: float | None = None
        self._tries = 0
        self._request = 0
        self.controlled: bool | None = None

    def alive(self, now_s: float) -> None:
        """Note a sign of life."""
        self._alive_s, self._asked_s, self._tries = now_s, None, 0

    def ask(self) -> str:
        """Return why the camera is lost, or "" if it is not; waits for its answer."""
        self._ask(WALL.now_s())
        while True:
            select.select([self._socket], [], [], _ANSWER_S / 10.0)
            reason = self.poll(WALL.now_s())
            if reason or self._asked_s is None:
                return reason

    def poll(self, now_s: float) -> str:
        """Return why the camera is lost, or "" if it is not or not known yet; never waits."""
        if self._asked_s is not None:
            reason = self._read(now_s)
            if reason:
                return reason
        if self._asked_s is None:
            if now_s - self._alive_s >= QUIET_S:
                self._ask(now_s)
            return ""
        if now_s - self._asked_s < _ANSWER_S:
            return ""
        if self._tries >= _TRIES:
            return f"it no longer answers at {self._peer[0]} any more"
        self._ask(now_s)
        return ""

    def close(self) -> None:
        """Give the socket back."""
        self._socket.close()

    def _ask(self, now_s: float) -> None:
        self._request = self._request % 0xFFFF + 1
        self._tries += 1
        self._asked_s = now_s
        message = _COMMAND.pack(
            _KEY,
            _ACKNOWLEDGE_REQUIRED,
            _READ_REGISTER,
            4,
            self._request,
            _CONTROL_CHANNEL_PRIVILEGE,
        )
        try:
            self._socket.sendto(message, self._peer)
        except OSError:
            return  # the network itself is down: no answer will come, and that counts

    def _read(self, now_s: float) -> str:
        while True:
            try:
                answer, _ = self._socket.recvfrom(1024)
            except OSError:  # nothing there yet
                return ""
            if len(answer) < 8:
                continue
            status, kind, _, request = struct.unpack_from(">HHHH", answer)
            if request != self._request or kind != _READ_REGISTER_ACKNOWLEDGE:
                continue
            self.alive(now_s)
            self.controlled = True  # it hides the register from all but who controls it
            if status == 0 and len(answer) >= _ACKNOWLEDGE.size:
                privilege = _ACKNOWLEDGE.unpack_from(answer)[4]
                self.controlled = bool(privilege & _EXCLUSIVE_OR_CONTROL)
                if not self.controlled:
                    return "it was restarted and dropped this connection"
            return ""
