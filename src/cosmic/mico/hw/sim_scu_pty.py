"""Simulated SCUs where other programs find them: on pseudo terminals, or on real serial ports."""

import os
import select
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, Protocol

from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.errors import NotAvailable
from cosmic.mico.hw.scu_serial_unit import SerialLike
from cosmic.mico.hw.sim_scu_serial import SimulatedUnit

LOOK_S: Final = 0.002
"""How often it is looked for something to say."""
_MOST_BYTES: Final = 4096


class End(Protocol):
    """The unit's end of a line."""

    def take(self) -> bytes:
        """Return what has arrived; at once."""

    def give(self, data: bytes) -> None:
        """Send."""

    def close(self) -> None:
        """Give the line back."""


class PseudoTerminal(End):
    """A pseudo terminal, and a link to where programs open it; POSIX.

    Parameters
    ----------
    link : Path
        Made here and removed by `close`; nothing may be there yet but an older link.

    Raises
    ------
    NotAvailable
        There are no pseudo terminals on this system, or the link cannot be made.
    """

    _master: int
    _slave: int
    _link: Path

    def __init__(self, link: Path) -> None:
        if sys.platform == "win32":
            raise NotAvailable(
                "Windows has no pseudo terminals: join two ports with a null-modem driver such as "
                "com0com, and name one with --port (the other program opens the other)"
            )
        import tty

        if link.exists() and not link.is_symlink():
            raise NotAvailable(f"{link} is there already, and is not a link; name another")
        self._master, self._slave = os.openpty()
        # As a serial line: nothing is echoed, and no byte means anything. The near end stays open,
        # so that one program after the other can come.
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self._link = link
        try:
            link.unlink(missing_ok=True)
            link.symlink_to(os.ttyname(self._slave))
        except OSError as exc:
            os.close(self._master)
            os.close(self._slave)
            raise NotAvailable(f"{link} cannot be made: {exc}") from exc

    @override
    def take(self) -> bytes:
        ready, _, _ = select.select([self._master], [], [], LOOK_S)
        return os.read(self._master, _MOST_BYTES) if ready else b""

    @override
    def give(self, data: bytes) -> None:
        try:
            os.write(self._master, data)
        except BlockingIOError:
            return  # nobody reads; a line loses what nobody reads

    @override
    def close(self) -> None:
        self._link.unlink(missing_ok=True)
        os.close(self._master)
        os.close(self._slave)


class PortEnd(End):
    """A real port, with the other program at the other end of a null-modem cable."""

    def __init__(self, port: SerialLike) -> None:
        self._port = port

    @override
    def take(self) -> bytes:
        return self._port.read(max(1, self._port.in_waiting))

    @override
    def give(self, data: bytes) -> None:
        self._port.write(data)

    @override
    def close(self) -> None:
        self._port.close()


def serve(units: Sequence[SimulatedUnit], ends: Sequence[End], ended: Callable[[], bool]) -> None:
    """Have each unit listen and speak at its end of a line until `ended` says so."""
    pairs = list(zip(units, ends, strict=True))
    while not ended():
        for unit, end in pairs:
            heard = end.take()
            if heard and not unit.unplugged:
                unit.hear(heard)
            said = b"" if unit.unplugged else unit.say()
            if said:
                end.give(said)
        if not pairs:
            WALL.sleep(LOOK_S)
