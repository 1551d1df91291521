"""A serial port with an SCU at its other end that does everything at once, and can be troubled.

It knows the protocol from its description alone, and shares nothing with the driver or the twin.
"""

import re
from collections import deque

from cosmic.frame.errors import NotConnectedError

KINDS = {"L": 1, "R": 10, "N": 0}


class FakeScuSerial:
    """One unit and its port.

    Attributes
    ----------
    heard : list of str
        Every command, without colon and line feed.
    echo : bool
        The line sends back what it is sent.
    noise : bytes
        Comes before each answer.
    pieces : int
        So many bytes arrive with one read.
    deaf : set of str
        Commands, without channel, that get no answer.
    garbled : int
        So many of the next commands arrive spoilt.
    """

    def __init__(self, layout: str, serial: int) -> None:
        self.layout, self.serial = layout, serial
        self.heard: list[str] = []
        self.echo, self.noise, self.pieces, self.garbled = False, b"", 64, 0
        self.deaf: set[str] = set()
        self.answers: deque[bytes] = deque()
        self.position = dict.fromkeys(range(len(layout)), 0.0)
        self.status = dict.fromkeys(range(len(layout)), "S")
        self.known = dict.fromkeys(range(len(layout)), 0)
        self.reports: set[int] = set()
        self.automatic = False
        self.gone = self.taken = False
        self.inverted: set[int] = set()

    # The shape of serial.Serial

    @property
    def in_waiting(self) -> int:
        self._check()
        return sum(map(len, self.answers))

    def read(self, size: int = 1) -> bytes:
        self._check()
        waiting = b"".join(self.answers)
        count = min(size, self.pieces)
        self.answers = deque([waiting[count:]] if waiting[count:] else [])
        return waiting[:count]

    def write(self, data: bytes) -> int:
        self._check()
        if self.echo:
            self.answers.append(data)
        for text in data.decode().split("\n"):
            if text.startswith(":"):
                self._obey(text[1:])
        return len(data)

    def close(self) -> None:
        self.automatic = self.taken = False

    def _check(self) -> None:
        if self.gone:
            raise OSError("no such device")

    # The unit

    def say(self, text: str) -> None:
        self.answers.append(self.noise + f":{text}\n".encode())

    def _obey(self, text: str) -> None:
        self.heard.append(text)
        name = re.match("[A-Z]+", text).group()
        if name in self.deaf:
            return
        if self.garbled:
            self.garbled -= 1
            self.say("E1")
            return
        answer = self._answer(name, text[len(name) :])
        if answer is not None:
            self.say(answer)
        elif self.automatic:
            self.say("E0")

    def _answer(self, name: str, rest: str) -> str | None:
        general = {
            "I": "ISmarAct CU-3D",
            "GID": f"ID{self.serial}",
            "V": "V2.2.5",
        }
        if name in general:
            return general[name]
        if name == "E":
            self.automatic = rest == "1"
            return "E0"
        if name == "K":
            return None
        channel = int(rest[0])
        if channel >= len(self.layout):
            return "E3"
        return self._of_channel(name, channel, rest[1:])

    def _of_channel(self, name: str, channel: int, rest: str) -> str | None:
        kind = self.layout[channel]
        values = dict(re.findall(r"([A-Z])(-?[\d.]+|[UD])", rest))
        if name in ("GP", "GA", "MPA", "MPR", "MAA", "MAR", "MTR", "MES", "CS") and kind == "N":
            return "E19"
        if (name in ("GP", "MPA", "MPR") and kind == "R") or (
            name in ("GA", "MAA", "MAR") and kind == "L"
        ):
            return "E20"
        told = {
            "GSP": f"SP{channel}{'N' if kind == 'N' else 'P'}",
            "GST": f"ST{channel}T{KINDS[kind]}",
            "GP": f"P{channel}P{self.position[channel]:.1f}",
            "GA": f"A{channel}A{self.position[channel]:.1f}R0",
            "M": f"M{channel}{self.status[channel]}",
            "GPPK": f"PPK{channel}K{self.known[channel]}",
            "GSD": f"SD{channel}D0",
            "GSC": f"SC{channel}I{int(channel in self.inverted)}S-250000",
        }
        if name in told:
            return told[name]
        return self._do(name, channel, values)

    def _do(self, name: str, channel: int, values: dict[str, str]) -> str | None:
        if name == "SRC":
            self.reports.add(channel)
        if name == "S":
            self.status[channel] = "S"
        moved = {
            "MPA": lambda: float(values["P"]),
            "MPR": lambda: self.position[channel] + float(values["P"]),
            "MAA": lambda: float(values["A"]),
            "MAR": lambda: self.position[channel] + float(values["A"]),
            "MTR": lambda: 0.0,
            "MES": lambda: 6000.0 if values["D"] == "U" else -6000.0,
            "CS": lambda: self.position[channel],
            "U": lambda: self.position[channel] + float(values["S"]),
            "D": lambda: self.position[channel] - float(values["S"]),
        }
        if name not in moved:
            return None
        self.position[channel] = moved[name]()
        self.known[channel] = self.known[channel] or int(name == "MTR")
        self.status[channel] = "H" if int(values.get("H", "0")) else "S"
        if channel not in self.reports:
            return None
        self.say("E0")
        return f"C{channel}"


class FakeScuLines:
    """Ports "0" to "3" with units of the layout LLL,LLL,LLN,RNN."""

    def __init__(self) -> None:
        layouts = ("LLL", "LLL", "LLN", "RNN")
        self.units = [FakeScuSerial(each, 501 + index) for index, each in enumerate(layouts)]

    def open_port(self, name: str) -> FakeScuSerial:
        unit = self.units[int(name)]
        if unit.taken:
            raise NotConnectedError(f"serial port {name!r} is open already")
        unit.taken = True
        return unit
