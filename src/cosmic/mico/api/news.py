"""What MiCo tells of movements and positions, as frozen data, and who collects it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Lock
from typing import Final

from PySide6.QtCore import QObject, Qt, SignalInstance

from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError
from cosmic.frame.network.travelling_errors import from_plain, to_plain
from cosmic.frame.units import AxisUnit
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.core.motion.group_start import GroupStarted
from cosmic.mico.core.motion.manager import DeviceManager
from cosmic.mico.core.motion.messages import MovementBegun, MovementEnded, PositionChanged
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
from cosmic.mico.core.motion.positioner import PositionerState, class_for, positions_of
from cosmic.mico.core.trajectory.recorder import (
    RecordedBegin,
    RecordedEnd,
    resting_of,
)

PERIOD_S: Final = 1 / 30
"""The least time between two tellings of positions."""

SentMotion = MoveTo | MoveBy | Step | Calibrate | Reference | ToEndStop
"""What another station may ask of an axis, beside a jog."""


@dataclass(frozen=True, slots=True)
class AxisPositions:
    """Where the axes are.

    Attributes
    ----------
    of : mapping of tuple
        By axis: position in gate coordinates, standard deviation, and the wall time of the reading
        where the axes are.
    """

    of: Mapping[str, tuple[float, float, float]]


@dataclass(frozen=True, slots=True)
class AxisRefused:
    """The gate refused a movement, of one axis or (`together`) of several."""

    verdict: MoveVerdict
    together: bool


@dataclass(frozen=True, slots=True)
class AxisBegun:
    """A movement was sent to the controller; as `MovementBegun`, with what was so then.

    Attributes
    ----------
    positions : mapping of float
        Where all axes were, as far as that is known, in gate coordinates.
    resting : tuple of str
        The axes at rest.
    sensed : bool
        The axis has a sensor.
    frequency_hz : int or None
        Its closed-loop frequency; None where that is the configured one.
    """

    name: str
    motion: SentMotion | Steer | Jog
    from_position: float | None
    target: float | None
    unit: AxisUnit
    time_s: float
    source: str
    positions: Mapping[str, float]
    resting: tuple[str, ...]
    sensed: bool
    frequency_hz: int | None

    def heard(self) -> MovementBegun:
        """Return it as devices tell it."""
        return MovementBegun(
            name=self.name,
            motion=self.motion,
            from_position=self.from_position,
            target=self.target,
            unit=self.unit,
            time_s=self.time_s,
            source=self.source,
        )

    def recorded(self) -> RecordedBegin:
        """Return it as a recorder of movements takes it."""
        resting = frozenset(self.resting)
        return RecordedBegin(self.heard(), self.positions, resting, self.sensed, self.frequency_hz)


@dataclass(frozen=True, slots=True)
class AxisEnded:
    """A movement ended; as `MovementEnded`, with the exception as plain values.

    Attributes
    ----------
    positions : mapping of float
        Where all axes were then, as far as that is known, in gate coordinates.
    time_s : float
        Platform time.
    """

    name: str
    position: float | None
    error: list[object] | None
    positions: Mapping[str, float]
    time_s: float

    def heard(self) -> MovementEnded:
        """Return it as devices tell it."""
        error = None if self.error is None else from_plain(self.error)
        return MovementEnded(self.name, self.position, error)

    def recorded(self) -> RecordedEnd:
        """Return it as a recorder of movements takes it."""
        return RecordedEnd(self.name, self.positions, self.time_s, well=self.error is None)


@dataclass(frozen=True, slots=True)
class AxesStarted:
    """Several axes were started back to back; as `GroupStarted`."""

    names: tuple[str, ...]
    skew_ms: float


MovementNews = AxisRefused | AxisBegun | AxisEnded | AxesStarted
_DIRECT: Final = Qt.ConnectionType.DirectConnection


def _listen(*pairs: tuple[SignalInstance, Callable[..., object]]) -> Callable[[], None]:
    """Call a function at each signal, in its thread; return what ends that."""
    connections = [signal.connect(slot, _DIRECT) for signal, slot in pairs]
    lock = Lock()

    def end() -> None:
        with lock:
            ended = connections.copy()
            connections.clear()
        for each in ended:
            QObject.disconnect(each)

    return end


def follow_movements(
    manager: DeviceManager, receiver: Callable[[MovementNews], object]
) -> Callable[[], None]:
    """Tell of every movement; returns the function that ends it. In the threads of the devices."""

    def on_begun(event: MovementBegun) -> None:
        states = manager.states()
        state = states[event.name]
        receiver(
            AxisBegun(
                event.name,
                event.motion,
                event.from_position,
                event.target,
                event.unit,
                event.time_s,
                event.source,
                positions_of(states),
                tuple(resting_of(states)),
                class_for(state.kind, state.positioner).has_sensor,
                _own_frequency_hz(manager, state),
            )
        )

    def on_ended(event: MovementEnded) -> None:
        error = to_plain(event.error) if isinstance(event.error, CosmicError) else None
        positions = positions_of(manager.states())
        now_s = manager.clock.now_s()
        receiver(AxisEnded(event.name, event.position, error, positions, now_s))

    def on_refused(verdict: MoveVerdict) -> None:
        receiver(AxisRefused(verdict, together=False))

    def on_group_refused(verdict: MoveVerdict) -> None:
        receiver(AxisRefused(verdict, together=True))

    def on_group_started(started: GroupStarted) -> None:
        receiver(AxesStarted(started.names, started.skew_ms))

    return _listen(
        (manager.movement_begun, on_begun),
        (manager.movement_ended, on_ended),
        (manager.movement_refused, on_refused),
        (manager.group_refused, on_group_refused),
        (manager.group_started, on_group_started),
    )


def _own_frequency_hz(manager: DeviceManager, state: PositionerState) -> int | None:
    """Return the closed-loop frequency of an axis; None where it is the configured one."""
    found = manager.device(state.name).container.positioner(state.address.channel)
    own = found.frequency_hz if found is not None else None
    return None if own == manager.settings.defaults.closed_loop_frequency_hz else own


def follow_positions(
    manager: DeviceManager, receiver: Callable[[AxisPositions], object]
) -> Callable[[], None]:
    """Tell where the axes are while one moves, at most 30 times a second; returns what ends it.

    In the threads of the devices. The last position of a movement is told by the state of the axis.
    """
    lock, sent_s = Lock(), -PERIOD_S

    def on_position(_event: PositionChanged) -> None:
        nonlocal sent_s
        now_s = WALL.now_s()
        with lock:
            due = now_s - sent_s >= PERIOD_S
            sent_s = now_s if due else sent_s
        if due:
            states = manager.states().values()
            receiver(
                AxisPositions(
                    {
                        each.name: (each.position, each.std, each.read_wall_s)
                        for each in states
                        if each.position is not None
                    }
                )
            )

    return _listen((manager.position_changed, on_position))
