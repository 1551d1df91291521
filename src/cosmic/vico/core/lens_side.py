"""The lens and the lamp as the thread of their lines drives them; that thread alone may call."""

import logging
from collections.abc import Callable, Sequence
from typing import Final, TypeVar

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    MoveCancelled,
    NotAvailable,
    ProtocolError,
)
from cosmic.frame.operation import Task
from cosmic.vico.core.lens_history import LensHistory
from cosmic.vico.core.lens_move import Move
from cosmic.vico.hw.peripherals import Lens, LensAxis, LensState, Light

logger = logging.getLogger(__name__)

D = TypeVar("D", bound=Lens | Light)

IDLE_S: Final = 1.0
"""Wall time between two looks at what rests."""


class LightSide:
    """The lamp at the end of its line.

    Parameters
    ----------
    open_light : callable
        Returns None where there is none.
    """

    def __init__(
        self, open_light: Callable[[], Light | None], clock: Clock, history: LensHistory
    ) -> None:
        self._open_light = open_light
        self._clock = clock
        self._history = history
        self._light: Light | None = None
        self._looked_s = -IDLE_S
        self.problem = ""
        self.percent: float | None = None

    @property
    def name(self) -> str:
        """What the operator reads; empty while there is none."""
        light = self._light
        return light.name if light is not None else ""

    def open(self) -> None:
        """Open it, unless it is open; `problem` says when that failed."""
        if self._light is None:
            self._light, self.problem = _opened(self._open_light)
            self._looked_s = -IDLE_S

    def set_percent(self, percent: float) -> None:
        """Make it so bright; raises what the lamp raises."""
        light = self._light
        if light is None:
            raise NotAvailable(self.problem or "the platform has no light that can be dimmed")
        try:
            # What it was until now, for frames exposed before.
            self._history.add_light(self._clock.now_s(), self.percent)
            light.set_percent(percent)
            self._ask(light)
        except CosmicError as exc:
            if is_lost(exc):
                self._lose(exc)
            raise

    def look(self) -> None:
        """Ask it now and then; a line that fails is closed."""
        if self._light is not None and WALL.now_s() - self._looked_s >= IDLE_S:
            try:
                self._ask(self._light)
            except CosmicError as exc:
                self._lose(exc)

    def close(self) -> None:
        """Close it; it shines on."""
        light, self._light, self.percent = self._light, None, None
        if light is not None:
            light.close()

    def _ask(self, light: Light) -> None:
        self.percent = light.percent()
        self._looked_s = WALL.now_s()
        self._history.add_light(self._clock.now_s(), self.percent)

    def _lose(self, error: CosmicError) -> None:
        logger.error("%s", error)
        self.close()
        self.problem = str(error)
        self._history.add_light(self._clock.now_s(), None)


