"""What is known here of axes at another station, and what can be foreseen from it."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final
from weakref import WeakKeyDictionary

from cosmic.frame.clock import WALL
from cosmic.frame.declaration import Declared
from cosmic.frame.events import Event
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.collision.checker import NoCollisionModel
from cosmic.mico.core.motion.checks import Limits, PlatformSnapshot, Request, check_move
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import Motion
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import PositionerKind

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
    """Judge `motions` by all but collisions and the lease, with what the station published last."""
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


def _unforeseen(_motions: Mapping[str, Motion], _consent: bool) -> MoveVerdict:
    return refuse(Reason.NO_ANSWER, "no state of the station has arrived yet")


class RemoteAxisState:
    """What is known here of an axis at another station; any thread.

    Attributes
    ----------
    platform : callable
        Returns what the platform file says.
    foresee : callable
        Judges motions by what is known here, where nothing may be waited for.
    changed : Event
        The state of the axis, whatever of it has changed.
    keys : mapping of Movement
        Under which key the station knows a movement.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.platform: Callable[[], MicoSettings] = lambda: MicoSettings(positioner=())
        self.foresee: Callable[[Mapping[str, Motion], bool], MoveVerdict] = _unforeseen
        self.changed: Event[PositionerState] = Event()
        self.keys: WeakKeyDictionary[Movement, str] = WeakKeyDictionary()
        self._newest: tuple[float, float, float] | None = None
        self._seen: tuple[object, object, str, PositionerState] | None = None

    def move(self, position: float, std: float, read_wall_s: float) -> None:
        """Take note of where it is."""
        self._newest = (position, std, read_wall_s)

    def state(self, axis: Declared, published: PositionerState) -> PositionerState:
        """Return the state that was published last, with the newest position; absent while away."""
        newest, away, seen = self._newest, axis.away, self._seen
        if seen is not None and seen[0] is published and seen[1] is newest and seen[2] == away:
            return seen[3]
        position, std, read_wall_s = published.position, published.std, published.read_wall_s
        if newest is not None and newest[2] > read_wall_s:
            position, std, read_wall_s = newest
        read_wall_s = axis.wall_s_here(read_wall_s)
        state = replace(published, position=position, std=std, read_wall_s=read_wall_s)
        if away:
            sensed = state.kind is not PositionerKind.OPEN_LOOP
            confidence = Confidence.UNKNOWN if sensed else state.confidence
            state = replace(
                state, present=False, in_motion=False, error=away, confidence=confidence
            )
        self._seen = (published, newest, away, state)
        return state
