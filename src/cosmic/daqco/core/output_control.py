"""Outputs in use: limits, safe values, and who may no longer give what they give."""

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from threading import Event, RLock
from typing import Final

import numpy as np
from typing_extensions import override

from cosmic.daqco.core.settings import OutputSettings
from cosmic.daqco.hw.interface import Volts
from cosmic.daqco.hw.outputs import AnalogOutput, BoardOutputs, Waveform
from cosmic.frame.arguments import reason_of
from cosmic.frame.clock import WALL
from cosmic.frame.errors import ArgumentError, ConfigError, CosmicError, NotAvailable, refusal
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.dead_man import DeadMan
from cosmic.frame.threads import WorkerThread
from cosmic.frame.verdict import Reason, refuse

logger = logging.getLogger(__name__)

LOOK_S: Final = 0.05
ANSWER_TIMEOUT_S: Final = 5.0
"""So long a board may take until it is given up."""
MOST_SAMPLES: Final = 1_000_000


@dataclass(frozen=True, slots=True)
class OutputState:
    """What an output gives.

    Attributes
    ----------
    value : float or None
        V; of a digital line 0 or 1. None while it is not known, or a waveform is played.
    playing : bool
        A waveform is played, or waits for its trigger.
    safe : float
        What it gives after a stop, V, or 0 or 1.
    low_v, high_v : float
        Its limits; 0 and 1 of a digital line.
    stops : bool
        A stop drives it to its safe value.
    problem : str
        Why it cannot be used; empty when all is well.
    """

    name: str
    place: str
    analog: bool
    value: float | None
    playing: bool
    safe: float
    low_v: float
    high_v: float
    stops: bool
    problem: str = ""


