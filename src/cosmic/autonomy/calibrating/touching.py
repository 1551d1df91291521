"""Touch: the probe feels for a jaw, so that probe and gripper are in one frame."""

from collections.abc import Generator
from typing import Final

import numpy as np
from typing_extensions import override

from cosmic.autonomy.calibrating.calibrated import Calibrated
from cosmic.autonomy.calibrating.registry import CalibrationEntry
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.force import ForceMean
from cosmic.autonomy.handling.force_limit import arm_force_limit, limit_of, put_back
from cosmic.autonomy.handling.jaws import CLOSED_STD_UM, mark_gap_unknown, move_jaws, note_gap
from cosmic.autonomy.handling.prepare import CONTACT, PROBE, retract_probe
from cosmic.autonomy.handling.retrying_move import RetryingMove
from cosmic.autonomy.procedures.operation import Steps, Yielded
from cosmic.frame.errors import NotAvailable
from cosmic.vico.core.calibration_fit import CalibrationRefused

TOUCH: Final = "probe touches gripper"
BACK_UM: Final = 2.0
FAR_UM: Final = 300.0


class TouchJaw(Calibrated):
    """The probe comes up to the outside of the closed jaws, a step at a time, until it is felt.

    No step is so long that even a rigid jaw could bring the force near what the sensor bears. Where
    the jaw is must be known from an image before: the first steps begin close to it. Only the
    direction in which the probe feels can be touched in.
    """

    name = "touch the jaws with the probe"
    key = TOUCH

    @override
    def measure(self, work: HandlingContext) -> Steps:
        settings = work.settings.calibration
        if PROBE not in work.calibration.made:
            raise NotAvailable(
                "probe and gripper must be in one image before they touch; move them closer "
                "together or zoom out"
            )
        if not work.daqco.running:
            work.daqco.start()
        mark_gap_unknown(work)
        yield from move_jaws(work, -(work.settings.grasp.full_um + settings.touch_closing_um))
        note_gap(work, 0.0, CLOSED_STD_UM)
        before = limit_of(work)
        try:
            found = yield from self._touched(work)
        finally:
            put_back(work, before)
        yield from move_jaws(work, work.settings.grasp.gap_um)
        self._keep(work, found)

    def _touched(self, work: HandlingContext) -> Generator[Yielded, object, list[float]]:
        """Return by how much the probe's tip is elsewhere than its stage says, touch by touch."""
        settings, positions = work.settings.calibration, work.settings.places
        side = -1.0 if work.probe.forward[1] > 0.0 else 1.0
        yield from retract_probe(work)
        below = work.hold_tip_um + positions.hold_above_tip_um - settings.touch_below_um
        yield work.rise(max(below, positions.travel_um))
        yield work.go(
            work.at(work.gripper, positions.hold_x_um * work.jaws.forward, positions.hold_y_um)
        )
        yield work.go_up(below)
        hold_x, hold_y = work.tip_now(work.gripper)
        off_x, off_y = work.calibration.probe_off_um
        x = hold_x - settings.touch_behind_um * work.jaws.forward - off_x
        face = hold_y + side * work.gripper.width_um
        work.calibration.touching = True
        with work.mico.collision.contact(CONTACT):
            yield work.go({work.probe.x_axis: x - work.probe.tip_um[0]})
            arm_force_limit(work)
            near = face - off_y + side * settings.touch_stand_off_um
            yield self._to(work, near + side * FAR_UM)
            base = yield from _mean_un(work, 0.1)
            yield self._to(work, near)
            if abs((yield from _mean_un(work, 0.02)) - base) > settings.touch_un:
                raise CalibrationRefused(
                    "contact force before the expected jaw position: check for a bent tip, "
                    "and calibrate the camera again"
                )
            found = []
            for _ in range(settings.touches):
                at = yield from self._feel(work, side, base)
                found.append(face - at)
                yield self._to(work, at + side * BACK_UM)
            # The gate takes the jaws to be anywhere in their travel: out of it in here too.
            yield from retract_probe(work)
        return found

    @override
    def undo(self, work: HandlingContext) -> Steps:
        yield from retract_probe(work)

    @staticmethod
    def _to(work: HandlingContext, y_um: float) -> RetryingMove:
        return work.go({work.probe.y_axis: y_um - work.probe.tip_um[1]})

    def _feel(
        self, work: HandlingContext, side: float, base_un: float
    ) -> Generator[Yielded, object, float]:
        """Make small steps until something is felt, and return the position of the tip then."""
        settings, axis = work.settings.calibration, work.mico[work.probe.y_axis]
        _, begun = work.tip_now(work.probe)
        before = begun
        while abs(before - begun) < settings.touch_stand_off_um + 2.0 * settings.touch_off_um:
            yield RetryingMove(
                lambda: axis.steps(
                    -round(side), amplitude_v=settings.touch_step_v, frequency_hz=100, wait=False
                )
            )
            force = yield from _mean_un(work, settings.touch_average_s)
            _, here = work.tip_now(work.probe)
            if abs(here - before) > settings.touch_step_um:
                raise CalibrationRefused(
                    f"a step of the probe went {abs(here - before):.2f} um, at most "
                    f"{settings.touch_step_um:g} um are safe; lower touch_step_v"
                )
            if abs(force - base_un) > settings.touch_un:
                return 0.5 * (before + here)
            before = here
        raise CalibrationRefused(
            f"no contact within {abs(before - begun):.0f} um of where the image shows the "
            "jaw; check the sensor, and that the jaws are closed"
        )

    def _keep(self, work: HandlingContext, found: list[float]) -> None:
        settings = work.settings.calibration
        off_x, seen_y = work.calibration.probe_off_um
        felt_y = float(np.mean(found))
        spread = float(np.std(found, ddof=1)) if len(found) > 1 else settings.touch_step_um
        std_um = max(spread, settings.touch_step_um / np.sqrt(12.0)) / np.sqrt(len(found))
        apart = felt_y - seen_y
        if not abs(apart) <= settings.touch_off_um:
            raise CalibrationRefused(
                f"touch and image disagree by {apart:.1f} um, at most {settings.touch_off_um:g} "
                "um are allowed; check for a bent tip, and calibrate the camera again"
            )
        work.calibration.probe_off_um = off_x, felt_y
        values = {"off_y_um": felt_y, "seen_y_um": seen_y, "apart_um": apart, "spread_um": spread}
        how = f"{len(found)} touches"
        self.kept(work, float(std_um), "um", settings.touch_std_um, values=values, how=how)

    @override
    def restore(self, work: HandlingContext, entry: CalibrationEntry) -> None:
        off_x, _ = work.calibration.probe_off_um
        work.calibration.probe_off_um = off_x, entry.values["off_y_um"]

    @override
    def made_with(self, work: HandlingContext) -> str:
        tip = ", ".join(f"{each:g}" for each in work.probe.tip_um)
        return f"{work.gripper.name} against {work.probe.name} at {tip}"


def _mean_un(work: HandlingContext, seconds: float) -> Generator[Yielded, object, float]:
    mean = yield work.forces.wanted(seconds)
    assert isinstance(mean, ForceMean)
    return mean.mean_un
