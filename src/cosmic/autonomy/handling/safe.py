"""Leaving things safe after a procedure was aborted or has failed."""

from cosmic.autonomy.handling.prepare import retract_probe
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.operation import Steps


def make_safe(work: FibreWork) -> Steps:
    """Take the probe back and the gripper up; nothing is opened, for a fibre may be held."""
    work.ready, work.surveyed, work.zoomed = False, False, None
    yield from retract_probe(work)
    with work.mico.collision.contact("grasp"):
        yield work.go_up(max(work.settings.places.travel_um, work.height_now()))