class OutputControl(WorkerThread):
    """The outputs that the configuration names, and no others; any thread.

    A value outside the limits is refused, never clipped. A stop is latched: outputs marked so are
    driven to their safe values by this thread, and nothing is written before the reset. What was
    set from another station goes to its safe value when that station falls silent or gives the
    right to move away.

    Parameters
    ----------
    settings : sequence of OutputSettings
        Which there are.
    open_board : callable
        Returns the outputs of a board by its name.
    changed : callable
        Called after each change, in any thread.
    note : callable
        Takes what was written, for a recording; in any thread, must return at once.
    """

    def __init__(
        self,
        settings: Sequence[OutputSettings],
        open_board: Callable[[str], BoardOutputs],
        policy: FailurePolicy,
        changed: Callable[[], object],
        note: Callable[[str], object] = lambda _text: None,
    ) -> None:
        super().__init__("outputs", policy)
        self._settings = {each.name: each for each in settings}
        self._open_board = open_board
        self._changed = changed
        self._note = note
        # One a board: a driver that hangs keeps no other board from its safe values.
        self._locks = {each.board: RLock() for each in settings}
        self._boards: dict[str, BoardOutputs] = {}
        self._states = {each.name: _begun(each) for each in settings}
        self._dead_men: dict[str, DeadMan] = {}
        self._wake = Event()
        self._stopped = ""
        self._unsafe = False

    @property
    def states(self) -> tuple[OutputState, ...]:
        """What each output gives."""
        return tuple(self._states.values())

    @property
    def stopped(self) -> str:
        """Why outputs are stopped; empty while they are not."""
        return self._stopped

    # Commands

    def set_voltage(self, name: str, volts: float, dead_man: DeadMan | None = None) -> None:
        """Give a voltage from now on.

        Raises
        ------
        ConfigError
            There is no such output, or it is a digital line.
        MoveRefused
            It is outside the limits (`LimitError`), no number, or outputs are stopped.
        DeviceError
            The board is gone or refused.
        """
        each = self._named(name, analog=True)
        self._check_volts(each, float(volts), float(volts))
        with self._locks[each.board]:
            self._check_free(name)
            self._outputs(each).write(_analog(each), float(volts))
            self._put(name, float(volts), dead_man)
        self._note(f"{name}: {volts:g} V")
        self._changed()

    def set_line(self, name: str, *, high: bool, dead_man: DeadMan | None = None) -> None:
        """Set a digital line; raises as `set_voltage`."""
        each = self._named(name, analog=False)
        with self._locks[each.board]:
            self._check_free(name)
            self._outputs(each).write_line(each.output, high=high)
            self._put(name, float(high), dead_man)
        self._note(f"{name}: {'high' if high else 'low'}")
        self._changed()

    def play(self, name: str, waveform: Waveform, dead_man: DeadMan | None = None) -> float:
        """Give the values of a waveform, all of which are checked first; return its real rate, Hz.

        Raises
        ------
        ArgumentError
            It has no values, too many, or a rate that is none.
        NotAvailable
            The board plays none, or one already.
        """
        each = self._named(name, analog=True)
        volts = _checked(name, waveform)
        self._check_volts(each, float(volts.min()), float(volts.max()))
        with self._locks[each.board]:
            self._check_free(name)
            made_hz = self._outputs(each).play(_analog(each), replace(waveform, volts=volts))
            self._put(name, None, dead_man)
        begins = f", from the edge of {waveform.trigger} on" if waveform.trigger else ""
        again = ", repeated" if waveform.repeat else ""
        self._note(f"{name}: {volts.size} values at {made_hz:g} Hz{again}{begins}")
        self._wake.set()
        self._changed()
        return made_hz

    def make_safe(self, reason: str) -> None:
        """Drive every output to its safe value; returns when that is done, and latches nothing.

        A board that does not answer for some seconds is given up.
        """
        self._drive_all_safe(tuple(self._settings.values()), reason)

    def stop(self, reason: str) -> None:
        """Drive outputs marked so to their safe values, and let nothing be written before `reset`.

        Returns at once and waits for no board.
        """
        self._stopped = self._stopped or reason_of(reason) or "stopped"
        self._unsafe = True
        self._wake.set()

    def reset(self) -> None:
        """Let outputs be written again; they keep their safe values until then."""
        self._stopped = ""
        self._changed()

    # The life of it

    def begin(self) -> None:
        """Open the boards, and drive every output to its safe value; what fails is told of it."""
        if not self._settings:
            return
        self.make_safe("the boards are opened")
        if not self.isRunning():
            self.start()

    @override
    def request_end(self) -> None:
        super().request_end()
        self._wake.set()

    def close(self) -> None:
        """End it, with every output at its safe value; any state."""
        self.request_end()
        self.join()
        if self._boards:
            self.make_safe("the program ends")
        for board in tuple(self._boards.values()):
            board.close()
        self._boards.clear()

    @override
    def run_body(self) -> None:
        while not self.end_requested:
            self._wake.wait(LOOK_S if self._is_busy() else None)
            self._wake.clear()
            if self._unsafe:
                self._carry_out_stop()
            self._look_for_silence()
            self._look_for_ends()

    def _is_busy(self) -> bool:
        return bool(self._dead_men) or any(each.playing for each in self._states.values())

    def _carry_out_stop(self) -> None:
        self._unsafe = False
        wanted = tuple(each for each in self._settings.values() if each.stops)
        self._drive_all_safe(wanted, self._stopped)

    def _drive_all_safe(self, wanted: Sequence[OutputSettings], reason: str) -> None:
        """Drive outputs to their safe values, board by board; who is busy comes later."""
        left = dict.fromkeys(each.board for each in wanted)
        until_s = WALL.now_s() + ANSWER_TIMEOUT_S
        while left and WALL.now_s() < until_s:
            for board in tuple(left):
                if not self._locks[board].acquire(timeout=LOOK_S):
                    continue
                try:
                    for each in wanted:
                        if each.board == board:
                            self._drive_safe(each.name, each, reason)
                finally:
                    self._locks[board].release()
                del left[board]
        for each in wanted:
            if each.board in left:
                self._note_unsafe(each.name, reason, f"{each.board} does not answer")
        self._changed()

    def _look_for_silence(self) -> None:
        for name, dead_man in tuple(self._dead_men.items()):
            why = dead_man.why
            if not why:
                continue
            with self._locks[self._settings[name].board]:
                if self._dead_men.get(name) is dead_man:
                    self._drive_safe(name, self._settings[name], why)
            self._changed()

    def _look_for_ends(self) -> None:
        """Note which waveforms have come to their end."""
        for name, state in tuple(self._states.items()):
            if not state.playing:
                continue
            each = self._settings[name]
            with self._locks[each.board]:
                try:
                    over = self._outputs(each).playing != each.output
                    problem = ""
                except CosmicError as exc:
                    over, problem = True, str(exc)
                    logger.error("output %s: %s", name, exc)
                if over and self._states[name].playing:
                    self._states[name] = replace(state, playing=False, problem=problem)
                    self._changed()

    # Inside

    def _drive_safe(self, name: str, each: OutputSettings, reason: str) -> None:
        """Give the safe value; the lock is held. What fails is logged and stands in the state."""
        self._dead_men.pop(name, None)
        try:
            outputs = self._outputs(each)
            try:
                _write_safe(outputs, each)
            except CosmicError:
                outputs.end_waveform()  # which may keep the board from any other output
                _write_safe(outputs, each)
        except CosmicError as exc:
            self._note_unsafe(name, reason, str(exc))
            return
        logger.info("output %s at its safe value: %s", name, reason)
        self._note(f"{name}: its safe value ({reason})")
        state = self._states[name]
        self._states[name] = replace(state, value=state.safe, playing=False, problem="")

    def _note_unsafe(self, name: str, reason: str, problem: str) -> None:
        logger.error("output %s cannot be made safe (%s): %s", name, reason, problem)
        state = self._states[name]
        self._states[name] = replace(state, value=None, playing=False, problem=problem)

    def _put(self, name: str, value: float | None, dead_man: DeadMan | None) -> None:
        """Note what an output gives now; None: a waveform."""
        self._states[name] = replace(
            self._states[name], value=value, playing=value is None, problem=""
        )
        self._dead_men.pop(name, None)
        if dead_man is not None:
            self._dead_men[name] = dead_man
            self._wake.set()

    def _outputs(self, each: OutputSettings) -> BoardOutputs:
        if each.board not in self._boards:
            if self.end_requested:
                raise NotAvailable("DAQCo is closed")
            self._boards[each.board] = self._open_board(each.board)
        return self._boards[each.board]

    def _named(self, name: str, *, analog: bool) -> OutputSettings:
        each = self._settings.get(name)
        if each is None:
            there = (
                ", ".join(self._settings) or "none: name them in platform.toml, [[daqco.output]]"
            )
            raise ConfigError(f"there is no output {name!r}; there are {there}")
        if each.analog is not analog:
            kind = "an analogue output" if each.analog else "a digital line"
            raise ConfigError(f"output {name!r} is {kind}")
        return each

    def _check_free(self, name: str) -> None:
        """Refuse while stopped; the lock is held, so that no stop is carried out meanwhile."""
        if self._stopped:
            text = f"output {name}: outputs are stopped ({self._stopped}); reset the stop first"
            raise refusal(refuse(Reason.STOPPED, text, axis=name))

    def _check_volts(self, each: OutputSettings, low_v: float, high_v: float) -> None:
        assert each.low_v is not None and each.high_v is not None
        if not (math.isfinite(low_v) and math.isfinite(high_v)):
            text = f"output {each.name}: a voltage is not a finite number; nothing was written"
            raise refusal(refuse(Reason.NOT_FINITE, text, axis=each.name))
        if not each.low_v <= low_v <= high_v <= each.high_v:
            wrong = low_v if low_v < each.low_v else high_v
            limit = each.low_v if low_v < each.low_v else each.high_v
            text = (
                f"output {each.name}: {wrong:g} V asked; its limits are {each.low_v:g} to "
                f"{each.high_v:g} V; nothing was written"
            )
            raise refusal(
                refuse(Reason.LIMIT, text, axis=each.name, value=wrong, limit=limit, unit="V")
            )


