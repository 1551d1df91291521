"""How a simulated device speaks in frames of seven bytes; shares no code with the driver's."""

from abc import abstractmethod
from typing import Final, Protocol

from typing_extensions import override

from cosmic.vico.hw.sim_line import Speaker

_LENGTH: Final = 7


class SimRegisters(Protocol):
    """What is behind the bytes of a simulated device."""

    @abstractmethod
    def get(self, number: int) -> int:
        """Return a register; 0 where there is none."""

    @abstractmethod
    def put(self, number: int, value: int) -> None:
        """Write a register, where that has a meaning."""


class FrameSpeaker(Speaker):
    """Hears frames in a stream of bytes, passes over what is none, and answers each."""

    def __init__(self, registers: SimRegisters) -> None:
        self._registers = registers
        self._heard = bytearray()

    @override
    def hear(self, data: bytes) -> bytes:
        self._heard += data
        said = bytearray()
        while len(self._heard) >= _LENGTH:
            if self._heard[0] == 0xFF and sum(self._heard[:_LENGTH]) & 0xFF == 0:
                said += self._answer(bytes(self._heard[1:6]))
                del self._heard[:_LENGTH]
            else:
                del self._heard[0]
        return bytes(said)

    def _answer(self, body: bytes) -> bytes:
        number = body[0] & 0x7F
        if body[0] & 0x80:
            value = int.from_bytes(body[1:], "little", signed=True)
            self._registers.put(number, value)
        else:
            value = self._registers.get(number)
        out = bytearray((0xFF, number))
        out += value.to_bytes(4, "little", signed=True)
        out.append((0x100 - sum(out) & 0xFF) & 0xFF)
        return bytes(out)
