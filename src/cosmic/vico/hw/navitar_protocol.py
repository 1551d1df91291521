"""How Navitar's controllers and BrightLight speak: numbered registers behind a serial line.

The first generation, and BrightLight, speak in frames of seven bytes: ``FF, register (+ 80h to
write), value as int32 little-endian, checksum``; all seven add up to a multiple of 256. The answer
has the same form with bit 7 of the register clear, after a write as well. The second generation
has the same registers and speaks in lines of text: ``read 16``, ``write 16 1000``, an echo, the
value, a prompt.
"""

import logging
import re
import struct
from abc import abstractmethod
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, Protocol

from typing_extensions import override

from cosmic.frame.errors import (
    ConfigError,
    CosmicError,
    DeviceFault,
    DeviceTimeout,
    NotConnectedError,
    ProtocolError,
)
from cosmic.vico.hw.serial_port import MOST_BYTES, Deadline, SerialPort, open_serial_port

logger = logging.getLogger(__name__)

START: Final = 0xFF
WRITE: Final = 0x80
FRAME_BYTES: Final = 7
TRIES: Final = 3
"""So often is a question asked before the line is given up."""

INTERRUPT: Final = b"\x03"
"""Ctrl-C: ends whatever was begun, and brings the prompt."""

SHOWN_BYTES: Final = 64
"""Of what came instead of an answer."""
PROMPT: Final = b"$ "
_VALUE: Final = re.compile(r"[-+]?(0[xX][0-9a-fA-F]{1,8}|\d{1,10})")


class Register(IntEnum):
    """Registers; those of a motor are of axis 1, `SECOND_AXIS` further on are those of axis 2."""

    PRODUCT = 0x01
    HARDWARE = 0x02
    FIRMWARE_DATE = 0x03
    FIRMWARE = 0x04
    TARGET = 0x10
    POSITION = 0x12
    COMMAND = 0x13
    STATUS = 0x14
    CONFIGURATION = 0x1B
    LIMIT = 0x1C
    BRIGHTNESS = 0x40


SECOND_AXIS: Final = 0x10


class Product(IntEnum):
    """What `Register.PRODUCT` answers."""

    BRIGHTLIGHT = 0x4000
    MOTORS = 0x4001
    MOTORS_2 = 0x5001


class MotorCommand(IntEnum):
    """What is written to `Register.COMMAND`."""

    HOME = 0
    LIMIT = 1
    ABORT = 2


@dataclass(frozen=True, slots=True)
class MotorStatus:
    """`Register.STATUS` taken apart."""

    moving: bool
    at_home: bool
    at_limit: bool


def read_frame(register: int) -> bytes:
    """Return the frame that asks for a register."""
    return _frame(register, 0)


def write_frame(register: int, value: int) -> bytes:
    """Return the frame that writes a register."""
    return _frame(register | WRITE, value)


def find_answer(received: bytes, register: int) -> int | None:
    """Return the value of the first whole answer about `register`, or None.

    Bytes that belong to no such answer, noise or a broken frame, are passed over.
    """
    start = received.find(START)
    while 0 <= start <= len(received) - FRAME_BYTES:
        frame = received[start : start + FRAME_BYTES]
        if frame[1] == register and sum(frame) % 256 == 0:
            return int(struct.unpack_from("<i", frame, 2)[0])
        start = received.find(START, start + 1)
    return None


def motor_status(value: int) -> MotorStatus:
    """Take the status of a motor apart.

    Raises
    ------
    ProtocolError
        A status that is not in the table.
    """
    phase = value & 0xFF
    if phase not in {*range(10), 11, 12}:
        raise ProtocolError(f"the lens reports an unknown status: {value:#x}")
    return MotorStatus(bool(phase), at_home=bool(value & 0x100), at_limit=bool(value & 0x200))


def _frame(head: int, value: int) -> bytes:
    body = struct.pack("<BBi", START, head, value)
    return body + bytes([-sum(body) % 256])