def _begun(each: OutputSettings) -> OutputState:
    if each.analog:
        assert each.low_v is not None and each.high_v is not None
        safe, low, high = each.safe_v, each.low_v, each.high_v
    else:
        safe, low, high = float(each.safe_high), 0.0, 1.0
    return OutputState(
        name=each.name,
        place=f"{each.board}/{each.output}",
        analog=each.analog,
        value=None,
        playing=False,
        safe=safe,
        low_v=low,
        high_v=high,
        stops=each.stops,
    )


def _analog(each: OutputSettings) -> AnalogOutput:
    assert each.low_v is not None and each.high_v is not None
    return AnalogOutput(each.output, each.low_v, each.high_v)


def _write_safe(outputs: BoardOutputs, each: OutputSettings) -> None:
    if each.analog:
        outputs.write(_analog(each), each.safe_v)
    else:
        outputs.write_line(each.output, high=each.safe_high)


def _checked(name: str, waveform: Waveform) -> Volts:
    try:
        volts = np.array(waveform.volts, dtype=np.float64)
    except (TypeError, ValueError):
        raise ArgumentError(f"output {name}: a waveform is an array of volts") from None
    if volts.ndim != 1 or not 1 <= volts.size <= MOST_SAMPLES:
        raise ArgumentError(
            f"output {name}: a waveform is a row of 1 to {MOST_SAMPLES} volts, not {volts.shape}"
        )
    if not (math.isfinite(waveform.rate_hz) and waveform.rate_hz > 0.0):
        raise ArgumentError(f"output {name}: {waveform.rate_hz!r} Hz is not a rate of a waveform")
    return volts
