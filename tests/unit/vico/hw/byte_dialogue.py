"""A serial line that expects the very bytes of a script, and answers with those it has."""

from collections.abc import Sequence

from cosmic.vico.hw.serial_port import SerialPort


class ScriptedSerial:
    """Shape of `serial.Serial`; each write must be the next question of the script."""

    def __init__(self, script: Sequence[tuple[bytes, bytes]]) -> None:
        self._script = list(script)
        self._arrived = b""
        self.closed = False

    @property
    def in_waiting(self) -> int:
        return len(self._arrived)

    def read(self, size: int = 1) -> bytes:
        data, self._arrived = self._arrived[:size], self._arrived[size:]
        return data

    def write(self, data: bytes, /) -> int:
        assert self._script, f"nothing more was expected, but {data.hex(' ')} came"
        question, answer = self._script.pop(0)
        assert data.hex(" ") == question.hex(" ")
        self._arrived += answer
        return len(data)

    def say(self, data: bytes) -> None:
        """Have bytes arrive that nobody asked for."""
        self._arrived += data

    def close(self) -> None:
        self.closed = True

    def finish(self) -> None:
        """Everything expected has come."""
        assert not self._script, f"never asked: {[each[0].hex(' ') for each in self._script]}"


def port(*script: tuple[bytes, bytes]) -> tuple[ScriptedSerial, SerialPort]:
    """Return a line with a script, and the port to give to a driver."""
    line = ScriptedSerial(script)
    return line, SerialPort(line, "COM7")


def hexed(text: str) -> bytes:
    """Return the bytes of "FF 01 ..."."""
    return bytes.fromhex(text)
