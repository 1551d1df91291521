"""Operations before the first fibre: out of the way, and calibrated as far as is not fresh."""

import math
from collections.abc import Generator
from dataclasses import replace

from typing_extensions import override

from cosmic.autonomy.calibrating.book import CalibrationEntry
from cosmic.autonomy.calibrating.calibrated import Calibrated, Holds
from cosmic.autonomy.handling.jaws import in_step, zero_jaws
from cosmic.autonomy.handling.operation import FibreOperation
from cosmic.autonomy.handling.tips import TIMES_STD, TipOff, shift_maps, tip_off
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed, Steps, Wish
from cosmic.mico.core.positioner import Confidence
from cosmic.vico.core.picture import Picture
from cosmic.vico.core.tool_settings import ToolSettings

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
                    # What took the position away comes before what brings it back.
                    lost = f"{name}: {details.error}; then " if details.error else f"{name}: "
                    raise OperationFailed("not initialised", f"{lost}initialise the platform")
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

    @override
    def check(self, work: FibreWork, entry: CalibrationEntry) -> Holds:
        place = work.settings.calibration
        return entry if (yield from still_at(work, place.place_um, follow=True)) else None


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

    @override
    def check(self, work: FibreWork, entry: CalibrationEntry) -> Holds:
        return entry if (yield from still_at(work, work.hold_tip_um, follow=False)) else None


def still_at(work: FibreWork, z_um: float, *, follow: bool) -> Generator[Wish, object, bool]:
    """Look whether the tip is where the map has it; one that is near is followed, if wanted."""
    settings = work.settings.calibration
    yield from to_place(work, settings.place_x_um, settings.place_y_um)
    with work.mico.collision.contact("grasp"):
        yield work.go_up(z_um)
        picture = yield work.picture()
        assert isinstance(picture, Picture)
        yield work.go_up(max(work.settings.places.travel_um, z_um))
    seen = tip_off(work, picture, work.gripper)
    if not seen.certain:
        return False
    far = math.hypot(*seen.off_um)
    if far <= max(settings.drift_um, TIMES_STD * seen.std_um):
        return True
    if not follow:
        return far <= settings.residual_px * seen.scale_um_px
    if not far <= settings.drift_far_um:
        return False
    shift_maps(work, seen.off_um)
    return True


def to_place(work: FibreWork, x_um: float, y_um: float) -> Steps:
    """Take the gripper over a place, its jaws as far open as is counted."""
    yield work.go_up(max(work.settings.places.travel_um, work.height_now()))
    yield work.go(work.at(work.gripper, x_um * work.jaws.forward, y_um))
    if not in_step(work):
        yield from zero_jaws(work)


def calibrate_at(
    work: FibreWork, x_um: float, y_um: float, z_um: float
) -> Generator[Wish, object, float]:
    """Take the gripper there, have the camera calibrated by it, and take it up again.

    Returns the residual, px.
    """
    tool, travel = work.gripper, work.settings.places.travel_um
    yield from to_place(work, x_um, y_um)
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
        gripper, probe = yield from see_both(work)
        off = probe.off_um[0] - gripper.off_um[0], probe.off_um[1] - gripper.off_um[1]
        work.calibration.probe_off_um = work.calibration.seen_off_um = off
        self.kept(work, residual, "px", settings.residual_px, values=_both(off), how="one picture")

    @override
    def check(self, work: FibreWork, entry: CalibrationEntry) -> Holds:
        """See both tips anew by the map that there is, where that still holds."""
        settings = work.settings.calibration
        yield from zoom_to(work, settings.compare_zoom)
        try:
            gripper, probe = yield from see_both(work)
        finally:
            work.zoomed = None
        yield from zoom_to(work, work.settings.zoom)
        if not math.hypot(*gripper.off_um) <= settings.residual_px * gripper.scale_um_px:
            return None
        off = probe.off_um[0] - gripper.off_um[0], probe.off_um[1] - gripper.off_um[1]
        return replace(entry, values=_both(off))

    @override
    def restore(self, work: FibreWork, entry: CalibrationEntry) -> None:
        known, values = work.calibration, entry.values
        known.probe_off_um = values["off_x_um"], values["off_y_um"]
        known.seen_off_um = values["seen_x_um"], values["seen_y_um"]


def _both(off_um: tuple[float, float]) -> dict[str, float]:
    x, y = off_um
    return {"off_x_um": x, "off_y_um": y, "seen_x_um": x, "seen_y_um": y}


def see_both(work: FibreWork) -> Generator[Wish, object, tuple[TipOff, TipOff]]:
    """Return where gripper and probe are seen on one picture; raises `NotAvailable`."""
    yield from beside_jaws(work)
    picture = yield work.picture()
    assert isinstance(picture, Picture)
    yield from retract_probe(work)
    return tip_off(work, picture, work.gripper), tip_off(work, picture, work.probe)


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
