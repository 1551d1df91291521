"""A recorded procedure carried out: each step is an operation of the one procedure engine."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from threading import Event as Flag
from typing import Final

import numpy as np
from typing_extensions import override

from cosmic.autonomy.handling.context import FibreOperation, HandlingContext
from cosmic.autonomy.handling.force import ForceMean, ForceWatch
from cosmic.autonomy.handling.jaws import move_jaws
from cosmic.autonomy.handling.manual_operations import PushToForce
from cosmic.autonomy.handling.marked import MarkedFibre
from cosmic.autonomy.handling.prepare import make_safe
from cosmic.autonomy.procedures.combinators import Sequence
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed, Steps
from cosmic.autonomy.procedures.procedure import Part, Procedure
from cosmic.autonomy.recorded.steps import (
    FIBRE,
    PLATE,
    PLATFORM,
    GripperStep,
    LensStep,
    LightStep,
    MoveStep,
    OperationStep,
    PauseStep,
    RecordedProcedure,
    RecordedStep,
    RecordStep,
    WaitForForceStep,
    WaitForOperatorStep,
)
from cosmic.autonomy.shipped.operation_procedures import (
    build_bring,
    build_measure,
    build_push,
    build_put_away,
    build_take,
)
from cosmic.autonomy.shipped.single_operation import SingleOperation
from cosmic.daqco.api.daqco import Daqco
from cosmic.frame.arrays import Floats
from cosmic.frame.errors import ConfigError, DeviceTimeout
from cosmic.mico.core.motion.positioner import positions_of

LOOK_S: Final = 0.05
"""Over which a force is averaged while it is waited for."""
NO_FIBRE: Final = "no fibre marked"


class OperatorSignal:
    """What an operation waits for until the operator goes on; any thread."""

    def __init__(self) -> None:
        self._flag = Flag()

    def give(self) -> None:
        """Go on."""
        self._flag.set()

    def again(self) -> "OperatorSignal":
        """Wait anew."""
        self._flag.clear()
        return self

    @property
    def done(self) -> bool:
        """It was said to go on."""
        return self._flag.is_set()

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait for it; raises `DeviceTimeout`."""
        if not self._flag.wait(timeout_s):
            raise DeviceTimeout("the operator did not go on")

    def cancel(self) -> None:
        """Wait no longer."""
        self._flag.set()


@dataclass(slots=True, eq=False)
class Surroundings:
    """What a replay needs beside the platform.

    Attributes
    ----------
    marked : MarkedFibre or None
        The fibre it is replayed on.
    folder : callable
        Returns the folder that recordings go to.
    asks : callable
        Called with the words of a step that waits for the operator, and with "" when it goes on.
    recording : Path or None
        What a step has begun to record last.
    """

    marked: MarkedFibre | None = None
    folder: Callable[[], Path] = Path
    asks: Callable[[str], object] = str
    going_on: OperatorSignal = field(default_factory=OperatorSignal)
    recording: Path | None = None

    def ask(self, confirm: Callable[[str], bool]) -> None:
        """Have steps that wait for the operator ask `confirm`; raises `OperationFailed` at no."""

        def asks(words: str) -> None:
            if words and not confirm(words):
                raise OperationFailed("ended", f"{words}: it was not to go on")
            self.going_on.give()

        self.asks = asks

    def end_recording(self, daqco: Daqco) -> None:
        """End the recording that the replay began, where it still runs."""
        state = daqco.recording
        if self.recording is not None and state.active and state.path == self.recording:
            daqco.stop_recording()


def frame_of(work: HandlingContext, relative_to: str, marked: MarkedFibre | None) -> Floats:
    """Return where x and y are counted from on the platform now, um, shape (2,).

    Raises
    ------
    OperationFailed
        No fibre is marked.
    CosmicError
        The positions or the calibration are not known.
    """
    if relative_to == FIBRE:
        if marked is None:
            raise OperationFailed(NO_FIBRE, "mark a fibre in the image, then replay on it")
        on_plate = marked.on_plate(work)
        line = work.calibration.frame.on_platform(on_plate, work.table_deg)
        return np.asarray(line.mean(axis=0), dtype=np.float64)
    if relative_to in (PLATFORM, PLATE):
        origin = (0.0, 0.0) if relative_to == PLATFORM else work.calibration.frame.centre_um
        return np.array(origin)
    return np.array(work.tip_now(work.tool(relative_to)))


