"""`ProcedureRecorder`: watches what is done by hand, and notes it as steps of a procedure."""

from collections.abc import Callable
from typing import Final

from cosmic.autonomy.handling.context import Applications, HandlingContext, vision_of
from cosmic.autonomy.handling.marked import MarkedFibre
from cosmic.autonomy.recorded.operations import point_in
from cosmic.autonomy.recorded.steps import (
    PLATFORM,
    GripperStep,
    LensStep,
    LightStep,
    MoveStep,
    OperationStep,
    RecordedStep,
    RecordStep,
)
from cosmic.autonomy.shipped.fibre_handling import FibreHandling
from cosmic.autonomy.shipped.single_operation import SingleOperation
from cosmic.mico.core.motion.positioner import PositionerState
from cosmic.vico.hw.peripherals import LensAxis

_MOVED: Final = 0.3
"""Less than so much, um or deg, is no movement."""
_PART: Final = 0.005
"""Of a zoom: less is the same zoom."""


class ProcedureRecorder:
    """Looks at the platform again and again, and notes what has come to rest elsewhere.

    It does not matter by what something was moved: pad, image, key or gamepad. What an operation
    on a fibre moves is noted as that operation.

    Parameters
    ----------
    rig : Applications
        The platform.
    handling : FibreHandling
        Whose operations are noted.
    marked : callable
        Returns the fibre that points are counted from; None for none.
    """

    def __init__(
        self,
        rig: Applications,
        handling: FibreHandling,
        marked: Callable[[], MarkedFibre | None],
    ) -> None:
        self._rig, self._handling, self._marked = rig, handling, marked
        self.steps: list[RecordedStep] = []
        self.relative_to = PLATFORM
        self._tools = {each.name: each for each in vision_of(rig.vico).settings.tool}
        self._at: dict[str, float] = {}
        self._zoom: float | None = None
        self._focus: int | None = None
        self._light: float | None = None
        self._recording = False
        self._operation: object = None
        self.begin()

    @property
    def _work(self) -> HandlingContext:
        return self._handling.context(self._handling.held_by or self._handling.grippers[0])

    def begin(self) -> None:
        """Take everything as it is now for the beginning."""
        self._at = {
            name: each.position
            for name, each in self._rig.mico.states().items()
            if each.position is not None
        }
        lens, light = self._rig.vico.lens, self._rig.vico.light
        self._zoom = lens.zoom if lens is not None else None
        self._focus = self._focus_now()
        self._light = light.percent if light is not None else None
        self._recording = self._rig.daqco.recording.active
        self._operation = self._handling.result

    def look(self) -> bool:
        """Note what has come to rest elsewhere since the last look; True where that is anything."""
        if self._handling.running:
            return False
        before = len(self.steps)
        if self._handling.result is not self._operation:
            self._note_operation()
            self.begin()
            return len(self.steps) > before
        self._note_moves()
        self._note_lens()
        self._note_light()
        self._note_recording()
        return len(self.steps) > before

    def _note_operation(self) -> None:
        request, result = self._handling.request, self._handling.result
        if request is None or result is None or not result.good:
            return
        if request.operation not in (SingleOperation.UNDO, SingleOperation.CLOSE):
            step = OperationStep(
                operation=request.operation, gripper=request.gripper, force_un=request.force_un
            )
            if request.operation is SingleOperation.PUSH:
                step = step.model_copy(update={"ask": {"force_un": "Force to push to, µN"}})
            self.steps.append(step)

    def _note_moves(self) -> None:
        states = self._rig.mico.states()
        if any(each.in_motion for each in states.values()):
            return
        moved = {name: each for name, each in states.items() if self._has_moved(each)}
        for tool in self._tools.values():
            axes = [each for each in (tool.x_axis, tool.y_axis, tool.z_axis) if each in moved]
            if axes:
                point = point_in(self._work, tool.name, self.relative_to, self._marked())
                relative = self.relative_to if self.relative_to != tool.name else PLATFORM
                if relative != self.relative_to:
                    point = point_in(self._work, tool.name, PLATFORM, None)
                self.steps.append(MoveStep(tool=tool.name, point_um=point, relative_to=relative))
            if tool.gap_axis in moved:
                opening = max(0.0, moved[tool.gap_axis].position or 0.0)
                self.steps.append(GripperStep(tool=tool.name, opening_um=round(opening, 1)))
            for each in (*axes, tool.gap_axis):
                self._take(moved.pop(each, None))
        others = {name: round(each.position or 0.0, 2) for name, each in moved.items()}
        if others:
            self.steps.append(MoveStep(axes=others))
        for state in moved.values():
            self._take(state)

    def _has_moved(self, state: PositionerState) -> bool:
        if state.position is None:
            return False
        return abs(state.position - self._at.get(state.name, state.position)) > _MOVED

    def _take(self, state: PositionerState | None) -> None:
        if state is not None and state.position is not None:
            self._at[state.name] = state.position

    def _focus_now(self) -> int | None:
        lens = self._rig.vico.lens
        state = lens.state(LensAxis.FOCUS) if lens is not None else None
        return state.position_counts if state is not None and state.homed else None

    def _note_lens(self) -> None:
        lens = self._rig.vico.lens
        if lens is None:
            return
        states = [lens.state(axis) for axis in LensAxis]
        if any(state is None or state.moving or not state.homed for state in states):
            return
        zoom, focus = lens.zoom, self._focus_now()
        known = self._zoom is not None and self._focus is not None
        zoomed = known and zoom is not None and abs(zoom - (self._zoom or 0.0)) > _PART * zoom
        focused = known and focus != self._focus
        if zoomed or focused:
            step = LensStep(
                zoom=round(zoom, 3) if zoomed and zoom is not None else None,
                focus_counts=focus if focused else None,
            )
            self.steps.append(step)
        self._zoom, self._focus = zoom, focus

    def _note_light(self) -> None:
        light = self._rig.vico.light
        percent = light.percent if light is not None else None
        before, self._light = self._light, percent if percent is not None else self._light
        if before is not None and percent is not None and percent != before:
            if self.steps and isinstance(self.steps[-1], LightStep):
                self.steps.pop()  # a slider that is dragged: the last counts
            self.steps.append(LightStep(percent=round(percent, 1)))

    def _note_recording(self) -> None:
        recording = self._rig.daqco.recording
        if recording.active != self._recording:
            self._recording = recording.active
            name = "recording" if recording.path is None else recording.path.stem
            self.steps.append(RecordStep(name=name if recording.active else ""))
