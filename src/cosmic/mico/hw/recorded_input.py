"""An input device out of a file: what a hand did, in its own time, for tests and demonstrations."""

import csv
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import ConfigError, NotConnectedError
from cosmic.frame.kept_file import open_file
from cosmic.frame.plugins import NoOptions
from cosmic.mico.hw.input_device import (
    ALWAYS_REPORTS_S,
    InputBackend,
    InputDevice,
    InputInfo,
    InputKind,
    InputSource,
    InputState,
)

HEADER: Final = ("time_s", "what", "name", "value")
_LARGEST: Final = 1_000_000
What = Literal["axis", "button", "device"]


@dataclass(frozen=True, slots=True)
class InputEvent:
    """One line of a recording.

    Attributes
    ----------
    what : str
        "axis" with -1 to 1, "button" with 0 or 1, or "device": "frozen" reports nothing more,
        "unplugged" is gone.
    """

    time_s: float
    what: What
    name: str
    value: float = 0.0


def read_events(path: Path) -> tuple[InputEvent, ...]:
    """Read a recording: CSV with the columns time_s, what, name, value; "#" begins a comment.

    Raises
    ------
    ConfigError
        It cannot be read, or a line is not what it must be; the text names file and line.
    """
    try:
        with open_file(path) as file:
            text = file.read().decode("utf-8")
    except (OSError, UnicodeDecodeError) as exc:
        raise ConfigError(f"{path}: cannot be read: {exc}") from exc
    if "\0" in text:
        raise ConfigError(f"{path}: no text, it holds zero bytes")
    lines = [
        (number, line) for number, line in enumerate(text.splitlines(), 1) if _has_content(line)
    ]
    if len(lines) > _LARGEST:
        raise ConfigError(f"{path}: longer than {_LARGEST} lines")
    if not lines or tuple(_cells(lines[0][1])) != HEADER:
        raise ConfigError(f"{path}: the first line must be {','.join(HEADER)}")
    events: list[InputEvent] = []
    for number, line in lines[1:]:
        try:
            event = _event(_cells(line))
        except (ValueError, csv.Error) as exc:
            raise ConfigError(f"{path}:{number}: {exc}") from None
        if events and event.time_s < events[-1].time_s:
            raise ConfigError(f"{path}:{number}: time goes back to {event.time_s:g} s")
        events.append(event)
    return tuple(events)


def _has_content(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in next(csv.reader([line]))]


def _event(cells: list[str]) -> InputEvent:
    if len(cells) != len(HEADER):
        raise ValueError(f"{len(cells)} columns instead of {len(HEADER)}")
    time_s, name = float(cells[0]), cells[2]
    if not 0.0 <= time_s < math.inf:
        raise ValueError(f"time_s is {cells[0]}")
    match cells[1]:
        case "axis":
            value = float(cells[3])
            if not -1.0 <= value <= 1.0:
                raise ValueError(f"an axis lies between -1 and 1, not at {cells[3]}")
            return InputEvent(time_s, "axis", name, value)
        case "button":
            if cells[3] not in ("0", "1"):
                raise ValueError(f"a button is 0 or 1, not {cells[3]}")
            return InputEvent(time_s, "button", name, float(cells[3]))
        case "device":
            if name not in ("frozen", "unplugged"):
                raise ValueError(f"a device gets frozen or unplugged, not {name!r}")
            return InputEvent(time_s, "device", name)
    raise ValueError(f"what must be axis, button or device, not {cells[1]!r}")


class RecordedInput(InputDevice):
    """Plays events from the first `poll` on; like a device that reports all the time.

    After the last event it goes on for `linger_s`, then it is unplugged.
    """

    def __init__(
        self,
        events: Iterable[InputEvent],
        *,
        key: str = "recorded",
        title: str = "Recording",
        linger_s: float = 0.2,
        clock: Clock = WALL,
    ) -> None:
        self._events = tuple(events)
        self._clock = clock
        self._began_s: float | None = None
        self._next = 0
        self._axes = {each.name: 0.0 for each in self._events if each.what == "axis"}
        self._buttons = {each.name: False for each in self._events if each.what == "button"}
        self._frozen_wall_s: float | None = None
        self._unplugged = False
        last_s = self._events[-1].time_s if self._events else 0.0
        self._end_s = last_s + linger_s
        self.felt: list[dict[str, float]] = []
        self._info = InputInfo(
            key=key,
            title=title,
            kind=InputKind.RECORDING,
            axes=tuple(self._axes),
            buttons=tuple(self._buttons),
            quiet_s=ALWAYS_REPORTS_S,
        )

    @property
    @override
    def info(self) -> InputInfo:
        return self._info

    @override
    def poll(self) -> InputState:
        now_s, now_wall_s = self._clock.now_s(), WALL.now_s()
        if self._began_s is None:
            self._began_s = now_s
        played_s = now_s - self._began_s
        while self._next < len(self._events) and self._frozen_wall_s is None:
            event = self._events[self._next]
            if event.time_s > played_s:
                break
            self._next += 1
            self._take(event, now_wall_s)
        over = self._unplugged or (self._frozen_wall_s is None and played_s > self._end_s)
        time_s = now_wall_s if self._frozen_wall_s is None else self._frozen_wall_s
        return InputState(dict(self._axes), dict(self._buttons), connected=not over, time_s=time_s)

    def _take(self, event: InputEvent, now_wall_s: float) -> None:
        match event.what:
            case "axis":
                self._axes[event.name] = event.value
            case "button":
                self._buttons[event.name] = event.value > 0.0
            case "device" if event.name == "frozen":
                self._frozen_wall_s = now_wall_s
            case "device":
                self._unplugged = True

    @override
    def feel(self, force: Mapping[str, float]) -> None:
        """Note what a hand would have felt, in `felt`."""
        if not self.felt or self.felt[-1] != force:
            self.felt.append(dict(force))

    @override
    def close(self) -> None:
        self._unplugged = True


class RecordedSource(InputSource):
    """Recordings by the path of their file: the key is "recorded:PATH"."""

    PREFIX: Final = "recorded:"

    @override
    def devices(self) -> tuple[InputInfo, ...]:
        return ()

    @override
    def open(self, key: str) -> InputDevice:
        path = Path(key.removeprefix(self.PREFIX))
        if not path.is_file():
            raise NotConnectedError(f"there is no recording {path}")
        return RecordedInput(read_events(path), key=key, title=path.stem)

    @override
    def close(self) -> None:
        """Do nothing: nothing is open."""


def _make(_options: NoOptions, _context: None) -> InputSource:
    return RecordedSource()


BACKEND: Final = InputBackend(_make)
