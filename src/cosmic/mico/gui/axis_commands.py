"""From a click to a movement, and from its end back to the field it came from."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget

from cosmic.frame.errors import CosmicError, MoveCancelled, MoveRefused
from cosmic.frame.gui.relay import Relay
from cosmic.frame.verdict import MoveVerdict, Reason
from cosmic.mico.api.stepwise import StepwiseMove
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.positioner import PositionerState
from cosmic.mico.gui.detour_request import HINT, DetourRequest, Goal

SEEN: Final = {"um": 1.0, "deg": 0.01}
"""A change of position that is no noise."""
Make = Callable[[bool], Movement | StepwiseMove]
"""Makes a movement; the argument is the operator's consent to an unknown position."""


@dataclass(frozen=True, slots=True)
class ConsentRequest:
    """A movement that waits for a decision, because the position of its axis is unknown.

    Attributes
    ----------
    what : str
        What was asked for, such as "move to a position".
    reason : str
        Why it was refused.
    go : callable
        Makes the movement after all.
    """

    axis: str
    what: str
    reason: str
    go: Callable[[], None]


@dataclass(frozen=True, slots=True)
class _Command:
    what: str
    make: Make
    field: QWidget | None
    movement: Movement
    consented: bool
    goal: Goal | None = None
    detour: bool = False
    why: Callable[[], str] = str


