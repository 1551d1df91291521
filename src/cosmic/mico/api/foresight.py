"""What can be said of a movement without asking the gate of the station that would make it."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from cosmic.frame.clock import WALL
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.core.collision.checker import NoCollisionModel
from cosmic.mico.core.motion.checks import Limits, PlatformSnapshot, Request, check_move
from cosmic.mico.core.motion.orders import Motion
from cosmic.mico.core.motion.positioner import PositionerState
from cosmic.mico.core.settings import MicoSettings

_HERE: Final = "here"
_TEXT: Final = "nothing known here is in the way; the gate of the station decides"


def foreseen(
    motions: Mapping[str, Motion],
    states: Mapping[str, PositionerState],
    settings: MicoSettings,
    *,
    consent: bool,
    stop_reason: str | None = None,
) -> MoveVerdict:
    """Judge `motions` by all but collisions and the lease, with what the station told last."""
    snapshot = PlatformSnapshot(
        stop_reason=stop_reason,
        token=_HERE,
        states=states,
        held={},
        targets={},
        now_wall_s=WALL.now_s(),
        rules=Limits.of(settings),
    )
    requests = [Request(name, motion, _HERE, consent) for name, motion in motions.items()]
    verdict = check_move(requests, snapshot, NoCollisionModel(), advice=False).verdict
    return replace(verdict, text=_TEXT) if verdict.allowed else verdict
