"""What the configured steps come to on the platform as it stands; pure."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

from cosmic.mico.core.motion.orders import Calibrate, Motion, MoveTo, Reference, Step, ToEndStop
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.core.sequence.settings import StepKind, StepSettings
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import Direction, PositionerKind, ReferenceKind

_FINDS: Final = (StepKind.CALIBRATE, StepKind.REFERENCE, StepKind.END_STOP, StepKind.ZERO)
"""Steps by which an axis gets to know where it is."""
_WORDS: Final = {
    StepKind.CALIBRATE: "calibrating",
    StepKind.REFERENCE: "referencing",
    StepKind.END_STOP: "driving to the end stop",
    StepKind.ZERO: "setting zero",
    StepKind.MOVE: "moving",
    StepKind.OPEN_GRIPPER: "opening",
    StepKind.CLOSE_GRIPPER: "closing",
}


@dataclass(frozen=True)
class PlannedStep:
    """One step, ready to be made.

    Attributes
    ----------
    title : str
        What it does, for the operator.
    motions : mapping of Motion
        What its axes do, all at once.
    zeros : tuple of str
        Axes whose zero is set where they stand.
    left_out : tuple of str
        Why axes that it names are left out, a text each.
    """

    kind: StepKind
    title: str
    motions: Mapping[str, Motion] = field(default_factory=dict)
    zeros: tuple[str, ...] = ()
    wait_s: float = 0.0
    text: str = ""
    left_out: tuple[str, ...] = ()

    @property
    def idle(self) -> bool:
        """True when there is nothing left to do."""
        return self.kind.moves and not self.motions and not self.zeros


def plan_sequence(
    settings: MicoSettings, states: Mapping[str, PositionerState], *, skip_known: bool = False
) -> tuple[PlannedStep, ...]:
    """Return the steps of the sequence as they are to be made.

    Without configured steps every axis is referenced by itself, in the order of the positioners,
    and goes to its start pose in the opposite order.

    Parameters
    ----------
    states : mapping of PositionerState
        Every axis as it is now.
    skip_known : bool
        Leave out of the steps that find positions those axes whose position is known.
    """
    steps = settings.initialisation.step or _usual_steps(settings)
    return tuple(_Planner(settings, states, skip_known=skip_known).plan(step) for step in steps)


def _usual_steps(settings: MicoSettings) -> tuple[StepSettings, ...]:
    sensed = [each for each in settings.positioner if each.kind != "open-loop"]
    found = [StepSettings(do="reference", axes=(each.name,)) for each in sensed]
    moves = [
        StepSettings(do="move", axes=(each.name,))
        for each in reversed(sensed)
        if each.start is not None
    ]
    return (*found, *moves)


class _Planner:
    def __init__(
        self, settings: MicoSettings, states: Mapping[str, PositionerState], *, skip_known: bool
    ) -> None:
        self._settings = settings
        self._states = states
        self._skip_known = skip_known
        self._starts = {each.name: each.start for each in settings.positioner}

    def plan(self, step: StepSettings) -> PlannedStep:
        """Return what one step comes to."""
        if step.kind is StepKind.WAIT:
            wait_s = step.wait_s or 0.0
            return PlannedStep(step.kind, f"waiting {wait_s:g} s", wait_s=wait_s)
        if step.kind is StepKind.CONFIRM:
            return PlannedStep(step.kind, f"asking: {step.text}", text=step.text)
        motions: dict[str, Motion] = {}
        zeros: list[str] = []
        left_out: list[str] = []
        for name in self._axes(step):
            why = self._why_not(step, name)
            if why:
                left_out.append(f"{name} {why}")
            elif step.kind is StepKind.ZERO:
                zeros.append(name)
            else:
                motions[name] = self._motion(step, name)
        names = ", ".join([*motions, *zeros]) or ", ".join(self._axes(step))
        return PlannedStep(
            step.kind,
            f"{_WORDS[step.kind]} {names}",
            motions,
            tuple(zeros),
            left_out=tuple(left_out),
        )

    def _axes(self, step: StepSettings) -> Sequence[str]:
        members = [
            name
            for group in self._settings.group
            if group.title == step.group
            for name in group.positioners
            if (self._kind(name) is not PositionerKind.OPEN_LOOP) == step.kind.needs_sensor
        ]
        return list(dict.fromkeys((*step.names, *members)))

    def _kind(self, name: str) -> PositionerKind | None:
        return next(
            (each.positioner_kind for each in self._settings.positioner if each.name == name), None
        )

    def _why_not(self, step: StepSettings, name: str) -> str:
        """Return why an axis has nothing to do in `step`; empty when it has."""
        state = self._states.get(name)
        if state is None or not state.present:
            return "is not connected"
        known = state.confidence is Confidence.KNOWN
        if self._skip_known and known and step.kind in _FINDS:
            return "is known already"
        found = state.positioner
        unmarked = found is not None and found.reference is ReferenceKind.NONE
        if step.kind is StepKind.REFERENCE and unmarked:
            return "has no reference to find"
        if step.kind is StepKind.MOVE and self._target(step, name) is None:
            return "has no start pose"
        return ""

    def _target(self, step: StepSettings, name: str) -> float | None:
        return step.targets.get(name, self._starts.get(name))

    def _motion(self, step: StepSettings, name: str) -> Motion:
        make: dict[StepKind, Callable[[], Motion]] = {
            StepKind.CALIBRATE: Calibrate,
            StepKind.REFERENCE: Reference,
            StepKind.END_STOP: lambda: ToEndStop(Direction(step.direction or "backward")),
            StepKind.MOVE: lambda: self._move(step, name),
            StepKind.OPEN_GRIPPER: lambda: self._steps(step, 1),
            StepKind.CLOSE_GRIPPER: lambda: self._steps(step, -1),
        }
        return make[step.kind]()

    def _move(self, step: StepSettings, name: str) -> Motion:
        target = self._target(step, name)
        return MoveTo(0.0 if target is None else target, self._states[name].unit)

    def _steps(self, step: StepSettings, sign: int) -> Motion:
        usual = self._settings.defaults
        return Step(
            sign * (step.steps or usual.steps),
            step.amplitude_v or usual.amplitude_v,
            step.frequency_hz or usual.frequency_hz,
        )
