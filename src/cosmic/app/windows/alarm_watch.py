"""What raises alarms by its value or by how fast it changes: forces, clearance, the computer."""

import os
import shutil
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from PySide6.QtWidgets import QApplication

from cosmic.app.configuration.alarms import AlarmLevels, AlarmSettings, FallingLevels
from cosmic.app.panels.alarms import AlarmBook, Level
from cosmic.frame.clock import WALL

HYSTERESIS: Final = 0.05
"""An alarm ends when its quantity is better than its level by this share of it."""
SOUND_S: Final = 3.0
"""So often a sound is repeated while a critical alarm lasts that nobody acknowledged."""
RATE_OVER_S: Final = 1.0
COMPUTER_S: Final = 5.0
"""So often load, memory, temperature and disk are read."""
_THERMAL: Final = Path("/sys/class/thermal")
_MEMORY: Final = Path("/proc/meminfo")


@dataclass(frozen=True)
class Quantity:
    """Something that is watched.

    Attributes
    ----------
    source : str
        What an alarm is about: one alarm at a time.
    name : str
        Begins the sentence, such as "The clearance of left and plate".
    unit : str
        After the number; may be empty.
    advice : str
        What to do.
    value : callable
        Returns it now; None where nobody knows.
    scale : float
        Shown is the value times this.
    every_s : float
        It is looked at no more often: what is read from the system is read in the window's thread.
    """

    source: str
    name: str
    unit: str
    levels: AlarmLevels
    advice: str
    value: Callable[[], float | None]
    scale: float = 1.0
    every_s: float = 0.0

    @property
    def falling(self) -> bool:
        """It is bad when it is small."""
        return isinstance(self.levels, FallingLevels)


class AlarmWatch:
    """Looks at quantities and raises an alarm once for each level; GUI thread.

    Parameters
    ----------
    book : AlarmBook
        Where alarms go.
    now_s : callable
        Returns the time by which rates are told.
    beep : callable
        Makes a sound.
    """

    def __init__(
        self,
        book: AlarmBook,
        *,
        sound: bool = False,
        now_s: Callable[[], float] = WALL.now_s,
        beep: Callable[[], object] = QApplication.beep,
    ) -> None:
        self._book, self._sound, self._now_s, self._beep = book, sound, now_s, beep
        self._levels: dict[str, Level | None] = {}
        self._before: dict[str, tuple[float, float]] = {}
        self._rates: dict[str, float] = {}
        self._due_s: dict[str, float] = {}
        self._sounded_s = float("-inf")

    def look(self, quantities: Mapping[str, Quantity]) -> None:
        """Look at all of them now; those that were there before and are not are over."""
        for source in self._levels.keys() - quantities.keys():
            self._book.end(source)
            del self._levels[source]
        now_s = self._now_s()
        for each in quantities.values():
            if now_s >= self._due_s.get(each.source, now_s):
                self._due_s[each.source] = now_s + each.every_s
                self._look_at(each)
        self._make_sound()

    def _look_at(self, quantity: Quantity) -> None:
        source, value = quantity.source, quantity.value()
        if value is None:
            self._before.pop(source, None)
            self._rates.pop(source, None)
            self._raise(quantity, None, "")
            return
        rate = self._rate(source, value) * (-1.0 if quantity.falling else 1.0)
        shown, unit = value * quantity.scale, f" {quantity.unit}" if quantity.unit else ""
        by_value = self._by_value(quantity, value)
        by_rate = self._by_rate(quantity.levels, rate)
        speed = abs(rate * quantity.scale)
        trend = "falls" if quantity.falling else "rises"
        if by_rate is not None and (by_value is None or by_rate is Level.CRITICAL):
            text = f"{quantity.name} {trend} by {speed:.3g}{unit} per second"
            self._raise(quantity, by_rate, text)
        else:
            self._raise(quantity, by_value, f"{quantity.name} is {shown:.3g}{unit}")

    def _rate(self, source: str, value: float) -> float:
        """Return how fast it changes, over a second at least."""
        now_s = self._now_s()
        when_s, was = self._before.setdefault(source, (now_s, value))
        if now_s - when_s >= RATE_OVER_S:
            self._rates[source] = (value - was) / (now_s - when_s)
            self._before[source] = (now_s, value)
        return self._rates.get(source, 0.0)

    def _by_value(self, quantity: Quantity, value: float) -> Level | None:
        levels, sign = quantity.levels, -1.0 if quantity.falling else 1.0
        last = self._levels.get(quantity.source)
        for level, bound in ((Level.CRITICAL, levels.critical), (Level.WARNING, levels.warning)):
            if bound is None:
                continue
            holds = last is Level.CRITICAL or last is level
            eased = HYSTERESIS * abs(bound) if holds else 0.0
            if sign * value >= sign * bound - eased:
                return level
        return None

    @staticmethod
    def _by_rate(levels: AlarmLevels, rate: float) -> Level | None:
        for level, bound in (
            (Level.CRITICAL, levels.rate_critical),
            (Level.WARNING, levels.rate_warning),
        ):
            if bound is not None and rate >= bound:
                return level
        return None

    def _raise(self, quantity: Quantity, level: Level | None, cause: str) -> None:
        """Say it once; what became less grave is not said again."""
        last = self._levels.get(quantity.source)
        self._levels[quantity.source] = level
        if level is None and last is not None:
            self._book.end(quantity.source)
        elif level is not None and (
            last is None or (level, last) == (Level.CRITICAL, Level.WARNING)
        ):
            self._book.raise_alarm(quantity.source, level, cause, quantity.advice)

    def _make_sound(self) -> None:
        grave = any(e.lasts and e.level is Level.CRITICAL for e in self._book.unseen)
        now_s = self._now_s()
        if self._sound and grave and now_s - self._sounded_s >= SOUND_S:
            self._sounded_s = now_s
            self._beep()


