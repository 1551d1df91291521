"""Registers of Navitar's second generation, in lines of text."""

import re
from typing import Final

from typing_extensions import override

from cosmic.frame.errors import DeviceFault, DeviceTimeout, ProtocolError
from cosmic.vico.hw.navitar_registers import TRIES, Registers
from cosmic.vico.hw.serial_port import MOST_BYTES, Deadline, SerialPort

INTERRUPT: Final = b"\x03"
"""Ctrl-C: ends whatever was begun, and brings the prompt."""

PROMPT: Final = b"$ "
_VALUE: Final = re.compile(r"[-+]?(0[xX][0-9a-fA-F]{1,8}|\d{1,10})")


class AsciiRegisters(Registers):
    """Asks in text; an answer counts only when the echo shows that the question came over whole.

    A value is asked for twice, and a third time when the two differ.

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
        self._in_step = False

    @property
    @override
    def name(self) -> str:
        return self._port.name

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

    @override
    def close(self) -> None:
        self._port.close()

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
        asked = f"{self.name}: asked {command!r} {self._tries} times"
        if not received:
            raise DeviceTimeout(
                f"{asked}, no answer came; is the controller switched on, and is it this port?",
                fault=DeviceFault.TIMEOUT,
            )
        raise ProtocolError(f"{asked}, received {received[-64:].hex(' ')}, which is no answer")

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
