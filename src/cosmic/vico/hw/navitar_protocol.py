"""Frames of seven bytes that Navitar's first generation and BrightLight speak; pure functions.

``FF, register (+ 80h to write), value as int32 little-endian, checksum``: all seven bytes add up
to a multiple of 256. The answer has the same form with bit 7 of the register clear, after a
write as well.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from cosmic.frame.errors import ProtocolError

START: Final = 0xFF
WRITE: Final = 0x80
FRAME_BYTES: Final = 7


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
        raise ProtocolError(f"the lens tells a status that is not known: {value:#x}")
    return MotorStatus(bool(phase), at_home=bool(value & 0x100), at_limit=bool(value & 0x200))


def _frame(head: int, value: int) -> bytes:
    body = struct.pack("<BBi", START, head, value)
    return body + bytes([-sum(body) % 256])