class Registers(Protocol):
    """A controller as numbered registers, whatever its bytes; one thread at a time.

    Every call is one exchange, repeated at most `TRIES` times. All raise `ProtocolError` for
    answers that make no sense, `DeviceTimeout` for none, and `DeviceError` when the port is gone.
    """

    @property
    @abstractmethod
    def name(self) -> str:
        """The line, for texts."""

    @abstractmethod
    def read(self, register: int) -> int:
        """Return the value of a register, signed."""

    @abstractmethod
    def write(self, register: int, value: int) -> None:
        """Write a register."""

    @abstractmethod
    def close(self) -> None:
        """Give the line back; harmless the second time."""


class _SerialRegisters(Registers):
    """Registers behind a serial line.

    Parameters
    ----------
    port : SerialPort
        Closed with this object.
    tries : int
        How often a question is asked before it fails.
    """

    def __init__(self, port: SerialPort, *, tries: int = TRIES) -> None:
        self._port = port
        self._tries = tries

    @property
    @override
    def name(self) -> str:
        return self._port.name

    @override
    def close(self) -> None:
        self._port.close()

    def _unanswered(self, question: str, received: bytes) -> CosmicError:
        """Return why a question that was asked so often has no answer."""
        asked = f"{self.name}: asked {question} {self._tries} times"
        if not received:
            return DeviceTimeout(
                f"{asked}, no answer came; is the controller switched on, and is it this port?",
                fault=DeviceFault.TIMEOUT,
            )
        shown = received[-SHOWN_BYTES:].hex(" ")
        return ProtocolError(f"{asked}, received {shown}, which is not an answer")


class FrameRegisters(_SerialRegisters):
    """Asks in frames, and finds the answer among noise."""

    @override
    def read(self, register: int) -> int:
        return self._ask(read_frame(register), register)

    @override
    def write(self, register: int, value: int) -> None:
        self._ask(write_frame(register, value), register)

    def _ask(self, question: bytes, register: int) -> int:
        received = b""
        for _ in range(self._tries):
            self._port.send(question)
            heard, value = self._listen(register)
            if value is not None:
                return value
            received += heard
        raise self._unanswered(question.hex(" "), received)

    def _listen(self, register: int) -> tuple[bytes, int | None]:
        """Return what was received, and the answer in it."""
        received = self._port.read(FRAME_BYTES)
        value = find_answer(received, register)
        if value is not None or len(received) < FRAME_BYTES:
            return received, value  # fewer: the time-out is over
        # Noise came in front: the rest of the answer is still under way.
        deadline = Deadline()
        while value is None and len(received) < MOST_BYTES and not deadline.passed:
            more = self._port.read(1)
            if not more:
                break
            received += more
            value = find_answer(received, register)
        return received, value


class AsciiRegisters(_SerialRegisters):
    """Asks in text; an answer counts only when the echo shows that the question came over whole.

    A value is asked for twice, and a third time when the two differ.
    """

    def __init__(self, port: SerialPort, *, tries: int = TRIES) -> None:
        super().__init__(port, tries=tries)
        self._in_step = False

    @override
    def read(self, register: int) -> int:
        # Answers carry no checksum: a number that lost a digit is a number still. Of two that
        # agree, or of three the middle one, at least one is right even while a motor moves.
        first, second = self._value(register), self._value(register)
        if first == second:
            return first
        return sorted((first, second, self._value(register)))[1]

    @override
    def write(self, register: int, value: int) -> None:
        self._ask(f"write {register} {value}", wants_value=False)

    def _value(self, register: int) -> int:
        return self._ask(f"read {register}", wants_value=True)

    def _ask(self, command: str, *, wants_value: bool) -> int:
        received = b""
        for _ in range(self._tries):
            if not self._in_step and not self._interrupt():
                continue
            self._port.send(f"{command}\r".encode("ascii"))
            heard = self._listen()
            value = _answer(heard, command, wants_value=wants_value)
            self._in_step = value is not None
            if value is not None:
                return value
            received += heard
        raise self._unanswered(repr(command), received)

    def _interrupt(self) -> bool:
        """Bring the prompt; False when nobody is there."""
        self._port.send(INTERRUPT)
        return bool(self._listen())

    def _listen(self) -> bytes:
        """Return what is received up to the prompt."""
        received = b""
        deadline = Deadline()
        while not received.endswith(PROMPT) and len(received) < MOST_BYTES and not deadline.passed:
            byte = self._port.read(1)
            if not byte:
                break
            received += byte
        return received


