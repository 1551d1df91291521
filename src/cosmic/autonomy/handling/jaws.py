"""The jaws of a gripper without a sensor: opened and closed by steps, and counted."""

import logging
from typing import Final

from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.retrying_move import RetryingMove
from cosmic.autonomy.procedures.operation import Steps
from cosmic.frame.errors import MoveRefused, NotAvailable

logger = logging.getLogger(__name__)

CLOSED_STD_UM: Final = 10.0
"""How well jaws that were run against their stop are known to be closed."""
OVER: Final = 0.1
"""Part of the travel by which the jaws are closed too far, to be closed for sure."""
COUNT_UM: Final = 130.0
"""How wrong the opening counted may be for a calibration; images show the jaws all the same."""


def zero_jaws(work: HandlingContext) -> Steps:
    """Bring the opening counted in step with the true one, and open the jaws as for a grasp.

    Steps against a stop are counted and move nothing: closed to one stop, then opened against the
    other until the count says so.
    """
    full, count = work.settings.grasp.full_um, work.mico[work.gripper.gap_axis]
    close = -(1.0 + OVER) * full
    mark_gap_unknown(work)
    yield from move_jaws(work, close)
    yield from move_jaws(work, max(0.0, full - (count.position_um or 0.0)))
    # From closed again: nothing is between jaws that come down no wider than they should be.
    yield from move_jaws(work, close)
    note_gap(work, 0.0, CLOSED_STD_UM)
    yield from move_jaws(work, work.settings.grasp.gap_um)


def mark_gap_unknown(work: HandlingContext) -> None:
    """Have the gate take the jaws to be anywhere: before they are run against their stop."""
    _set_estimate(work, work.mico[work.gripper.gap_axis].position_um or 0.0, None)


def note_gap(work: HandlingContext, gap_um: float, std_um: float) -> None:
    """Take the opening that is known by an end stop or by sight; the gate counts from it."""
    work.gap_um = gap_um
    _set_estimate(work, gap_um, std_um)


def note_closed(work: HandlingContext) -> None:
    """Remember at what count the jaws are closed around the fibre: from there they open."""
    if work.fibre is not None:
        work.fibre.closed_at_um = work.mico[work.gripper.gap_axis].position_um or 0.0


def _set_estimate(work: HandlingContext, gap_um: float, std_um: float | None) -> None:
    axis = work.mico[work.gripper.gap_axis]
    try:
        axis.set_estimate(gap_um, std_um=std_um)
    except (MoveRefused, NotAvailable) as exc:
        logger.warning("the opening is not taken: %s", exc)


def in_step(work: HandlingContext) -> bool:
    """Return whether the opening counted is about the true one."""
    counted = work.mico[work.gripper.gap_axis].position_um
    known = work.gap_um is not None and counted is not None
    return known and abs((counted or 0.0) - (work.gap_um or 0.0)) < COUNT_UM


def open_jaws(work: HandlingContext) -> Steps:
    """Open the jaws as wide as they stand before a fibre, from where they are counted to be."""
    yield from move_jaws(work, work.settings.grasp.gap_um - (work.gap_um or 0.0))


def move_jaws(work: HandlingContext, by_um: float, *, frequency_hz: float | None = None) -> Steps:
    """Open the jaws, or close them: open loop, a step at full voltage is what the file says.

    As fast as configured unless `frequency_hz` says otherwise.
    """
    axis = work.mico[work.gripper.gap_axis]
    step_um = next(
        (
            each.step_um
            for each in work.mico.settings.positioner
            if each.name == work.gripper.gap_axis and each.step_um
        ),
        1.0,
    )
    steps = round(by_um / step_um)
    if steps:
        # They may be at the plate; the gate knows of no smaller movement than their whole travel.
        with work.mico.collision.contact("grasp"):
            hertz = frequency_hz or work.settings.grasp.gripper_hz
            yield RetryingMove(lambda: axis.steps(steps, frequency_hz=hertz, wait=False))
    if work.gap_um is not None:
        work.gap_um = max(0.0, work.gap_um + steps * step_um)
