"""Before fibres are handled, and after: initialise, calibrate, make ready, leave safe."""

import logging
import math
from collections.abc import Collection, Generator
from dataclasses import replace
from typing import Final

from typing_extensions import override

from cosmic.autonomy.calibrating.calibrated import Calibrated, Holds
from cosmic.autonomy.calibrating.registry import CalibrationEntry, CalibrationRegistry
from cosmic.autonomy.handling.context import FibreOperation, HandlingContext
from cosmic.autonomy.handling.force_limit import guard_probe, probe_parked
from cosmic.autonomy.handling.jaws import in_step, zero_jaws
from cosmic.autonomy.handling.retrying_move import RetryingMove
from cosmic.autonomy.handling.tips import TIMES_STD, TipOff, shift_maps, tip_off
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed, Steps, Yielded
from cosmic.frame.errors import DeviceError, MoveRefused, NotAvailable
from cosmic.frame.verdict import Reason
from cosmic.mico.core.motion.positioner import Confidence
from cosmic.vico.api.lens import LensHandle
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.tool_settings import ToolSettings
from cosmic.vico.hw.peripherals import LensAxis

logger = logging.getLogger(__name__)

TRIES: Final = 4
APART_S: Final = 8.0


class InitialiseAgain(FibreOperation):
    """The sequence of the platform file, and meanwhile the lens is homed.

    The sequence only where a campaign is resumed whose run before ended without warning, or in the
    middle of this; the lens also where it was not homed. Whoever goes on with a campaign has
    consented to it.
    """

    name = "initialise again"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        wanted = work.shared.needs_initialisation
        lens = work.vico.lens
        if lens is None or lens.problem or not (wanted or _unhomed(work, lens)):
            lens = None
        if not wanted and lens is None:
            return
        if is_known(work):
            yield from retract_probe(work)  # while a jaw is beside it, no gripper can be lifted
        homing = None if lens is None else _Homing(lens, work.calibration.registry)
        try:
            if wanted:
                yield from _initialise(work)
            if homing is not None:
                yield from homing.steps(work)
        finally:
            if homing is not None:
                homing.end()
        work.shared.needs_initialisation, work.shared.zoomed = False, None
        yield SAFE_POINT


def is_known(work: HandlingContext) -> bool:
    """Return whether the positions of all that a run moves are known, or estimated."""
    axes = [work.table, *(axis for tool in tools_of(work) for axis in stages_of(tool))]
    return all(work.mico[axis].details.confidence is not Confidence.UNKNOWN for axis in axes)


def tools_of(work: HandlingContext) -> list[ToolSettings]:
    """Return the tools that a run moves."""
    names = [work.settings.gripper, work.settings.probe, work.settings.other]
    return [work.tool(name) for name in names if name]


def stages_of(tool: ToolSettings) -> tuple[str, ...]:
    """Return the axes that carry a tool."""
    return (tool.x_axis, tool.y_axis, *filter(None, [tool.z_axis]))


def _unhomed(work: HandlingContext, lens: LensHandle) -> bool:
    states = [lens.state(axis) for axis in LensAxis]
    lost = any(state is not None and not state.homed for state in states)
    return lost or work.calibration.registry.focus_before is not None


