"""Drift: the tips are looked for again now and then, and what moved is put right."""

import math
from collections.abc import Generator
from dataclasses import replace
from typing import Final

from typing_extensions import override

from cosmic.autonomy.calibrating.registry import CalibrationEntry
from cosmic.autonomy.handling.context import FibreOperation, HandlingContext, Measured
from cosmic.autonomy.handling.prepare import (
    HELD,
    PLATE,
    PROBE,
    image_where_mapped,
    see_both,
    zoom_to,
)
from cosmic.autonomy.handling.tips import TIMES_STD, Off, TipOff, shift_maps, tip_off
from cosmic.autonomy.procedures.operation import SAFE_POINT, Steps, Yielded
from cosmic.frame.errors import NotAvailable

DRIFT: Final = "drift of the tips"


class CheckDrift(FibreOperation):
    """Gripper and probe are seen again, every so many fibres.

    What has moved by more than the setting, and by more than can be noise, is followed: maps,
    rotation centre and the probe's position. What has moved far, or is not seen, is measured anew.
    """

    name = "check the drift"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        known, settings = work.calibration, work.settings.calibration
        due = len(work.shared.finished) - known.drift_looked_at >= settings.drift_fibres
        if not settings.drift_fibres or not due or PROBE not in known.made:
            return
        known.drift_looked_at = len(work.shared.finished)
        try:
            here, gripper, probe = yield from look_at_both(work)
        except NotAvailable:
            mark_unreliable(work)
            return
        if here.certain and gripper.certain:
            follow(work, gripper, probe, here)
        yield SAFE_POINT


def look_at_both(
    work: HandlingContext,
) -> Generator[Yielded, object, tuple[TipOff, TipOff, TipOff]]:
    """Look at the gripper where the maps were made, and at both tips; raises `NotAvailable`.

    The gripper is seen before the zoom runs, which moves the image, and both at a higher zoom
    where fibres are pushed.
    """
    image = yield from image_where_mapped(work)
    here = tip_off(work, image, work.gripper)
    try:
        yield from zoom_to(work, work.settings.calibration.compare_zoom)
        gripper, probe = yield from see_both(work)
    finally:
        work.shared.zoomed = None
    yield from zoom_to(work, work.settings.zoom)
    return here, gripper, probe


def follow(
    work: HandlingContext, gripper: TipOff, probe: TipOff, here: TipOff | None = None
) -> None:
    """Put right what has moved, and note it.

    Parameters
    ----------
    here : TipOff or None
        The gripper as it was seen before the zoom ran to where both were seen; None: it did not.
    """
    known, settings = work.calibration, work.settings.calibration
    if here is not None:
        shift_maps(work, gripper, lens=True)
        gripper, both = here, gripper
    else:
        both = gripper
    off = probe.off_um[0] - both.off_um[0], probe.off_um[1] - both.off_um[1]
    before = known.seen_off_um
    # A fibre at an edge of the probe is taken for the probe: it says nothing then.
    moved = (off[0] - before[0], off[1] - before[1]) if probe.certain else (0.0, 0.0)
    if not all(math.hypot(*each) <= settings.drift_far_um for each in (gripper.off_um, moved)):
        mark_unreliable(work)
        return
    limit_um = max(settings.drift_um, TIMES_STD * gripper.std_um)
    both_um = max(settings.drift_um, TIMES_STD * math.hypot(both.std_um, probe.std_um))
    if math.hypot(*gripper.off_um) > limit_um:
        shift_maps(work, gripper)
    if math.hypot(*moved) > both_um:
        x, y = known.probe_off_um
        known.probe_off_um = x + moved[0], y + moved[1]
        known.seen_off_um = off
    _note(work, gripper, moved, limit_um)


def mark_unreliable(work: HandlingContext) -> None:
    """Have everything that rests on where the tips are measured anew."""
    for key in (PLATE, HELD, PROBE):
        work.calibration.made.pop(key, None)
        work.calibration.registry.forget(key, work.gripper.name)


def _note(work: HandlingContext, gripper: TipOff, moved: Off, limit_um: float) -> None:
    registry, now_s = work.calibration.registry, work.clock.now_s()
    for key in (PLATE, HELD, PROBE):
        entry = registry.get(key, work.gripper.name)
        if entry is not None:
            values = dict(entry.values)
            if key == PROBE:
                values["off_x_um"], values["off_y_um"] = work.calibration.probe_off_um
                values["seen_x_um"], values["seen_y_um"] = work.calibration.seen_off_um
            registry.confirm(replace(entry, values=values), now_s)
    work.calibration.made[DRIFT] = Measured(now_s, gripper.std_um, "um")
    registry.put(
        CalibrationEntry(
            DRIFT,
            work.gripper.name,
            {
                "gripper_x_um": gripper.off_um[0],
                "gripper_y_um": gripper.off_um[1],
                "probe_x_um": moved[0],
                "probe_y_um": moved[1],
                "followed_from_um": limit_um,
            },
            gripper.std_um,
            "um",
            work.settings.calibration.drift_far_um,
            registry.now(),
            now_s,
            registry.session,
            zoom=work.settings.calibration.compare_zoom,
            how="both tips in one place",
        )
    )
