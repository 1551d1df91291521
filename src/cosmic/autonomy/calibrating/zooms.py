"""The map from platform to image at every step of the lens, one after the other."""

from typing import Final

from typing_extensions import override

from cosmic.autonomy.calibrating.calibrated import Calibrated
from cosmic.autonomy.calibrating.focusing import (
    find_focus_near,
    focus_now,
    lens_of,
    seek_from_below,
)
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.jaws import in_step, move_jaws, open_jaws, zero_jaws
from cosmic.autonomy.handling.prepare import clear_image, zoom_to
from cosmic.autonomy.procedures.operation import Steps
from cosmic.autonomy.stage_procedure import LARGEST_PART
from cosmic.vico.core.calibration_fit import CalibrationRefused

ZOOMS: Final = "map at every zoom"
DEEP_ZOOM: Final = 3.0
"""From here on the field is so shallow that the tip is focused on first."""


class CalibrateZooms(Calibrated):
    """The gripper's tip, well above the plate, goes about the image at each step of the lens.

    Where the field is small the jaws are opened less, so that all of both is seen.
    """

    name = "calibrate every zoom"
    key = ZOOMS

    @override
    def measure(self, work: HandlingContext) -> Steps:
        settings, begun = work.settings.calibration, focus_now(work)
        steps = lens_of(work).steps
        if not steps:
            raise CalibrationRefused("the lens has no zoom steps: list them in the platform file")
        yield from clear_image(work)
        if not in_step(work):
            yield from zero_jaws(work)
        height = max(work.settings.places.travel_um, work.height_now())
        worst, values = 0.0, {}
        try:
            for step in steps:
                yield from zoom_to(work, step.zoom)
                x_um = _middle_x_um(work, step.scale_um_px)
                yield work.go(work.at(work.gripper, x_um, settings.focus_y_um))
                if step.zoom > DEEP_ZOOM:
                    yield from self._focus(work, begun, height)
                small = step.scale_um_px < settings.zooms_small_um_px
                gap = settings.zooms_gap_um if small else work.settings.grasp.gap_um
                yield from move_jaws(work, gap - (work.gap_um or 0.0))
                before = work.vico.calibrated
                yield work.vico.calibrate_stage(work.gripper.name, work.settings.camera)
                new = [each for each in work.vico.calibrated if each not in before]
                residual = max((each.residual_px for each in new), default=0.0)
                values[f"residual_{step.zoom:g}x_px"] = residual
                worst = max(worst, residual)
        finally:
            work.shared.zoomed = None
        yield from seek_from_below(work, begun)
        yield from open_jaws(work)
        yield from zoom_to(work, work.settings.zoom)
        how = f"9 positions at each of {len(steps)} steps"
        self.kept(work, worst, "px", settings.residual_px, values=values, how=how)

    @staticmethod
    def _focus(work: HandlingContext, plate_counts: float, height_um: float) -> Steps:
        settings = work.settings.calibration
        about = plate_counts + height_um / settings.focus_um_count
        reach = settings.focus_reach_um / settings.focus_um_count
        found, _ = yield from find_focus_near(work, about, reach, "the gripper's tip")
        yield from seek_from_below(work, found)


def _middle_x_um(work: HandlingContext, scale_um_px: float) -> float:
    """Return where the tip stands so that it reaches the positions on both sides of it."""
    settings, camera = work.settings.calibration, work.vico.camera(work.settings.camera)
    width_px = camera.settings.roi.width_px if camera.settings is not None else 0
    beyond = LARGEST_PART * width_px * scale_um_px - settings.zooms_ahead_um
    return settings.focus_x_um - work.jaws.forward * max(0.0, beyond)