class AxisCommands(QObject):
    """Issues the commands of one card and tells how the newest of them ended; GUI thread.

    Signals
    -------
    begun()
        A command was given.
    refused(QWidget or None, str)
        It was refused, with the field it came from and the reason.
    verdict_given(MoveVerdict)
        The gate's own words to a refusal, also of a jog that stops in front of something.
    refusal_over()
        What was refused before holds no longer: the axis has moved since, or the stop was reset.
    busy_refused(str)
        It was refused as something else moves the axes; with what.
    ended(str)
        It ended; the text says why, and is empty at its target.
    consent_wanted(ConsentRequest)
        It was refused for an unknown position only.
    detour_wanted(DetourRequest)
        Something stands in its way, and a detour may be planned.
    noted(str)
        What to say of it meanwhile.
    """

    begun = Signal()
    refused = Signal(object, str)
    verdict_given = Signal(object)
    refusal_over = Signal()
    busy_refused = Signal(str)
    ended = Signal(str)
    consent_wanted = Signal(object)
    detour_wanted = Signal(object)
    noted = Signal(str)

    def __init__(self, axis_name: str, parent: QObject) -> None:
        super().__init__(parent)
        self._axis_name = axis_name
        self._relay = Relay(self._on_ended)
        self._newest: _Command | None = None
        self._series: StepwiseMove | None = None
        self._moved = self._moving = False
        self._rested_at: float | None = None
        self._refused_wall_s = 0.0
        self._blocked: _Command | None = None
        self.busy: Callable[[], str] = str
        """Returns why the operator moves nothing now; empty where nothing speaks against it."""
        self.plans_detours = False
        """Have a detour planned where something stands in the way of a move to a goal.

        A command keeps what was wanted when it was given: the gate answers later.
        """

    @property
    def series(self) -> StepwiseMove | None:
        """The series of parts that is moving."""
        series = self._series
        return series if series is not None and not series.done else None

    def note_state(self, state: PositionerState) -> None:
        """Take what is seen of the axis: moving, a stop interrupts it and refuses nothing."""
        self._moved = self._moved or state.in_motion
        if state.read_wall_s < self._refused_wall_s:
            return
        here, before = state.position, self._rested_at
        begins = state.in_motion and not self._moving
        # A short movement is over before it is seen.
        away = here is not None and before is not None and abs(here - before) > SEEN[state.unit]
        self._moving = state.in_motion
        self._rested_at = None if state.in_motion else here
        if begins or away:
            self.refusal_over.emit()

    def note_refusal(self, state: PositionerState) -> None:
        """Take the newest state at a refusal: on a busy computer older ones are seen after it."""
        self._refused_wall_s, self._moving = state.read_wall_s, state.in_motion
        self._rested_at = None if state.in_motion else state.position

    def issue(
        self, what: str, make: Make, field: QWidget | None = None, *, goal: Goal | None = None
    ) -> None:
        """Give a command; how it goes is published by the signals.

        With a `goal`, a detour may be planned where something stands in the way.
        """
        detour = goal is not None and self.plans_detours
        command = _Command(what, make, field, Movement(), consented=False, goal=goal, detour=detour)
        self._issue(command)

    def _issue(self, command: _Command) -> None:
        if self.refuse_busy(command.field):
            return
        self.abandon_series()
        self._newest = self._blocked = None
        self._moved = False
        try:
            made = command.make(command.consented)
        except CosmicError as exc:
            self._fail(command, exc)
            return
        if isinstance(made, StepwiseMove):
            self._series = made
        movement = made.movement if isinstance(made, StepwiseMove) else made
        self._newest = replace(command, movement=movement)
        self.begun.emit()
        movement.add_callback(self._relay)

    def refuse_busy(self, field: QWidget | None = None) -> bool:
        """Refuse what is wanted while something else moves the axes; tells whether it did."""
        why = self.busy()
        if why:
            self.refused.emit(field, why)
            self.busy_refused.emit(why)
        return bool(why)

    def abandon_series(self) -> None:
        """Let a series begin no further part: something newer is about to come."""
        if self._series is not None:
            self._series.abandon()
            self._series = None

    def follow(self, what: str, movement: Movement, *, why: Callable[[], str] = str) -> None:
        """Report how a movement ends that was begun elsewhere, such as a jog.

        `why` is asked when it ends without an error, or is cancelled; empty is a good end.
        """
        self._newest = _Command(
            what, lambda _consent: movement, None, movement, consented=True, why=why
        )
        self._blocked = None
        self._moved = False
        self.begun.emit()
        movement.add_callback(self._relay)

    def _on_ended(self, movement: Movement) -> None:
        command = self._newest
        if command is None or command.movement is not movement:
            return
        error = movement.exception()
        if isinstance(error, CosmicError):
            self._fail(command, error)
        else:
            self.ended.emit(command.why() if error is None else str(error))

    def _fail(self, command: _Command, error: CosmicError) -> None:
        if not isinstance(error, MoveRefused):
            self.ended.emit(command.why() if isinstance(error, MoveCancelled) else str(error))
            return
        reason = error.verdict.reason
        if reason is Reason.COLLISION and command.goal is not None and command.detour:
            self._want_detour(command, command.goal, error.verdict)
            return
        self.verdict_given.emit(error.verdict)
        if reason is Reason.STOPPED and self._moved:
            self.ended.emit(str(error))
            return
        unknown = reason is Reason.POSITION_UNKNOWN
        if not unknown or command.consented:
            helps = reason is Reason.COLLISION and command.goal is not None
            self.refused.emit(command.field, f"{error}\n{HINT}" if helps else str(error))
            return
        self.consent_wanted.emit(
            ConsentRequest(self._axis_name, command.what, str(error), lambda: self._agree(command))
        )

    def _agree(self, command: _Command) -> None:
        self._issue(replace(command, consented=True))

    def _want_detour(self, command: _Command, goal: Goal, verdict: MoveVerdict) -> None:
        self._blocked = command
        request = DetourRequest(
            axis=self._axis_name,
            target=goal.target,
            where=goal.text,
            verdict=verdict,
            note=lambda text: self._note_detour(command, text),
            refuse=lambda why: self._refuse_detour(command, why),
        )
        self.detour_wanted.emit(request)

    def _note_detour(self, command: _Command, text: str) -> None:
        if command is self._blocked:
            self.noted.emit(text)

    def _refuse_detour(self, command: _Command, verdict: MoveVerdict) -> None:
        """Refuse it now, unless something newer was commanded meanwhile."""
        if command is not self._blocked:
            return
        self._blocked = None
        self.verdict_given.emit(verdict)
        self.refused.emit(command.field, str(verdict))
