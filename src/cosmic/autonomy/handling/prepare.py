"""Operations before the first fibre: out of the way, and calibrated as far as is not fresh."""

from collections.abc import Generator
from dataclasses import replace

from typing_extensions import override

from cosmic.autonomy.calibrating.book import CalibrationEntry
from cosmic.autonomy.calibrating.calibrated import Calibrated
from cosmic.autonomy.handling.jaws import in_step, zero_jaws
from cosmic.autonomy.handling.operation import FibreOperation
from cosmic.autonomy.handling.sight import map_at
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed, Steps, Wish
from cosmic.autonomy.tools import expected, tip_um
from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.mico.core.positioner import Confidence
from cosmic.vico.core.picture import Picture
from cosmic.vico.core.tool_settings import ToolSettings
from cosmic.vico.core.vision.algorithms import grey
from cosmic.vico.core.vision.tips import find_gripper, find_probe
from cosmic.vico.core.vision.tool_types import GripperTips, NotSeen, ToolEnd

REACH_PX = 40.0
OTHER_UP_UM = 5000.0
OTHER_BACK_UM = 4000.0
TURN_ON_DEG = 41.0
PLATE = "map of the plate"
HELD = "map where fibres are held"
TABLE = "rotation centre"
PROBE = "probe against gripper"
CONTACT = "touch"
"""What the scene file calls it: only while it lasts may probe and jaws touch."""


class MakeReady(FibreOperation):
    """Tools out of the way, speeds set, the jaws closed and opened."""

    name = "make ready"

    @override
    def precondition(self, work: FibreWork) -> None:
        for tool in self._tools(work):
            for name in (tool.x_axis, tool.y_axis, *filter(None, [tool.z_axis])):
                details = work.mico[name].details
                if details.confidence is not Confidence.KNOWN:
                    raise OperationFailed("not initialised", f"{name}: initialise the platform")
                if details.zero != 0.0:
                    raise OperationFailed("zero set", f"{name}: clear its zero, then begin again")

    @override
    def steps(self, work: FibreWork) -> Steps:
        if work.ready:
            return
        settings, places = work.settings, work.settings.places
        for tool in self._tools(work):
            for name in (tool.x_axis, tool.y_axis, *filter(None, [tool.z_axis])):
                work.mico[name].set_closed_loop_frequency(settings.frequency_hz)
        lifted = {work.gripper.z_axis: self._high(work)}
        if settings.other:
            lifted[work.tool(settings.other).z_axis] = OTHER_UP_UM
        yield work.go(lifted)
        yield from retract_probe(work)
        if settings.other:
            other = work.tool(settings.other)
            yield work.go({other.x_axis: OTHER_BACK_UM * (-1.0 if other.forward[0] > 0.0 else 1.0)})
        # What may be left between the jaws falls where fibres are put away.
        yield work.go(work.at(work.gripper, places.bin_x_um * work.jaws.forward, places.bin_y_um))
        with work.mico.collision.contact("grasp"):
            yield work.go_up(places.bin_um)
        yield from zero_jaws(work)
        yield work.go({work.gripper.z_axis: self._high(work)})
        yield from zoom_to(work, settings.zoom)
        work.ready = True
        yield SAFE_POINT

    @staticmethod
    def _high(work: FibreWork) -> float:
        tool, travel = work.gripper, work.settings.places.travel_um
        return max(travel - tool.tip_um[2], work.mico[tool.z_axis].position_um or 0.0)

    @staticmethod
    def _tools(work: FibreWork) -> list[ToolSettings]:
        names = [work.settings.gripper, work.settings.probe, work.settings.other]
        return [work.tool(name) for name in names if name]


def retract_probe(work: FibreWork) -> Steps:
    """Take the probe away from where fibres are held and lie."""
    x, y = work.tip_now(work.probe)
    away = work.settings.places.probe_away_y_um
    if not y < away - 1.0:
        return
    if not work.calibration.touching:
        yield work.go(work.at(work.probe, x, away))
        return
    # It was on its way to a jaw, and may stand at one.
    with work.mico.collision.contact(CONTACT):
        yield work.go(work.at(work.probe, x, away))
    work.calibration.touching = False


class CalibratePlate(Calibrated):
    """Where on the plate the pixels lie, by the gripper's tip just above it."""

    name = "calibrate at the plate"
    key = PLATE

    @override
    def measure(self, work: FibreWork) -> Steps:
        place = work.settings.calibration
        residual = yield from calibrate_at(work, place.place_x_um, place.place_y_um, place.place_um)
        self.kept(work, residual, "px", place.residual_px)


class CalibrateHeld(Calibrated):
    """The same at the height of the probe."""

    name = "calibrate at the probe's height"
    key = HELD

    @override
    def measure(self, work: FibreWork) -> Steps:
        place = work.settings.calibration
        residual = yield from calibrate_at(
            work, place.place_x_um, place.place_y_um, work.hold_tip_um
        )
        self.kept(work, residual, "px", place.residual_px)


def calibrate_at(
    work: FibreWork, x_um: float, y_um: float, z_um: float
) -> Generator[Wish, object, float]:
    """Take the gripper there, have the camera calibrated by it, and take it up again.

    Returns the residual, px.
    """
    tool, travel = work.gripper, work.settings.places.travel_um
    yield work.go_up(max(travel, work.height_now()))
    yield work.go(work.at(tool, x_um * work.jaws.forward, y_um))
    if not in_step(work):
        yield from zero_jaws(work)
    begun = work.vico.calibrated
    with work.mico.collision.contact("grasp"):
        yield work.go_up(z_um)
        yield work.vico.calibrate_stage(tool.name, work.settings.camera)
        yield work.go_up(max(travel, z_um))
    new = [each for each in work.vico.calibrated if each not in begun]
    return max((each.residual_px for each in new), default=0.0)


