"""Heights by focus: how high above the plate the tips of gripper and probe really are."""

import math
from collections.abc import Generator
from dataclasses import dataclass

from typing_extensions import override

from cosmic.autonomy.calibrating.calibrated import Calibrated, Holds
from cosmic.autonomy.calibrating.focusing import (
    Found,
    find_focus_near,
    focus_now,
    seek_from_below,
)
from cosmic.autonomy.calibrating.registry import CalibrationEntry
from cosmic.autonomy.handling.context import HEIGHTS, FibreOperation, HandlingContext
from cosmic.autonomy.handling.force_limit import guard_probe
from cosmic.autonomy.handling.prepare import clear_image, retract_probe, zoom_to
from cosmic.autonomy.procedures.operation import Steps, Yielded
from cosmic.autonomy.tools import tip_um
from cosmic.frame.errors import NotAvailable
from cosmic.vico.core.calibration_fit import CalibrationRefused
from cosmic.vico.core.tool_settings import ToolSettings

LOW_PART = 0.45
"""Of the height at which fibres are held: where the tip is looked at a second time."""
FIELD_POWER = 1.5
"""The depth of field grows with the magnification to the minus this."""


@dataclass(frozen=True, slots=True)
class Seen:
    """A tip in focus.

    Attributes
    ----------
    stage_um : float
        Its height, as its stages say.
    """

    stage_um: float
    counts: float
    std_counts: float


class HeightsAsFiled(FibreOperation):
    """Heights are taken to be as the platform file says, where they cannot be measured."""

    name = "take heights from the file"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        work.calibration.up_um.clear()
        # Where it was looked at, the probe would be in the way of the calibrations that follow.
        yield from retract_probe(work)
        yield from zoom_to(work, work.settings.zoom)


class HeightByFocus(Calibrated):
    """The lens goes through the focus on the plate, on the gripper's tip twice, on the probe's.

    From the plate upwards, for the focus is slow: the tip low, high, and the probe beside that.
    The tip is nowhere near the plate meanwhile: how high it is does not have to be known before.
    What a count of the focus is worth comes from the two heights of the tip.
    """

    name = "heights by focus"
    key = HEIGHTS

    @override
    def measure(self, work: HandlingContext) -> Steps:
        settings = work.settings.calibration
        begun = focus_now(work)
        try:
            yield from self._at(work, settings.focus_zoom, begun)
        except CalibrationRefused:
            # Nothing with edges may lie in so small a field: a wider one, and less sure.
            yield from self._at(work, settings.focus_wide_zoom, begun)

    def _at(self, work: HandlingContext, zoom: float, begun_counts: float) -> Steps:
        try:
            yield from clear_image(work)
            yield from zoom_to(work, zoom)
            plate = yield from _plate(work, zoom, begun_counts)
            high = work.hold_tip_um
            yield work.rise(high)
            tips = []
            for height in (LOW_PART * high, high):  # the focus takes its time: it only goes up
                tips.append((yield from _gripper(work, zoom, plate[0], height)))
            yield from clear_image(work)
            probe = yield from _probe(work, zoom, plate[0])
            yield from retract_probe(work)
        finally:
            work.shared.zoomed = None
        yield from seek_from_below(work, begun_counts)
        self._keep(work, zoom, plate, (tips[0], tips[1]), probe)
        yield from zoom_to(work, work.settings.zoom)

    def _keep(
        self,
        work: HandlingContext,
        zoom: float,
        plate: tuple[float, float],
        tips: tuple[Seen, Seen],
        probe: Seen,
    ) -> None:
        settings = work.settings.calibration
        low, high = tips
        counts_um = (high.counts - low.counts) / (high.stage_um - low.stage_um)
        usual = 1.0 / settings.focus_um_count
        if not 0.7 * usual <= counts_um <= 1.4 * usual:
            raise CalibrationRefused(
                f"the focus goes {counts_um:.2f} counts for each um of the tip, not about "
                f"{usual:.2f}: another object was in focus"
            )
        over = over_um(low, plate[0], counts_um, settings.lying_um)
        up = over - low.stage_um
        # The probe is as high as the tip at its highest: against that, and less against the plate.
        beside = high.stage_um + up + (probe.counts - high.counts) / counts_um
        probe_up = beside + work.probe.width_um / 2.0 - probe.stage_um
        ups = {work.gripper.name: up, work.probe.name: probe_up}
        far = over / (high.stage_um - low.stage_um)
        stds = plate[1], (1.0 + far) * low.std_counts, far * high.std_counts
        std_um = math.hypot(*stds) / counts_um
        work.calibration.up_um |= ups
        values = {
            "up_um": ups[work.gripper.name],
            "probe_up_um": ups[work.probe.name],
            "plate_um": -ups[work.gripper.name],
            "plate_counts": plate[0],
            "counts_um": counts_um,
            "zoom": zoom,
        }
        how = f"{settings.focus_frames} images a sweep at {zoom:g}x"
        self.kept(work, std_um, "um", settings.height_um, values=values, how=how)

    @override
    def restore(self, work: HandlingContext, entry: CalibrationEntry) -> None:
        work.calibration.up_um |= {
            work.gripper.name: entry.values["up_um"],
            work.probe.name: entry.values["probe_up_um"],
        }

    @override
    def made_with(self, work: HandlingContext) -> str:
        tip = ", ".join(f"{each:g}" for each in work.probe.tip_um)
        return f"{super().made_with(work)}, {work.probe.name} at {tip}"

    @override
    def check(self, work: HandlingContext, entry: CalibrationEntry) -> Holds:
        """Focus on the plate and on the tip once, and see that they are as far apart as before."""
        zoom, begun = entry.values["zoom"], focus_now(work)
        try:
            yield from clear_image(work)
            yield from zoom_to(work, zoom)
            plate = yield from _plate(work, zoom, begun)
            tip = yield from _gripper(work, zoom, plate[0], LOW_PART * work.hold_tip_um)
            yield from clear_image(work)
        finally:
            work.shared.zoomed = None
        yield from seek_from_below(work, begun)
        yield from zoom_to(work, work.settings.zoom)
        settings = work.settings.calibration
        over = over_um(tip, plate[0], entry.values["counts_um"], settings.lying_um)
        off = over - tip.stage_um - entry.values["up_um"]
        return entry if abs(off) <= settings.height_um else None