class _Homing:
    """The lens runs to where counting begins, and then focuses as before, or on what lies there.

    Where it was focused is kept until it is so again: whoever goes on after a stop needs it.
    """

    def __init__(self, lens: LensHandle, registry: CalibrationRegistry) -> None:
        focus = lens.state(LensAxis.FOCUS)
        self._lens = lens
        self._registry = registry
        if registry.focus_before is None and focus is not None and focus.homed:
            registry.focus_before = focus.position_counts
        self._task = lens.home()

    def steps(self, work: HandlingContext) -> Steps:
        yield self._task
        before = self._registry.focus_before
        if before is None:
            yield from self._find(work)
        else:
            yield self._lens.seek_focus(before)
        self._registry.focus_before = None

    def _find(self, work: HandlingContext) -> Steps:
        lens = self._lens
        focus = lens.state(LensAxis.FOCUS)
        yield lens.zoom_to(work.settings.zoom)
        if focus is None:
            return
        yield lens.seek_focus(focus.limit_counts // 2)
        try:
            yield lens.autofocus(work.settings.camera)
        except (NotAvailable, DeviceError) as exc:
            logger.warning("the middle of its travel is taken for the focus: %s", exc)

    def end(self) -> None:
        if not self._task.done:
            self._lens.abort()


def _initialise(work: HandlingContext) -> Steps:
    for left in reversed(range(TRIES)):
        try:
            yield work.mico.initialise(wait=False, may_hold=True)
        except MoveRefused as refusal:
            if refusal.verdict.reason is not Reason.NO_ANSWER or not left:
                raise
            yield APART_S  # the gate is being restarted, or the machine is busy
        else:
            return


OTHER_UP_UM = 5000.0
OTHER_BACK_UM = 4000.0
TURN_ON_DEG = 41.0
ANGLES: Final = 4
"""Of the table at which the gripper is tried to be taken about just above the plate."""
PLATE = "map of the plate"
HELD = "map where fibres are held"
TABLE = "rotation centre"
PROBE = "probe against gripper"
CONTACT = "touch"
"""What the scene file calls it: only while it lasts may probe and jaws touch."""
BEYOND_UM: Final = 100.0
"""How far beyond where a jaw can be the probe goes from it, before the way on is checked again."""


class MakeReady(FibreOperation):
    """Tools out of the way, speeds set, the jaws closed and opened."""

    name = "make ready"

    @override
    def precondition(self, work: HandlingContext) -> None:
        for tool in tools_of(work):
            for name in stages_of(tool):
                details = work.mico[name].details
                if details.confidence is not Confidence.KNOWN:
                    # What took the position away comes before what brings it back.
                    lost = f"{name}: {details.error}; then " if details.error else f"{name}: "
                    raise OperationFailed("not initialised", f"{lost}initialise the platform")
                if details.zero != 0.0:
                    raise OperationFailed("zero set", f"{name}: clear its zero, then begin again")

    @override
    def steps(self, work: HandlingContext) -> Steps:
        if work.ready:
            return
        settings, positions = work.settings, work.settings.places
        for tool in tools_of(work):
            for name in stages_of(tool):
                work.mico[name].set_closed_loop_frequency(settings.frequency_hz)
        # After a stop the probe may stand at a jaw: back first, then the grippers can be lifted.
        yield from retract_probe(work)
        lifted = {work.gripper.z_axis: self._high(work)}
        if settings.other:
            lifted[work.tool(settings.other).z_axis] = OTHER_UP_UM
        yield work.go(lifted)
        if settings.other:
            other = work.tool(settings.other)
            yield work.go({other.x_axis: OTHER_BACK_UM * (-1.0 if other.forward[0] > 0.0 else 1.0)})
        # What may be left between the jaws falls where fibres are put away.
        yield work.go(work.bin_position())
        with work.mico.collision.contact("grasp"):
            yield work.go_up(positions.bin_um)
        yield from zero_jaws(work)
        yield work.go({work.gripper.z_axis: self._high(work)})
        yield from zoom_to(work, settings.zoom)
        work.ready = True
        yield SAFE_POINT

    @staticmethod
    def _high(work: HandlingContext) -> float:
        tool, travel = work.gripper, work.settings.places.travel_um
        here = min(work.mico[tool.z_axis].position_um or 0.0, work.highest_um)
        return max(travel - tool.tip_um[2], here)


def retract_probe(work: HandlingContext) -> Steps:
    """Take the probe straight back from where fibres are held and lie.

    Nothing but its way back is ordered: from inside a jaw's margin the gate allows what leads away
    from it, and an axis that moves along, if only to where it is, may overshoot. Where it touches a
    jaw, or may, it goes clear of that as in a touch, and the rest of the way as always.
    """
    _, y = work.tip_now(work.probe)
    away = work.settings.places.probe_away_y_um
    if y < away - 1.0:
        yield from _drawn_back(work, y, away)
    probe_parked(work)


def _drawn_back(work: HandlingContext, y: float, away: float) -> Steps:
    if not work.calibration.touching:
        try:
            yield _probe_to(work, away)
        except MoveRefused as refusal:
            if not _touches(work, refusal.verdict.bodies):
                raise
            logger.warning("the probe may touch a jaw, and goes back from it: %s", refusal)
        else:
            return
    clear = y + work.settings.grasp.full_um / 2.0 + BEYOND_UM
    with work.mico.collision.contact(CONTACT):
        yield _probe_to(work, min(clear, away))
    yield _probe_to(work, away)
    work.calibration.touching = False


def _probe_to(work: HandlingContext, y_um: float) -> RetryingMove:
    return work.go({work.probe.y_axis: y_um - work.probe.tip_um[1]})


def _touches(work: HandlingContext, bodies: Collection[str]) -> bool:
    """Return whether one of the bodies is a jaw of a gripper that the probe stands in front of."""
    scene, (_, y) = work.mico.collision.scene, work.tip_now(work.probe)
    before = {
        each.gap_axis for each in tools_of(work) if each.gap_axis and work.tip_now(each)[1] < y
    }
    driven = {drive.joint for drive in scene.drives if drive.axis in before}
    return any(joint.child in bodies for joint in scene.joints if joint.name in driven)


class CalibratePlate(Calibrated):
    """Where on the plate the pixels lie, by the gripper's tip just above it."""

    name = "calibrate at the plate"
    key = PLATE

    @override
    def measure(self, work: HandlingContext) -> Steps:
        position = work.settings.calibration
        residual = yield from self._clear_of_obstacles(work)
        self.kept(work, residual, "px", position.residual_px)
        work.calibration.zoom_run = work.shared.zoom_runs

    @staticmethod
    def _clear_of_obstacles(work: HandlingContext) -> Generator[Yielded, object, float]:
        """Take the gripper about just above the plate, with its clip out of the way."""
        position = work.settings.calibration
        x, y, z = position.place_x_um, position.place_y_um, position.place_um
        for _ in range(ANGLES - 1):
            try:
                return (yield from calibrate_at(work, x, y, z))
            except MoveRefused as refusal:
                if refusal.verdict.reason is not Reason.COLLISION:
                    raise
                logger.warning("the table turns on, what stands on it is in the way: %s", refusal)
            yield from TurnOn().steps(work)
        return (yield from calibrate_at(work, x, y, z))

    @override
    def check(self, work: HandlingContext, entry: CalibrationEntry) -> Holds:
        position = work.settings.calibration
        return entry if (yield from still_at(work, position.place_um, follow=True)) else None


class CalibrateHeld(Calibrated):
    """The same at the height of the probe."""

    name = "calibrate at the probe's height"
    key = HELD

    @override
    def measure(self, work: HandlingContext) -> Steps:
        position = work.settings.calibration
        residual = yield from calibrate_at(
            work, position.place_x_um, position.place_y_um, work.hold_tip_um
        )
        self.kept(work, residual, "px", position.residual_px)

    @override
    def check(self, work: HandlingContext, entry: CalibrationEntry) -> Holds:
        return entry if (yield from still_at(work, work.hold_tip_um, follow=False)) else None


def still_at(
    work: HandlingContext, z_um: float, *, follow: bool
) -> Generator[Yielded, object, bool]:
    """Look whether the tip is where the map has it; one that is near is followed, if wanted."""
    settings = work.settings.calibration
    yield from to_position(work, settings.place_x_um, settings.place_y_um)
    with work.mico.collision.contact("grasp"):
        yield work.go_up(z_um)
        image = yield work.image()
        assert isinstance(image, CameraImage)
        yield work.go_up(max(work.settings.places.travel_um, z_um))
    seen = tip_off(work, image, work.gripper)
    if not seen.certain:
        return False
    far = math.hypot(*seen.off_um)
    if far <= max(settings.drift_um, TIMES_STD * seen.std_um):
        work.calibration.zoom_run = work.shared.zoom_runs
        return True
    if not follow:
        return far <= settings.residual_px * seen.scale_um_px
    if not far <= settings.drift_far_um:
        return False
    shift_maps(work, seen)
    work.calibration.zoom_run = work.shared.zoom_runs
    return True


class Register(FibreOperation):
    """The tip is looked at once where the zoom has run since the maps were made.

    A motorised zoom comes to rest a little elsewhere each time, and the image with it. Where the
    tip is far off, or not seen, the maps are measured anew.
    """

    name = "see where the zoom came to rest"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        known, settings = work.calibration, work.settings.calibration
        if known.zoom_run == work.shared.zoom_runs or work.vico.lens is None:
            return
        image = yield from image_where_mapped(work)
        try:
            seen = tip_off(work, image, work.gripper)
        except NotAvailable as exc:
            logger.warning("the tip is not seen after the zoom has run: %s", exc)
            seen = None
        if seen is None or not seen.certain or not math.hypot(*seen.off_um) <= settings.lens_far_um:
            for key in (PLATE, HELD):
                known.made.pop(key, None)
                known.registry.forget(key, work.gripper.name)
            yield from CalibratePlate().steps(work)
            yield from CalibrateHeld().steps(work)
            return
        shift_maps(work, seen, lens=True)
        known.zoom_run = work.shared.zoom_runs
        yield SAFE_POINT


def image_where_mapped(work: HandlingContext) -> Generator[Yielded, object, CameraImage]:
    """Take an image of the gripper where the maps were made, and set right after the zoom ran.

    Elsewhere the tip is off by what a run of the zoom does to the scale.
    """
    settings = work.settings.calibration
    yield from to_position(work, settings.place_x_um, settings.place_y_um)
    yield work.go_up(work.hold_tip_um)
    image = yield work.image()
    assert isinstance(image, CameraImage)
    return image


def to_position(work: HandlingContext, x_um: float, y_um: float) -> Steps:
    """Take the gripper over a position, its jaws as far open as is counted."""
    yield work.rise(work.settings.places.travel_um)
    yield work.go(work.at(work.gripper, x_um * work.jaws.forward, y_um))
    if not in_step(work):
        yield from zero_jaws(work)


def calibrate_at(
    work: HandlingContext, x_um: float, y_um: float, z_um: float
) -> Generator[Yielded, object, float]:
    """Take the gripper there, have the camera calibrated by it, and take it up again.

    Returns the residual, px.
    """
    tool, travel = work.gripper, work.settings.places.travel_um
    yield from to_position(work, x_um, y_um)
    begun = work.vico.calibrated
    with work.mico.collision.contact("grasp"):
        yield work.go_up(z_um)
        yield work.vico.calibrate_stage(tool.name, work.settings.camera)
        yield work.go_up(max(travel, z_um))
    new = [each for each in work.vico.calibrated if each not in begun]
    return max((each.residual_px for each in new), default=0.0)


def clear_image(work: HandlingContext) -> Steps:
    """Take gripper and probe out of the image."""
    positions = work.settings.places
    yield work.rise(positions.travel_um)
    yield from retract_probe(work)
    x, y = positions.away_x_um * work.jaws.forward, positions.bin_y_um
    yield work.go(
        work.at(work.gripper, x, y)
        | work.at(work.probe, positions.hold_x_um, positions.probe_away_y_um)
    )


class ComparePositions(Calibrated):
    """Where the probe's tip is in the frame of the gripper, seen in one place of the image."""

    name = "see probe and gripper"
    key = PROBE

    @override
    def measure(self, work: HandlingContext) -> Steps:
        zoom = work.settings.calibration.compare_zoom
        yield from zoom_to(work, zoom)
        try:
            yield from self._compare(work)
        finally:
            work.shared.zoomed = None
        yield from zoom_to(work, work.settings.zoom)

    def _compare(self, work: HandlingContext) -> Steps:
        hold_y, settings = work.settings.places.hold_y_um, work.settings.calibration
        residual = yield from calibrate_at(work, settings.compare_x_um, hold_y, work.hold_tip_um)
        gripper, probe = yield from see_both(work)
        off = probe.off_um[0] - gripper.off_um[0], probe.off_um[1] - gripper.off_um[1]
        work.calibration.probe_off_um = work.calibration.seen_off_um = off
        self.kept(
            work,
            residual,
            "px",
            settings.residual_px,
            values=_both(off),
            how="both tips in one place",
        )

    @override
    def check(self, work: HandlingContext, entry: CalibrationEntry) -> Holds:
        """See both tips anew by the map that there is, where that still holds."""
        settings = work.settings.calibration
        yield from zoom_to(work, settings.compare_zoom)
        try:
            gripper, probe = yield from see_both(work)
        finally:
            work.shared.zoomed = None
        yield from zoom_to(work, work.settings.zoom)
        if not math.hypot(*gripper.off_um) <= settings.residual_px * gripper.scale_um_px:
            return None
        off = probe.off_um[0] - gripper.off_um[0], probe.off_um[1] - gripper.off_um[1]
        return replace(entry, values=_both(off))

    @override
    def restore(self, work: HandlingContext, entry: CalibrationEntry) -> None:
        known, values = work.calibration, entry.values
        known.probe_off_um = values["off_x_um"], values["off_y_um"]
        known.seen_off_um = values["seen_x_um"], values["seen_y_um"]


def _both(off_um: tuple[float, float]) -> dict[str, float]:
    x, y = off_um
    return {"off_x_um": x, "off_y_um": y, "seen_x_um": x, "seen_y_um": y}


def see_both(work: HandlingContext) -> Generator[Yielded, object, tuple[TipOff, TipOff]]:
    """Return where gripper and probe are seen; raises `NotAvailable`.

    Both at one place of the image, one after the other: the zoom comes to rest at another scale
    each time, which is a few micrometres from the jaws to the probe beside them.
    """
    yield from beside_jaws(work)
    image = yield work.image()
    assert isinstance(image, CameraImage)
    yield from retract_probe(work)
    yield work.go(work.at(work.gripper, *_beside_um(work)))
    there = yield work.image()
    assert isinstance(there, CameraImage)
    return tip_off(work, there, work.gripper), tip_off(work, image, work.probe)


def _beside_um(work: HandlingContext) -> tuple[float, float]:
    positions, settings = work.settings.places, work.settings.calibration
    beside = (positions.hold_x_um + settings.compare_beside_um) * work.jaws.forward
    return beside, positions.hold_y_um + settings.compare_before_um


def beside_jaws(work: HandlingContext) -> Steps:
    """Hold the jaws where fibres are pushed, and the probe beside them: both in one image."""
    positions, (beside, before) = work.settings.places, _beside_um(work)
    hold_x = positions.hold_x_um * work.jaws.forward
    yield work.rise(positions.travel_um)
    yield work.go(work.at(work.gripper, hold_x, positions.hold_y_um))
    yield work.go_up(work.hold_tip_um)
    guard_probe(work)
    # Aside while it is far back, then straight ahead: nothing is beside its way.
    yield work.go({work.probe.x_axis: beside - work.probe.tip_um[0]})
    yield work.go(work.at(work.probe, beside, before))


class TurnOn(FibreOperation):
    """The table turns, so that other fibres lie under the tools when they are looked for again."""

    name = "turn the table on"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        positions = work.settings.places
        yield from retract_probe(work)
        yield work.rise(positions.travel_um)
        largest = work.settings.grasp.largest_turn_deg
        angle = work.table_deg + TURN_ON_DEG
        yield work.go({work.table: angle if angle <= largest else angle - 2.0 * largest})


def zoom_to(work: HandlingContext, zoom: float) -> Steps:
    """Zoom there, where the lens is not there already."""
    lens = work.vico.lens
    if lens is None or work.shared.zoomed == zoom:
        return
    work.shared.zoom_runs += 1
    yield lens.zoom_to(zoom)
    work.shared.zoomed = zoom


def make_safe(work: HandlingContext) -> Steps:
    """Take the probe back and grippers up; nothing is opened, for a fibre may be held."""
    work.shared.surveyed, work.shared.zoomed = False, None
    for arm in work.arms:
        arm.ready = False
    touching = [arm for arm in work.arms if arm.calibration.touching]
    yield from retract_probe((touching or [work])[0])
    with work.mico.collision.contact("grasp"):
        for arm in work.arms:
            yield arm.rise(arm.settings.places.travel_um)