def _answer(received: bytes, command: str, *, wants_value: bool) -> int | None:
    """Return the value that answers `command` (0 where none is wanted), or None."""
    if not received.endswith(PROMPT):
        return None
    text = received[: -len(PROMPT)].decode("ascii", "replace")
    lines = [line.strip() for line in re.split(r"[\r\n]+", text) if line.strip()]
    # Noise may stand in front of the echo; had the controller heard it, it would complain.
    echoes = [number for number, line in enumerate(lines) if line.endswith(command)]
    if not echoes:
        return None
    said = lines[echoes[-1] + 1 :]
    if not said:
        return None if wants_value else 0
    # After a write some firmware says the value again; anything but a number is a complaint.
    if len(said) != 1 or not _VALUE.fullmatch(said[0]):
        return None
    value = int(said[0], 0)
    return value - 2**32 if value >= 2**31 else value


@dataclass(frozen=True, slots=True)
class Found:
    """What answered.

    Attributes
    ----------
    product : Product
        What it is.
    generation : int
        1 when it speaks in frames, 2 in text.
    """

    registers: Registers
    product: Product
    generation: int

    def expect(self, what: str, *products: Product) -> "Found":
        """Return it where it is one of `products`.

        Parameters
        ----------
        what : str
            What they are, such as "a lens controller".

        Raises
        ------
        NotConnectedError
            It is something else; the line is closed then.
        """
        if self.product in products:
            return self
        self.registers.close()
        raise NotConnectedError(
            f"{self.registers.name}: {what} was expected, a {self.product.name} answers "
            f"({self.product:#x}); are the ports of lens and light exchanged?",
            fault=DeviceFault.COMMUNICATION,
        )


def open_line(port: str, backend: str) -> Found:
    """Open a serial port and ask who is there.

    Raises
    ------
    ConfigError
        No port is named for `backend`.
    NotConnectedError, DeviceError
        As `open_serial_port` and `probe`.
    """
    if not port:
        raise ConfigError(f"backend {backend!r} needs a port, such as /dev/ttyUSB0 or COM3")
    return probe(open_serial_port(port))


def probe(port: SerialPort) -> Found:
    """Ask a line who is there, in frames, in text, and in frames again; nothing moves.

    Raises
    ------
    NotConnectedError
        Nobody answers, or something that is not known; the port is closed then.
    DeviceError
        The port is gone; it is closed then.
    """
    answers: list[str] = []
    dialects: tuple[tuple[int, Registers], ...] = (
        (1, FrameRegisters(port, tries=1)),
        (2, AsciiRegisters(port, tries=2)),
        (1, FrameRegisters(port, tries=2)),
    )
    try:
        for generation, registers in dialects:
            try:
                product = registers.read(Register.PRODUCT)
            except (DeviceTimeout, ProtocolError) as exc:
                answers.append(str(exc))
                continue
            if product in set(Product):
                logger.info("%s: product %#x, generation %d", port.name, product, generation)
                return _found(port, Product(product), generation)
            answers.append(f"product {product:#x}, which is not known")
        raise NotConnectedError(
            f"{port.name}: neither a Navitar controller nor a BrightLight answers: "
            f"{'; '.join(answers)}",
            fault=DeviceFault.COMMUNICATION,
        )
    except BaseException:
        port.close()
        raise


def _found(port: SerialPort, product: Product, generation: int) -> Found:
    registers = FrameRegisters(port) if generation == 1 else AsciiRegisters(port)
    return Found(registers, product, generation)