# The computer


def processor_load() -> float | None:
    """Return how many programs wait or run, for each core; None where the system does not tell."""
    asked = getattr(os, "getloadavg", None)  # Windows has none
    if asked is None:
        return None
    with suppress(OSError):
        return float(asked()[0]) / (os.cpu_count() or 1)
    return None


def memory_share() -> float | None:
    """Return how much of the memory is in use, 0 to 1; None where the system does not tell."""
    with suppress(OSError, ValueError, KeyError, IndexError):
        lines = (line.split(":") for line in _MEMORY.read_text(encoding="ascii").splitlines())
        found = {name: float(rest.split()[0]) for name, rest in lines}
        return 1.0 - found["MemAvailable"] / found["MemTotal"]
    return None


def temperature_degc() -> float | None:
    """Return the temperature of the hottest part; None where the system does not tell."""
    found = []
    for path in _THERMAL.glob("thermal_zone*/temp"):
        with suppress(OSError, ValueError):
            found.append(float(path.read_text(encoding="ascii")) / 1000.0)
    return max(found, default=None)


def disk_left_gb(folder: Path) -> float | None:
    """Return how much room is left where a folder is, or will be."""
    there = next((each for each in (folder, *folder.parents) if each.exists()), None)
    if there is None:
        return None
    with suppress(OSError):
        return shutil.disk_usage(there).free / 1e9
    return None


def computer_quantities(settings: AlarmSettings, folder: Path) -> dict[str, Quantity]:
    """Return what of the computer is watched; `folder` is where recordings go."""
    disk = "Free some room, or record to another disk"
    found = (
        Quantity(
            "processor",
            "The load of the processor",
            "per core",
            settings.processor,
            "End other programs: the window may answer late",
            processor_load,
            every_s=COMPUTER_S,
        ),
        Quantity(
            "memory",
            "The memory in use",
            "%",
            settings.memory,
            "End other programs, then restart this one",
            memory_share,
            scale=100.0,
            every_s=COMPUTER_S,
        ),
        Quantity(
            "temperature",
            "The temperature of the computer",
            "°C",
            settings.temperature_degc,
            "Clear its fans and openings",
            temperature_degc,
            every_s=COMPUTER_S,
        ),
        Quantity(
            "disk",
            f"The room left for recordings in {folder}",
            "GB",
            settings.disk_gb,
            disk,
            lambda: disk_left_gb(folder),
            every_s=COMPUTER_S,
        ),
    )
    return {each.source: each for each in found}
