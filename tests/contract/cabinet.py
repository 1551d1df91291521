"""A small application with one thing of each kind, which tests of every side use."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from threading import Timer
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cosmic.frame.config import StrictModel
from cosmic.frame.declaration import (
    Declared,
    command,
    newest,
    part,
    state,
    stream,
)
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.frame.network.caller import current_call
from cosmic.frame.network.transport import Rule
from cosmic.frame.operation import Task


class Colour(Enum):
    RED = "red"
    GREEN = "green"


@dataclass(frozen=True, slots=True)
class LampState:
    colour: Colour
    level: float


class LampSettings(StrictModel):
    name: str
    brightest: float = 1.0


@dataclass(frozen=True)
class Sample:
    first: int
    values: NDArray[np.float64]


class Drawer(Declared):
    """A part with a key."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.moved_um: list[float] = []
        self.dead_men: list[Any] = []

    @property
    @state
    def position_um(self) -> float:
        return self.moved_um[-1] if self.moved_um else 0.0

    @command(moves=True)
    def move(self, target_um: float) -> float:
        call = current_call()
        self.dead_men.append(call.dead_man if call is not None else None)
        self.moved_um.append(target_um)
        self.note_change()
        return target_um

    def nudge(self) -> float:
        """Put together from what is declared."""
        return self.move(self.position_um + 1.0)


class Lamp(Declared):
    """A part without a key."""

    def __init__(self) -> None:
        self._state = LampState(Colour.RED, 0.0)

    @property
    @state(unknown=LampState(Colour.RED, 0.0))
    def shown(self) -> LampState:
        return self._state

    @command
    def shine(self, colour: Colour, *, level: float = 1.0) -> None:
        self._state = LampState(colour, level)
        self.note_change()


class Cabinet(Declared):
    """A small application with one thing of each kind."""

    def __init__(self) -> None:
        self._lamp = Lamp()
        self._drawers = {"top": Drawer("top"), "left.x": Drawer("left.x")}
        self._spare: Lamp | None = None
        self._settings = LampSettings(name="lamp")
        self._receivers: list[Callable[[Sample], object]] = []
        self.stops = self.drawn = 0
        self.locked = False
        self.asked = 0
        self.tasks: list[Task] = []

    @property
    @part
    def lamp(self) -> Lamp:
        return self._lamp

    @property
    @part
    def spare(self) -> Lamp | None:
        return self._spare

    def fit(self, spare: Lamp | None) -> None:
        self._spare = spare
        self.note_change()

    @property
    @part
    def drawers(self) -> Mapping[str, Drawer]:
        return self._drawers

    def put_in(self, name: str) -> None:
        self._drawers[name] = Drawer(name)
        self.note_change()

    def take_out(self, name: str) -> None:
        del self._drawers[name]
        self.note_change()

    @property
    @state(unknown=LampSettings(name="unknown"))
    def settings(self) -> LampSettings:
        return self._settings

    @property
    @state
    def folder(self) -> Path:
        return Path("/recordings")

    @property
    def name(self) -> str:
        return self.settings.name

    @command
    def apply(self, settings: LampSettings) -> None:
        if settings.brightest > 10.0:
            raise ConfigError("too bright")
        self._settings = settings
        self.note_change()

    @command(reads=True)
    def where(self, path: str | Path, colour: Colour | None = None) -> tuple[Path, Colour]:
        return self.folder / path, colour or Colour.GREEN

    @command(reads=True, remembered_s=60.0)
    def free_bytes(self, folder: Path) -> int:
        self.asked += 1
        return 10 * len(folder.name)

    @command(at_once=True)
    def stop(self) -> None:
        self.stops += 1

    @command
    def export(self) -> Task:
        self.tasks.append(Task("Export"))
        return self.tasks[-1]

    @command
    def rename(self, name: str) -> Task:
        """Take effect at the end only."""
        task = Task("Rename")

        def end() -> None:
            self._settings = LampSettings(name=name)
            task.finish()

        Timer(0.005, end).start()
        return task

    @command(moves=True)
    def travel(self) -> Task:
        task = Task("Travel")
        task.on_cancel(lambda: task.fail(NotAvailable("halted")))
        self.tasks.append(task)
        return task

    @stream(Rule.ALL, topic="samples", missing=lambda a, b: b.first - a.first - len(a.values))
    def subscribe(self, receiver: Callable[[Sample], object]) -> Callable[[], None]:
        self._receivers.append(receiver)
        return lambda: self._receivers.remove(receiver)

    @stream(Rule.LATEST, topic="shown")
    def follow(self, receiver: Callable[[Sample], object]) -> Callable[[], None]:
        return self.subscribe(receiver)

    @property
    @newest("follow")
    def latest(self) -> Sample | None:
        return None

    @stream(Rule.LATEST, topic="drawn")
    def watch(
        self, receiver: Callable[[Sample], object], wanted: Callable[[], bool] = lambda: True
    ) -> Callable[[], None]:
        def draw(sample: Sample) -> None:
            if wanted():
                self.drawn += 1
                receiver(sample)

        return self.subscribe(draw)

    @command(aside=True)
    def lock(self, code: int) -> None:
        if code != 7:
            raise ConfigError("that is not the code")
        self.locked = True
        self.note_change()

    def emit(self, first: int, count: int) -> None:
        for each in list(self._receivers):
            each(Sample(first, np.arange(float(count))))


class WithBell(Cabinet):
    """The cabinet with one command more: this is all that it takes."""

    def __init__(self) -> None:
        super().__init__()
        self.rung: list[int] = []

    @command
    def ring(self, times: int = 1) -> str:
        self.rung.append(times)
        return "ding " * times
