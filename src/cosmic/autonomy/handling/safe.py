"""Leaving things safe after a procedure was aborted or has failed."""

from cosmic.autonomy.handling.prepare import retract_probe
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.operation import Steps


def make_safe(work: FibreWork) -> Steps:
    """Take the probe back and grippers up; nothing is opened, for a fibre may be held."""
    work.surveyed, work.zoomed = False, None
    for hand in work.hands:
        hand.ready = False
    touching = [hand for hand in work.hands if hand.calibration.touching]
    yield from retract_probe((touching or [work])[0])
    with work.mico.collision.contact("grasp"):
        for hand in work.hands:
            yield hand.go_up(max(hand.settings.places.travel_um, hand.height_now()))
