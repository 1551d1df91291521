"""What MiCo says between stations, as frozen data."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from cosmic.frame.network.transfer import transferable
from cosmic.frame.units import AxisUnit
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.api.ways import Way
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.model import (
    AllowedPair,
    Contact,
    Drive,
    Joint,
    JointKind,
    SceneModel,
    Shape,
    WatchedPair,
)
from cosmic.mico.core.motion.links import Link
from cosmic.mico.core.motion.messages import MovementBegun
from cosmic.mico.core.motion.orders import (
    Calibrate,
    Jog,
    MoveBy,
    MoveTo,
    Reference,
    Steer,
    Step,
    ToEndStop,
)
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.core.motion.stop_latch import StopState
from cosmic.mico.core.motion.undo import UndoEntry
from cosmic.mico.core.poses import Pose
from cosmic.mico.hw.interface import (
    Activity,
    Channel,
    Direction,
    PositionerKind,
    PositionerType,
    ReferenceKind,
)

EVENTS: Final = "mico/events"
"""Topic with everything but positions, in order: the rule `ALL`."""
POSITIONS: Final = "mico/positions"
"""Topic with where the axes are: the rule `LATEST`."""
COMMANDS: Final = "mico/commands"
"""Topic with what other processes command, a line each: the rule `ALL`."""

SentMotion = MoveTo | MoveBy | Step | Calibrate | Reference | ToEndStop


@transferable
@dataclass(frozen=True, slots=True)
class MicoFacts:
    """What does not change while MiCo runs.

    Attributes
    ----------
    settings, others : str and tuple of str
        Section ``[mico]`` of the platform file, and axes found that it does not name; as JSON.
    platform, controller : str
        Names of the platform and of the library.
    rate : float
        How many times faster than the wall its clock runs at most.
    checks : bool
        Movements are checked for collisions.
    """

    settings: str
    others: tuple[str, ...]
    platform: str
    controller: str
    simulated: bool
    rate: float
    checks: bool


@transferable
@dataclass(frozen=True, slots=True)
class StampedState:
    """The state of an axis; a larger stamp is newer, and `age_s` says when it was read."""

    stamp: int
    state: PositionerState
    age_s: float


@transferable
@dataclass(frozen=True, slots=True)
class AxisPositions:
    """Where the axes are.

    Attributes
    ----------
    places : mapping of tuple
        By axis: stamp, position in gate coordinates, and how long ago it was read, in seconds.
    """

    places: Mapping[str, tuple[int, float, float]]


@transferable
@dataclass(frozen=True, slots=True)
class MicoStatus:
    """What windows show of MiCo as a whole.

    Attributes
    ----------
    stamp : int
        A larger one is newer.
    ready : bool
        Axes can be moved.
    failure : str
        Why MiCo cannot work.
    taken_out, contacts : tuple of str
        Axes that are not checked for collisions, and contacts that are allowed.
    """

    stamp: int
    ready: bool
    failure: str
    names: tuple[str, ...]
    missing: tuple[str, ...]
    stop: StopState
    links: tuple[Link, ...]
    taken_out: tuple[str, ...]
    contacts: tuple[str, ...]
    undo: tuple[UndoEntry, ...]
    poses: tuple[Pose, ...]

    @property
    def outline(self) -> tuple[object, ...]:
        """What of it is told by `changed`."""
        return self.ready, self.failure, self.names, self.missing


@transferable
@dataclass(frozen=True, slots=True)
class MicoPicture:
    """Everything that a window needs to begin with."""

    status: MicoStatus
    states: tuple[StampedState, ...]


@transferable
@dataclass(frozen=True, slots=True)
class Refused:
    """The gate refused a movement, of one axis or (`together`) of several."""

    verdict: MoveVerdict
    together: bool


@transferable
@dataclass(frozen=True, slots=True)
class Begun:
    """A movement was sent to the controller; as `MovementBegun`."""

    name: str
    motion: SentMotion | Jog
    from_position: float | None
    target: float | None
    unit: AxisUnit
    time_s: float
    source: str

    def heard(self) -> MovementBegun:
        """Return it as this process knows it."""
        return MovementBegun(
            name=self.name,
            motion=self.motion,
            from_position=self.from_position,
            target=self.target,
            unit=self.unit,
            time_s=self.time_s,
            source=self.source,
        )


@transferable
@dataclass(frozen=True, slots=True)
class Ended:
    """A movement ended; as `MovementEnded`, with the exception as plain values."""

    name: str
    position: float | None
    error: list[object] | None


@transferable
@dataclass(frozen=True, slots=True)
class StartedTogether:
    """Several axes were started back to back; as `GroupStarted`."""

    names: tuple[str, ...]
    skew_ms: float


@transferable
@dataclass(frozen=True, slots=True)
class AxisOutcome:
    """How a movement of one axis ended.

    Attributes
    ----------
    position : float or None
        What the movement returned.
    error : list or None
        The exception that it ended with, as plain values.
    state : StampedState or None
        How the axis is since.
    """

    position: float | None
    error: list[object] | None
    state: StampedState | None


@transferable
@dataclass(frozen=True, slots=True)
class Outcomes:
    """How the movements of one order ended, by axis, and how MiCo is since."""

    of: Mapping[str, AxisOutcome]
    status: MicoStatus
    skew_ms: float | None = None


for _each in (
    MoveTo, MoveBy, Step, Jog, Steer, Calibrate, Reference, ToEndStop, Direction,
    Activity, Channel, PositionerKind, PositionerType, ReferenceKind, Confidence,
    PositionerState, StopState, Link, UndoEntry, Pose, Way, Approach,
    SceneModel, Joint, JointKind, Shape, Drive, WatchedPair, AllowedPair, Contact,
):  # fmt: skip
    transferable(_each)
