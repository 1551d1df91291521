"""What can be said of a movement here, before the station decides it."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from cosmic.frame.clock import WALL
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.core.collision.checker import NoCollisionModel
from cosmic.mico.core.motion.checks import Limits, PlatformSnapshot, Request, check_move
from cosmic.mico.core.motion.orders import Motion

if TYPE_CHECKING:
    from cosmic.mico.api.remote_manager import RemoteManager

_HERE: Final = "here"
_TEXT: Final = "nothing known here is in the way; the gate of the station decides"


def foreseen(
    motions: Mapping[str, Motion], manager: "RemoteManager", *, consent: bool
) -> MoveVerdict:
    """Judge `motions` by all but collisions and the lease, with what the station told last."""
    picture = PlatformSnapshot(
        stop_reason=manager.latch.state.reason,
        token=_HERE,
        states=manager.states(),
        held={},
        targets={},
        now_wall_s=WALL.now_s(),
        rules=Limits.of(manager.settings),
    )
    requests = [Request(name, motion, _HERE, consent) for name, motion in motions.items()]
    verdict = check_move(requests, picture, NoCollisionModel(), advice=False).verdict
    return replace(verdict, text=_TEXT) if verdict.allowed else verdict
