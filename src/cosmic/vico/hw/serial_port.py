"""Serial lines: through pyserial, or an object in this process that has its shape."""

import logging
from abc import abstractmethod
from typing import Final, Protocol

from cosmic.frame.clock import WALL
from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError

logger = logging.getLogger(__name__)

BAUD: Final = 38400
READ_TIMEOUT_S: Final = 0.2
WRITE_TIMEOUT_S: Final = 0.5
MOST_BYTES: Final = 4096
"""More than any answer is long; a line that never falls silent is cut off here."""


class SerialLike(Protocol):
    """What is used of `serial.Serial`; an object in this process may stand in for it.

    Failures are `OSError`, which `serial.SerialException` is. A `read` that returns fewer bytes
    than asked for has waited for the time-out, or knows that nothing more comes.
    """

    @property
    @abstractmethod
    def in_waiting(self) -> int:
        """Bytes that have arrived."""

    @abstractmethod
    def read(self, size: int = 1) -> bytes:
        """Return up to `size` bytes."""

    @abstractmethod
    def write(self, data: bytes, /) -> int | None:
        """Send."""

    @abstractmethod
    def close(self) -> None:
        """Give the port back."""


class SerialPort:
    """An open line; one thread at a time.

    Parameters
    ----------
    name : str
        What errors call it.
    """

    def __init__(self, serial_object: SerialLike, name: str) -> None:
        self.name = name
        self._serial: SerialLike | None = serial_object

    def send(self, data: bytes) -> None:
        """Send, after throwing away what has arrived unasked.

        Raises
        ------
        DeviceError
            The port is gone.
        """
        serial_object = self._open()
        try:
            waiting = min(serial_object.in_waiting, MOST_BYTES)
            if waiting:
                stale = serial_object.read(waiting)
                logger.debug("%s: threw away %s", self.name, stale.hex(" "))
            logger.debug("%s: sent %s", self.name, data.hex(" "))
            serial_object.write(data)
        except OSError as exc:
            raise self._gone(exc) from exc

    def read(self, size: int) -> bytes:
        """Return up to `size` bytes; fewer when no more came in time.

        Raises
        ------
        DeviceError
            The port is gone.
        """
        try:
            return self._open().read(size)
        except OSError as exc:
            raise self._gone(exc) from exc

    def close(self) -> None:
        """Give the port back; harmless the second time."""
        serial_object, self._serial = self._serial, None
        if serial_object is not None:
            try:
                serial_object.close()
            except OSError as exc:
                logger.debug("%s: closing: %s", self.name, exc)

    def _open(self) -> SerialLike:
        if self._serial is None:
            raise DeviceError(f"{self.name} was closed; open it again", fault=DeviceFault.STATE)
        return self._serial

    def _gone(self, error: OSError) -> DeviceError:
        return DeviceError(
            f"{self.name}: the line is lost ({error}); check cable and adapter, then reconnect",
            fault=DeviceFault.COMMUNICATION,
        )


class Deadline:
    """Bounds how long one answer is waited for, on the wall clock."""

    def __init__(self, duration_s: float = READ_TIMEOUT_S) -> None:
        self._end_s = WALL.now_s() + duration_s

    @property
    def passed(self) -> bool:
        """The time is over."""
        return WALL.now_s() >= self._end_s


def open_serial_port(name: str) -> SerialPort:
    """Open a port of this computer, such as "/dev/ttyUSB0" or "COM3", for this program alone.

    Raises
    ------
    NotConnectedError
        There is none of that name, it is taken, or it may not be opened; the text says which
        there are.
    """
    # Imported here, so that a platform without serial lines does not load it.
    import serial

    try:
        port = serial.Serial(
            name,
            BAUD,
            timeout=READ_TIMEOUT_S,
            write_timeout=WRITE_TIMEOUT_S,
            exclusive=True,
        )
    except (OSError, ValueError) as exc:  # ValueError: a name that pyserial cannot read
        there = ", ".join(list_ports()) or "none"
        raise NotConnectedError(
            f"serial port {name!r} cannot be opened ({exc}); another program may use it, or the "
            f"right to use it is missing. Ports there are: {there}",
            fault=DeviceFault.COMMUNICATION,
        ) from exc
    return SerialPort(port, name)


def list_ports() -> tuple[str, ...]:
    """Return the names of the serial ports of this computer."""
    from serial.tools.list_ports import comports

    return tuple(sorted(str(each.device) for each in comports()))