class LensSide:
    """The lens at the end of its line, and the movements it makes.

    Parameters
    ----------
    open_lens : callable
        Returns None where there is none.
    """

    def __init__(
        self, open_lens: Callable[[], Lens | None], clock: Clock, history: LensHistory
    ) -> None:
        self._open_lens = open_lens
        self._clock = clock
        self._history = history
        self._lens: Lens | None = None
        self._looked_s = dict.fromkeys(LensAxis, -IDLE_S)
        self._moves: list[Move] = []
        self._ended: list[Move] = []
        self.problem = ""
        self.states: dict[LensAxis, LensState] = {}

    @property
    def name(self) -> str:
        """What the operator reads; empty while there is none."""
        lens = self._lens
        return lens.name if lens is not None else ""

    @property
    def busy(self) -> bool:
        """Something moves, or should."""
        return bool(self._moves) or any(each.moving for each in self.states.values())

    @property
    def tasks(self) -> tuple[Task, ...]:
        """The tasks of movements under way; any thread."""
        return tuple(each.task for each in tuple(self._moves))

    def open(self) -> None:
        """Open it, unless it is open; `problem` says when that failed."""
        if self._lens is None:
            self._lens, self.problem = _opened(self._open_lens)
            self._looked_s = dict.fromkeys(LensAxis, -IDLE_S)

    def begin(self, move: Move) -> None:
        """Begin a movement; it ends another whose motors it takes. Raises what the lens raises."""
        lens = self._lens
        if lens is None:
            raise NotAvailable(self.problem or "the platform has no motorised lens")
        if why := move.abandoned:
            raise MoveCancelled(f"not started: {why}")
        try:
            for axis, target in move.targets.items():
                # Where it stood until now, for frames exposed before it moves.
                self._ask(lens, axis, starts=True)
                if target is None:
                    lens.home(axis)
                else:
                    lens.seek(axis, target)
        except CosmicError as exc:
            self._looked_s = dict.fromkeys(LensAxis, -IDLE_S)  # refused: look again at once
            if is_lost(exc):
                self._lose(exc)
            raise
        self._replace(move)
        move.begin()
        self._moves.append(move)

    def abort(self, why: str = "aborted") -> None:
        """Stop both motors."""
        try:
            if self._lens is not None:
                self._lens.abort()
        except CosmicError as exc:
            self._lose(exc)
        self._end(self._moves, MoveCancelled(why))

    def look(self) -> None:
        """Ask what moves, and now and then what rests; a line that fails is closed."""
        why = next((each.abandoned for each in self._moves if each.abandoned), "")
        if why:
            logger.warning("the lens is stopped: %s", why)
            self.abort(f"stopped: {why}")
        lens = self._lens
        if lens is None:
            return
        try:
            for axis in LensAxis:
                if self._due(axis):
                    self._ask(lens, axis)
            late = any(isinstance(each.error, DeviceTimeout) for each in self._moves)
            self._end([])
            if late:
                lens.abort()
        except CosmicError as exc:
            self._lose(exc)

    def publish_ends(self) -> None:
        """Tell whoever waits for a movement that is over."""
        ended, self._ended = self._ended, []
        for move in ended:
            move.publish_end()

    def close(self) -> None:
        """Close it; nothing goes on moving when nobody watches."""
        if self._lens is not None and self.busy:
            self.abort()
        lens, self._lens = self._lens, None
        self.states = {}
        if lens is not None:
            lens.close()

    def _due(self, axis: LensAxis) -> bool:
        state = self.states.get(axis)
        moves = state is not None and state.moving
        watched = any(axis in each.left for each in self._moves)
        return moves or watched or WALL.now_s() - self._looked_s[axis] >= IDLE_S

    def _ask(self, lens: Lens, axis: LensAxis, *, starts: bool = False) -> None:
        before_s = self._clock.now_s()
        state = lens.state(axis)
        self.states[axis] = state
        self._looked_s[axis] = WALL.now_s()
        time_s = (before_s + self._clock.now_s()) / 2.0
        self._history.add_motor(axis, time_s, state, starts=starts)
        for move in self._moves:
            move.look(axis, state)

    def _replace(self, move: Move) -> None:
        """End the tasks whose motors are wanted for another."""
        others = [each for each in self._moves if set(each.targets) & set(move.targets)]
        self._end(others, MoveCancelled("replaced by a newer movement"))

    def _lose(self, error: CosmicError) -> None:
        """Close a line that failed, and say why it is grey."""
        logger.error("%s", error)
        lens, self._lens = self._lens, None
        if lens is not None:
            lens.close()
        self.states = {}
        self.problem = str(error)
        for axis in LensAxis:
            self._history.add_motor(axis, self._clock.now_s(), None)
        self._end(self._moves, error)

    def _end(self, moves: Sequence[Move], error: CosmicError | None = None) -> None:
        """End movements, and put aside all that are over."""
        for move in moves:
            move.end(error)
        self._ended += [each for each in self._moves if each.over]
        self._moves = [each for each in self._moves if not each.over]


def is_lost(error: CosmicError) -> bool:
    """Whether a line is of no use after `error`; a refusal leaves it as it was."""
    if isinstance(error, DeviceError):
        return error.fault not in (DeviceFault.PARAMETER, DeviceFault.UNSUPPORTED)
    return isinstance(error, ProtocolError)


def _opened(open_device: Callable[[], D | None]) -> tuple[D | None, str]:
    try:
        return open_device(), ""
    except CosmicError as exc:
        logger.warning("%s", exc)
        return None, str(exc)