def clear_picture(work: FibreWork) -> Steps:
    """Take gripper and probe out of the picture."""
    places = work.settings.places
    yield work.go_up(max(places.travel_um, work.height_now()))
    yield from retract_probe(work)
    x, y = places.away_x_um * work.jaws.forward, places.bin_y_um
    yield work.go(
        work.at(work.gripper, x, y) | work.at(work.probe, places.hold_x_um, places.probe_away_y_um)
    )


class ComparePlaces(Calibrated):
    """Where the probe's tip is in the frame of the gripper, on one picture with both."""

    name = "see probe and gripper"
    key = PROBE

    @override
    def measure(self, work: FibreWork) -> Steps:
        zoom = work.settings.calibration.compare_zoom
        yield from zoom_to(work, zoom)
        try:
            yield from self._compare(work)
        finally:
            work.zoomed = None
        yield from zoom_to(work, work.settings.zoom)

    def _compare(self, work: FibreWork) -> Steps:
        hold_y, settings = work.settings.places.hold_y_um, work.settings.calibration
        residual = yield from calibrate_at(work, settings.compare_x_um, hold_y, work.hold_tip_um)
        yield from beside_jaws(work)
        picture = yield work.picture()
        assert isinstance(picture, Picture)
        x, y = work.calibration.probe_off_um = probe_off_um(work, picture)
        work.calibration.seen_off_um = x, y
        yield from retract_probe(work)
        values = {"off_x_um": x, "off_y_um": y, "seen_x_um": x, "seen_y_um": y}
        self.kept(work, residual, "px", settings.residual_px, values=values, how="one picture")

    @override
    def restore(self, work: FibreWork, entry: CalibrationEntry) -> None:
        known, values = work.calibration, entry.values
        known.probe_off_um = values["off_x_um"], values["off_y_um"]
        known.seen_off_um = values["seen_x_um"], values["seen_y_um"]


def beside_jaws(work: FibreWork) -> Steps:
    """Hold the jaws where fibres are pushed, and the probe beside them: both in one picture."""
    places, settings = work.settings.places, work.settings.calibration
    hold_x = places.hold_x_um * work.jaws.forward
    yield work.go_up(max(places.travel_um, work.height_now()))
    yield work.go(work.at(work.gripper, hold_x, places.hold_y_um))
    yield work.go_up(work.hold_tip_um)
    beside = hold_x + settings.compare_beside_um * work.jaws.forward
    before = places.hold_y_um + settings.compare_before_um
    # Aside while it is far back, then straight ahead: nothing is beside its way.
    yield work.go({work.probe.x_axis: beside - work.probe.tip_um[0]})
    yield work.go(work.at(work.probe, beside, before))


class TurnOn(FibreOperation):
    """The table turns, so that other fibres lie under the tools when they are looked for again."""

    name = "turn the table on"

    @override
    def steps(self, work: FibreWork) -> Steps:
        places = work.settings.places
        yield from retract_probe(work)
        yield work.go_up(max(places.travel_um, work.height_now()))
        largest = work.settings.grasp.largest_turn_deg
        angle = work.table_deg + TURN_ON_DEG
        yield work.go({work.table: angle if angle <= largest else angle - 2.0 * largest})


def zoom_to(work: FibreWork, zoom: float) -> Steps:
    """Zoom there, where the lens is not there already."""
    lens = work.vico.lens
    if lens is None or work.zoomed == zoom:
        return
    yield lens.zoom_to(zoom)
    work.zoomed = zoom


def probe_off_um(work: FibreWork, picture: Picture) -> tuple[float, float]:
    """Return how far the probe's tip is from where its stages say, by a picture of both."""
    off = []
    for tool in (work.probe, work.gripper):
        found = see_tip(work, picture, tool)
        if isinstance(found, NotSeen):
            raise NotAvailable(f"{tool.shown} was not seen: {found.reason}")
        believed = tip_um(tool, picture.circumstances.positions)
        if believed is None:
            raise NotAvailable(f"{tool.name}: where it stands is not known")
        seen_px = found.hold_px if isinstance(found, GripperTips) else found.tip_px
        seen = work.mapped(picture, work.hold_tip_um).to_um(seen_px)
        off.append((float(seen[0]) - believed[0], float(seen[1]) - believed[1]))
    (px, py), (gx, gy) = off
    return px - gx, py - gy


def see_tip(
    work: FibreWork, picture: Picture, tool: ToolSettings
) -> GripperTips | ToolEnd | NotSeen:
    """Look for a tool's tip where its stages say it is, with the jaws as far open as counted."""
    positions = picture.circumstances.positions
    tip = tip_um(tool, positions)
    if tip is None:
        return NotSeen("where it stands is not known")
    try:
        mapped = map_at(work.vision.places, picture, tip[2])
    except CosmicError as exc:
        return NotSeen(str(exc))
    wanted = expected(tool, mapped, tip[:2], positions, REACH_PX)
    if wanted is None:
        return NotSeen("it is too small on the picture; zoom in")
    if not tool.gap_axis:
        return find_probe(grey(picture.data), wanted)
    gap_px = (work.gap_um or 0.0) / mapped.scale_um_px
    return find_gripper(grey(picture.data), replace(wanted, gap_px=gap_px))
