"""Checking a trajectory against a platform, and working out where each line goes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from cosmic.frame.units import AxisUnit, format_quantity
from cosmic.mico.core.motion.checks import ROUNDING
from cosmic.mico.core.motion.orders import (
    COMMON,
    Motion,
    MoveBy,
    MoveTo,
    Step,
)
from cosmic.mico.core.motion.positioner import PositionerState, class_for
from cosmic.mico.core.motion.settings import MotionDefaults
from cosmic.mico.core.poses import Pose
from cosmic.mico.core.trajectory.model import (
    Leg,
    Move,
    Problem,
    Speed,
    Steps,
    Trajectory,
    TrajectoryError,
    Wait,
)

MOST_PROBLEMS: Final = 200


@dataclass(frozen=True, slots=True)
class AxisFacts:
    """What a trajectory must respect of one axis; limits in gate coordinates.

    Attributes
    ----------
    most_steps, frequency_hz, amplitude_v : int, tuple of int, tuple of float
        The ranges of its controller.
    """

    unit: AxisUnit
    has_sensor: bool
    limits: tuple[float, float] | None
    most_steps: int = COMMON.most_steps
    frequency_hz: tuple[int, int] = COMMON.frequency_hz
    amplitude_v: tuple[float, float] = COMMON.amplitude_v

    @classmethod
    def of(cls, state: PositionerState) -> "AxisFacts":
        """Return what is known of an axis."""
        return cls(
            unit=state.unit,
            has_sensor=class_for(state.kind, state.positioner).has_sensor,
            limits=state.limits,
            most_steps=state.most_steps,
            frequency_hz=state.frequency_range_hz,
            amplitude_v=state.amplitude_range_v,
        )


@dataclass(frozen=True, slots=True)
class PlatformFacts:
    """What a trajectory is checked against.

    Attributes
    ----------
    name : str
        Of the platform; empty accepts trajectories of every platform.
    """

    name: str
    axes: Mapping[str, AxisFacts]
    defaults: MotionDefaults
    poses: Mapping[str, Pose] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class BoundLeg:
    """Movements that begin together, in gate coordinates.

    A distance stays one (`MoveBy`) only while nobody knows where its axis stands.
    """

    motions: Mapping[str, Motion]
    line: int
    at_s: float | None = None


@dataclass(frozen=True, slots=True)
class BoundSpeed:
    """From here on, the closed-loop frequency of an axis; None: the usual one."""

    axis: str
    frequency_hz: int | None
    line: int


BoundStep = BoundLeg | BoundSpeed | Wait


@dataclass(frozen=True, slots=True)
class Bound:
    """A trajectory on a platform.

    Attributes
    ----------
    start : mapping of float
        Where its axes stand before the first line, as far as that is known, in gate coordinates.
    """

    trajectory: Trajectory
    steps: tuple[BoundStep, ...]
    start: Mapping[str, float]


def bind(
    trajectory: Trajectory,
    facts: PlatformFacts,
    positions: Mapping[str, float] | None = None,
) -> Bound:
    """Check a trajectory on a platform and return where each of its lines goes.

    Parameters
    ----------
    positions : mapping of float or None
        Where axes stand that the trajectory does not give a start for, in gate coordinates.

    Raises
    ------
    TrajectoryError
        It does not fit; names each line.
    """
    binder = _Binder(trajectory, facts, dict(positions or {}))
    bound = binder.bind()
    if binder.problems:
        name = str(trajectory.path) if trajectory.path else trajectory.name
        raise TrajectoryError(name, binder.problems)
    return bound


class _Binder:
    def __init__(
        self, trajectory: Trajectory, facts: PlatformFacts, positions: dict[str, float]
    ) -> None:
        self._trajectory = trajectory
        self._facts = facts
        self._at = positions
        self._zero: dict[str, float] = {}
        self.problems: list[Problem] = []

    def bind(self) -> Bound:
        """Look at everything in the order of the lines."""
        self._check_platform()
        self._find_pose()
        self._take_start()
        start = dict(self._at)
        steps: list[BoundStep] = []
        for each in self._trajectory.statements:
            if len(self.problems) >= MOST_PROBLEMS:
                break
            match each:
                case Wait():
                    steps.append(each)
                case Speed():
                    steps.append(self._speed(each))
                case Leg():
                    motions = {part.axis: self._motion(part) for part in each.parts}
                    found = {axis: motion for axis, motion in motions.items() if motion}
                    steps.append(BoundLeg(found, each.line, each.at_s))
        return Bound(self._trajectory, tuple(steps), start)

    def _add_problem(self, line: int, text: str) -> None:
        self.problems.append(Problem(line, text))

    def _check_platform(self) -> None:
        wanted, here = self._trajectory.platform, self._facts.name
        if here and wanted != here:
            text = f"it is for the platform {wanted!r}, and this one is {here!r}"
            self._add_problem(self._trajectory.platform_line, text)

    def _find_pose(self) -> None:
        """Find out what relative positions count from."""
        name, line = self._trajectory.pose, self._trajectory.pose_line
        if not name:
            return
        pose = self._facts.poses.get(name)
        if pose is None:
            known = ", ".join(self._facts.poses) or "none"
            self._add_problem(line, f"there is no pose {name!r}; known poses: {known}")
            return
        wanted = self._trajectory.pose_axes or self._trajectory.axes
        for axis in dict.fromkeys((*wanted, *self._trajectory.start)):
            facts = self._facts.axes.get(axis)
            if facts is None or not facts.has_sensor or not self._trajectory.is_relative(axis):
                continue
            if axis not in pose.positions:
                text = f"the pose {name!r} has no position of {axis}; teach it with {axis}"
                self._add_problem(line, text)
            else:
                self._zero[axis] = pose.positions[axis]

    def _take_start(self) -> None:
        for axis, position in self._trajectory.start.items():
            facts = self._known(axis, position.line)
            if facts is None or not facts.has_sensor:
                continue
            if position.unit != facts.unit:
                self._add_problem(
                    position.line, f"{axis} is counted in {facts.unit}, not in {position.unit}"
                )
                continue
            self._reach(axis, position.value + self._zero.get(axis, 0.0), facts, position.line)

    def _known(self, axis: str, line: int) -> AxisFacts | None:
        facts = self._facts.axes.get(axis)
        if facts is None:
            known = ", ".join(self._facts.axes) or "none"
            self._add_problem(line, f"there is no axis {axis!r}; known axes: {known}")
        return facts

    def _reach(self, axis: str, target: float, facts: AxisFacts, line: int) -> None:
        """Have the axis stand at `target`, which must be within its limits."""
        self._at[axis] = target
        if facts.limits is None:
            return
        low, high = facts.limits
        if not low - ROUNDING <= target <= high + ROUNDING:
            limit = format_quantity(high if target > high else low, facts.unit)
            where = format_quantity(target, facts.unit)
            self._add_problem(line, f"{axis}: {where} is outside its limit {limit}")

    def _motion(self, part: Move | Steps) -> Motion | None:
        facts = self._known(part.axis, part.line)
        if facts is None:
            return None
        if isinstance(part, Steps):
            return self._steps(part, facts)
        return self._move(part, facts)

    def _move(self, part: Move, facts: AxisFacts) -> Motion | None:
        axis = part.axis
        if not facts.has_sensor:
            text = f"{axis} has no sensor; move it by steps, such as: steps {axis} 100"
            self._add_problem(part.line, text)
            return None
        if part.unit != facts.unit:
            self._add_problem(part.line, f"{axis} is moved in {facts.unit}, not in {part.unit}")
            return None
        if not part.by:
            self._reach(axis, part.value + self._zero.get(axis, 0.0), facts, part.line)
        elif axis in self._at:
            self._reach(axis, self._at[axis] + part.value, facts, part.line)
        else:
            return MoveBy(part.value, facts.unit)
        return MoveTo(self._at[axis], facts.unit)

    def _steps(self, part: Steps, facts: AxisFacts) -> Motion | None:
        defaults = self._facts.defaults
        volts = defaults.amplitude_v if part.amplitude_v is None else part.amplitude_v
        hertz = defaults.frequency_hz if part.frequency_hz is None else part.frequency_hz
        checks = (
            (part.steps, -facts.most_steps, facts.most_steps, "steps"),
            (volts, *facts.amplitude_v, "V"),
            (hertz, *facts.frequency_hz, "Hz"),
        )
        for value, low, high, unit in checks:
            if not low <= value <= high:
                text = f"{part.axis}: {value:g} {unit} is outside {low:g} to {high:g} {unit}"
                self._add_problem(part.line, text)
                return None
        self._at.pop(part.axis, None)
        return Step(part.steps, volts, hertz)

    def _speed(self, each: Speed) -> BoundSpeed:
        facts = self._known(each.axis, each.line)
        if facts is None or each.value is None:
            return BoundSpeed(each.axis, None, each.line)
        if not facts.has_sensor:
            text = f"{each.axis} has no sensor; give the frequency with its steps"
            self._add_problem(each.line, text)
            return BoundSpeed(each.axis, None, each.line)
        hertz = each.value
        if each.unit != "Hz":
            if each.unit != f"{facts.unit}/s":
                text = f"the speed of {each.axis} is in {facts.unit}/s or Hz, not in {each.unit}"
                self._add_problem(each.line, text)
            hertz /= nominal_step(self._facts.defaults, facts.unit)
        low, high = facts.frequency_hz
        whole = max(1, round(hertz)) if hertz < high + 1 else high + 1
        if not low <= whole <= high:
            top = high * nominal_step(self._facts.defaults, facts.unit)
            text = f"{each.axis} goes at most {top:g} {facts.unit}/s ({high} Hz)"
            self._add_problem(each.line, text)
        return BoundSpeed(each.axis, whole, each.line)


def nominal_step(defaults: MotionDefaults, unit: AxisUnit) -> float:
    """Return how far a closed-loop step goes, which makes a frequency of a speed."""
    return defaults.nominal_step_deg if unit == "deg" else defaults.nominal_step_um