def turn_of(work: HandlingContext, relative_to: str) -> Floats:
    """Return the rotation from the frame to the platform: that of the plate turns with it."""
    angle = math.radians(work.table_deg) if relative_to == PLATE else 0.0
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin], [sin, cos]])


class _OneStep(FibreOperation):
    def __init__(self, step: RecordedStep, around: Surroundings) -> None:
        self._step, self._around = step, around
        self.name = step.words


class Moving(_OneStep):
    """Carries out a `MoveStep`: all axes together, past the gate."""

    @override
    def steps(self, work: HandlingContext) -> Steps:
        step = self._step
        assert isinstance(step, MoveStep)
        targets = dict(step.axes)
        if step.tool:
            tool = work.tool(step.tool)
            origin = frame_of(work, step.relative_to, self._around.marked)
            x, y = (origin + turn_of(work, step.relative_to) @ np.array(step.point_um[:2])).tolist()
            height = step.point_um[2] if tool.z_axis else None
            targets |= work.at(tool, x, y, height)
        yield work.go(targets)
        yield SAFE_POINT


class Opening(_OneStep):
    """Carries out a `GripperStep`."""

    @override
    def steps(self, work: HandlingContext) -> Steps:
        step = self._step
        assert isinstance(step, GripperStep)
        if step.tool != work.settings.gripper:
            raise OperationFailed(
                "another gripper", f"this procedure is replayed with {work.settings.gripper}"
            )
        here = work.mico[work.gripper.gap_axis].position_um
        if here is None:
            raise OperationFailed("opening unknown", "initialise the platform")
        yield from move_jaws(work, step.opening_um - here)
        if work.fibre is not None:
            work.fibre.note_opening(step.opening_um)
        yield SAFE_POINT


class Lensing(_OneStep):
    """Carries out a `LensStep`."""

    @override
    def steps(self, work: HandlingContext) -> Steps:
        step, lens = self._step, work.vico.lens
        assert isinstance(step, LensStep)
        if lens is None:
            raise OperationFailed("no lens", "this platform has no lens")
        work.shared.zoomed = None
        if step.zoom is not None:
            yield lens.zoom_to(step.zoom)
        if step.focus_counts is not None:
            yield lens.seek_focus(step.focus_counts)
        yield SAFE_POINT


class Lighting(_OneStep):
    """Carries out a `LightStep`."""

    @override
    def steps(self, work: HandlingContext) -> Steps:
        step, light = self._step, work.vico.light
        assert isinstance(step, LightStep)
        if light is None:
            raise OperationFailed("no light", "this platform has no light")
        yield light.set_percent(step.percent)
        yield SAFE_POINT


class Recording(_OneStep):
    """Carries out a `RecordStep`; a recording that was begun ends with the replay."""

    @override
    def steps(self, work: HandlingContext) -> Steps:
        step, daqco = self._step, work.daqco
        assert isinstance(step, RecordStep)
        if daqco.recording.active:
            daqco.stop_recording()
        if step.name:
            plain = re.sub(r"[^\w-]+", "-", step.name).strip("-") or "recording"
            path = _free(self._around.folder(), plain)
            daqco.start_recording(path)
            self._around.recording = daqco.recording.path or path
        yield SAFE_POINT


def _free(folder: Path, name: str) -> Path:
    """Return a path in a folder that is not taken yet."""
    numbers = (f"{name}_{number}.h5" for number in count(1))
    return next(folder / each for each in numbers if not (folder / each).exists())


