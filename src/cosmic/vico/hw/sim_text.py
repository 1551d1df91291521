"""How a simulated controller of the second generation speaks: lines of text, echo and prompt."""

from typing import Final

from typing_extensions import override

from cosmic.vico.hw.sim_frames import SimRegisters
from cosmic.vico.hw.sim_line import Speaker

_PROMPT: Final = "\r\n$ "


class TextSpeaker(Speaker):
    """Hears commands that end with a carriage return; Ctrl-C forgets one that was begun."""

    def __init__(self, registers: SimRegisters) -> None:
        self._registers = registers
        self._heard = ""

    @override
    def hear(self, data: bytes) -> bytes:
        said = ""
        for byte in data:
            if byte == 3:
                self._heard = ""
                said += _PROMPT
            elif byte in (10, 13):
                said += self._heard + self._obey(self._heard.split()) + _PROMPT
                self._heard = ""
            else:
                self._heard += chr(byte)
        return said.encode("latin-1")

    def _obey(self, words: list[str]) -> str:
        try:
            match words:
                case []:
                    return ""
                case ["read", number]:
                    return f"\r\n{self._registers.get(int(number))}"
                case ["write", number, value]:
                    self._registers.put(int(number), int(value))
                    return ""
                case ["stopall"]:
                    self._registers.put(0x13, 2)
                    self._registers.put(0x23, 2)
                    return ""
                case ["savesetup" | "defaultsetup"]:
                    return ""
        except ValueError:
            return "\r\nbad number"
        return "\r\nunknown command"