def over_um(tip: Seen, plate_counts: float, counts_um: float, lying_um: float) -> float:
    """Return how high above the plate a tip is, by where both are in focus."""
    return (tip.counts - plate_counts) / counts_um + lying_um


def _reach_counts(work: HandlingContext, zoom: float) -> float:
    settings = work.settings.calibration
    wider = math.pow(settings.focus_zoom / zoom, FIELD_POWER)
    return settings.focus_reach_um * wider / settings.focus_um_count


def _plate(work: HandlingContext, zoom: float, about: float) -> Found:
    reach = _reach_counts(work, zoom)
    return (yield from find_focus_near(work, about, reach, "the plate and what lies on it"))


def _gripper(
    work: HandlingContext, zoom: float, plate_counts: float, height_um: float
) -> Generator[Yielded, object, Seen]:
    settings = work.settings.calibration
    tool = work.gripper
    yield work.rise(height_um)
    yield work.go(work.at(tool, settings.focus_x_um, settings.focus_y_um))
    yield work.go_up(height_um)
    return (yield from _seen(work, tool, zoom, plate_counts))


def _probe(
    work: HandlingContext, zoom: float, plate_counts: float
) -> Generator[Yielded, object, Seen]:
    settings = work.settings.calibration
    guard_probe(work)
    yield work.go(work.at(work.probe, settings.focus_x_um, settings.focus_y_um))
    return (yield from _seen(work, work.probe, zoom, plate_counts))


def _seen(
    work: HandlingContext, tool: ToolSettings, zoom: float, plate_counts: float
) -> Generator[Yielded, object, Seen]:
    positions = {name: work.mico[name].position_um or 0.0 for name in tool.axes}
    tip = tip_um(tool, positions)
    if tip is None:
        raise NotAvailable(f"{tool.name}: its position is unknown")
    about = plate_counts + tip[2] / work.settings.calibration.focus_um_count
    reach = _reach_counts(work, zoom)
    found, std = yield from find_focus_near(work, about, reach, f"the tip of {tool.shown}")
    return Seen(tip[2], found, std)