class WaitingForForce(_OneStep):
    """Carries out a `WaitForForceStep`."""

    @override
    def steps(self, work: HandlingContext) -> Steps:
        step = self._step
        assert isinstance(step, WaitForForceStep)
        forces = ForceWatch(work.daqco, step.channel, work.clock)
        if (unit := work.daqco.units[step.channel]) != "uN":
            raise OperationFailed("no force", f"{step.channel} is measured in {unit}, not in uN")
        until_s = work.clock.now_s() + step.timeout_s
        forces.open()
        try:
            while work.clock.now_s() < until_s:
                mean = yield forces.wanted(LOOK_S)
                if isinstance(mean, ForceMean) and abs(mean.mean_un) >= step.force_un:
                    return
        finally:
            forces.close()
        raise OperationFailed(
            "force not reached", f"{step.force_un:g} µN was not reached in {step.timeout_s:g} s"
        )


class WaitingForOperator(_OneStep):
    """Carries out a `WaitForOperatorStep`: rests until the operator, or a mark, says go on."""

    @override
    def steps(self, work: HandlingContext) -> Steps:
        around = self._around
        signal = around.going_on.again()  # before it is asked: the answer may be there at once
        try:
            around.asks(self._step.words)
            yield signal
        finally:
            around.asks("")
        yield SAFE_POINT


class Pausing(_OneStep):
    """Carries out a `PauseStep`."""

    @override
    def steps(self, work: HandlingContext) -> Steps:
        step = self._step
        assert isinstance(step, PauseStep)
        yield step.seconds


_KINDS: Final[dict[type[RecordedStep], type[_OneStep]]] = {
    MoveStep: Moving,
    GripperStep: Opening,
    LensStep: Lensing,
    LightStep: Lighting,
    RecordStep: Recording,
    WaitForForceStep: WaitingForForce,
    WaitForOperatorStep: WaitingForOperator,
    PauseStep: Pausing,
}


def build_recorded(
    procedure: RecordedProcedure, work: HandlingContext, around: Surroundings
) -> Procedure[HandlingContext]:
    """Return a recorded procedure as one that can be run.

    Raises
    ------
    ConfigError
        A step cannot be carried out here; the text says which.
    """
    parts = [_part(each, work, around) for each in procedure.step]
    return Procedure(procedure.name, Sequence(procedure.name, *parts), make_safe=make_safe)


def _part(step: RecordedStep, work: HandlingContext, around: Surroundings) -> Part[HandlingContext]:
    if not isinstance(step, OperationStep):
        return _KINDS[type(step)](step, around)
    if step.operation is SingleOperation.TAKE:
        if around.marked is None:
            raise ConfigError(f"{step.words}: mark a fibre in the image, then replay on it")
        return build_take(work.settings, around.marked).root
    if step.operation is SingleOperation.PUSH:
        most = work.settings.push.limit_un  # said now, not when the fibre is before the probe
        if not 0.0 < step.force_un <= most:
            raise ConfigError(f"{step.words}: the force is not between 0 and {most:g} µN")
        return build_push(PushToForce(step.force_un)).root
    builds = {
        SingleOperation.BRING: build_bring,
        SingleOperation.MEASURE: build_measure,
        SingleOperation.PUT_AWAY: build_put_away,
    }
    if step.operation not in builds:
        raise ConfigError(f"{step.words} cannot be part of a recorded procedure")
    return builds[step.operation]().root


def point_in(
    work: HandlingContext, tool_name: str, relative_to: str, marked: MarkedFibre | None
) -> tuple[float, float, float]:
    """Return where a tip is now, counted in a frame; raises as `frame_of`."""
    tool = work.tool(tool_name)
    origin, turn = frame_of(work, relative_to, marked), turn_of(work, relative_to)
    x, y = (turn.T @ (np.array(work.tip_now(tool)) - origin)).tolist()
    positions = positions_of(work.mico.states())
    height = positions.get(tool.z_axis, 0.0) + tool.tip_um[2] + work.up_um(tool)
    return round(x, 1), round(y, 1), round(height if tool.z_axis else 0.0, 1)
