"""The axes of a station, with the face of a `DeviceManager`."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from threading import RLock
from typing import Final

from PySide6.QtCore import QObject, Signal

from cosmic.frame.clock import WALL, Clock, RatedClock
from cosmic.frame.errors import (
    CosmicError,
    MoveRefused,
    NotAvailable,
    ProtocolError,
    UnknownAxisError,
)
from cosmic.frame.network.travelling_errors import from_plain
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.api.remote_device import RemoteDevice, follow
from cosmic.mico.api.remote_foresight import foreseen
from cosmic.mico.api.remote_line import CommandLine, may_wait_here
from cosmic.mico.api.remote_mirrors import (
    RemoteCollision,
    RemoteLatch,
    RemoteLinks,
    RemotePoses,
    RemoteUndo,
)
from cosmic.mico.api.station_words import (
    AxisPositions,
    Begun,
    Ended,
    MicoFacts,
    MicoPicture,
    MicoStatus,
    Refused,
    StampedState,
    StartedTogether,
)
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.device_commander import CommanderType, DeviceCommander, join
from cosmic.mico.core.group_start import GroupStart, GroupStarted
from cosmic.mico.core.lease import Lease
from cosmic.mico.core.messages import MovementBegun, MovementEnded, PositionChanged
from cosmic.mico.core.movement import Movement
from cosmic.mico.core.orders import Motion, MoveTo, Order
from cosmic.mico.core.positioner import Confidence, PositionerState
from cosmic.mico.core.settings import MicoSettings, PositionerSettings
from cosmic.mico.core.undo import UndoEntry
from cosmic.mico.hw.interface import Channel, PositionerKind

logger = logging.getLogger(__name__)

NOT_YET: Final = "MiCo of the station has not told anything yet"


@dataclass(frozen=True, slots=True)
class RemoteController:
    """What is known of the controller at a station."""

    name: str = "a controller of another station"
    simulated: bool = False


class KnownStart(GroupStart):
    """The common start of axes at a station, which tells how it went."""

    def __init__(self, count: int) -> None:
        super().__init__(count, lambda _started: None)

    def note(self, skew_ms: float | None) -> None:
        """Take what was told."""
        self._skew_ms = skew_ms


class RemoteManager(QObject):
    """Keeps what a station tells of its axes, and sends what is commanded there; any thread.

    Reading takes what was told last and asks nobody. The signals are those of `DeviceManager`,
    in the threads that hear from the station.
    """

    changed = Signal()
    device_lost = Signal(object)
    group_refused = Signal(object)
    group_started = Signal(object)
    links_changed = Signal()

    def __init__(self, line: CommandLine) -> None:
        super().__init__()
        self._line = line
        self._lock = RLock()
        self._facts: MicoFacts | None = None
        self._status: MicoStatus | None = None
        self._states: dict[str, StampedState] = {}
        self._devices: dict[int, RemoteDevice] = {}
        self._away = NOT_YET
        self._others: dict[str, PositionerSettings] = {}
        self.settings = MicoSettings(positioner=())
        self.clock: Clock = RatedClock(1.0)
        self.controller = RemoteController()
        self.latch = RemoteLatch()
        self.lease = Lease()
        self.links = RemoteLinks(line)
        self.links.subscribe(self.links_changed.emit)
        self.collision = RemoteCollision(line)
        self.poses = RemotePoses(line)
        self.undo = RemoteUndo(self._order_undo)
        line.heed = self.take_event

    # What there is

    @property
    def exemptions(self) -> RemoteCollision | None:
        """What is left out of the collision check; None without a collision model."""
        return self.collision if self.collision.available else None

    @property
    def failure(self) -> str:
        """Why MiCo cannot work; empty when it can."""
        status = self._status
        return self._away or (status.failure if status is not None else NOT_YET)

    @property
    def missing(self) -> tuple[str, ...]:
        """What was configured and is not there, a line each."""
        status = self._status
        told = status.missing if status is not None else ()
        return (self._away, *told) if self._away else told

    @property
    def ready(self) -> bool:
        """True while axes can be moved."""
        status = self._status
        return not self._away and status is not None and status.ready

    @property
    def devices(self) -> Mapping[int, RemoteDevice]:
        """The devices by index."""
        return dict(self._devices)

    def names(self) -> list[str]:
        """Return the names of all axes: those configured, in their order, then any others."""
        status = self._status
        return [name for name in (status.names if status else ()) if name in self._states]

    def address(self, name: str) -> Channel:
        """Return where an axis is connected; raises `UnknownAxisError`."""
        return self.state(name).address

    def state(self, name: str) -> PositionerState:
        """Return the state of an axis as it was last told; raises `UnknownAxisError`."""
        found = self._states.get(name) if isinstance(name, str) else None
        if found is None:
            raise UnknownAxisError(name, self.names())
        return found.state

    def states(self) -> dict[str, PositionerState]:
        """Return the state of every axis by name."""
        with self._lock:
            return {name: each.state for name, each in self._states.items()}

    def positions(self) -> dict[str, float] | None:
        """Return the position of every axis in gate coordinates; None while one is unknown."""
        positions: dict[str, float] = {}
        for state in self.states().values():
            unknown = state.confidence is Confidence.UNKNOWN or not state.present
            if state.position is None or unknown:
                return None
            positions[state.name] = state.position
        return positions or None

    def device(self, name: str) -> RemoteDevice:
        """Return the device that drives an axis; raises `UnknownAxisError`."""
        return self._devices[self.address(name).device]

    def connect_device_commander(
        self,
        index: int,
        commander: DeviceCommander,
        kind: CommanderType = CommanderType.INPUT_OUTPUT,
    ) -> None:
        """Join a commander to the device `index`; raises `NotAvailable`."""
        device = self._devices.get(index)
        if device is None:
            raise NotAvailable(f"there is no device {index}")
        join(device.slots, commander, kind)

    # Commanding

    def check(self, motions: Mapping[str, Motion], *, consent: bool = False) -> MoveVerdict:
        """Return what the gate of the station says, without moving anything.

        Where this thread must not wait (a window), return what can be said without collisions;
        the gate of the station decides each movement in any case.
        """
        for name in motions:
            self.address(name)
        if not may_wait_here():
            return foreseen(motions, self, consent=consent)
        try:
            said = self._line.call("check", {"motions": dict(motions), "consent": consent})
        except MoveRefused as exc:
            return exc.verdict
        except CosmicError as exc:
            return refuse(Reason.NO_ANSWER, f"the station does not answer: {exc}")
        if not isinstance(said, MoveVerdict):
            return refuse(Reason.NO_ANSWER, f"the station answers {said!r:.80}")
        return said

    def order_together(
        self,
        motions: Mapping[str, Motion],
        *,
        source: str,
        consent: bool = False,
        linked: bool = True,
        match_arrival: bool = False,
        follows: Mapping[str, Movement] | None = None,
    ) -> dict[str, Order]:
        """Have `motions` decided together and started back to back, or none of them.

        Where this thread must not wait, a refusal is how the movements end; otherwise raises as
        `DeviceManager.order_together`.
        """
        names = dict(motions)
        for name in motions:
            self.address(name)
        if linked:
            for name, motion in motions.items():
                for other in self.links.companions(name):
                    names.setdefault(other, motion)
        arguments: dict[str, object] = {
            "motions": dict(motions),
            "consent": consent,
            "linked": linked,
            "match_arrival": match_arrival,
            "source": source,
        }
        if follows is not None:
            arguments["follows"] = {
                name: self._line.number_of(each) for name, each in follows.items()
            }
        return self._together("order_together", names, arguments, source=source)

    def _order_undo(self, entry: UndoEntry) -> dict[str, Order]:
        motions = {
            name: MoveTo(where, self.state(name).unit) for name, where in entry.before.items()
        }
        return self._together("undo", motions, {"number": entry.number}, source="undo")

    def _together(
        self,
        function: str,
        motions: Mapping[str, Motion],
        arguments: dict[str, object],
        *,
        source: str,
    ) -> dict[str, Order]:
        start = KnownStart(len(motions)) if len(motions) > 1 else None
        orders = {
            name: Order(self.address(name).channel, motion, "", source, start=start)
            for name, motion in motions.items()
        }
        for order in orders.values():
            self._line.note_number(order.movement, order.number)
            order.movement.on_cancel(partial(self._line.withdraw, order.number))
        arguments["numbers"] = {name: order.number for name, order in orders.items()}

        def send() -> None:
            ongoing = self._line.call(function, arguments)
            follow(orders, ongoing, self.take_event, start.note if start is not None else None)

        if may_wait_here():
            try:
                self._line.run(send)
            except MoveRefused as exc:
                self.group_refused.emit(exc.verdict)
                raise
        else:
            self._line.post(lambda: self._send_or_fail(send, orders))
        return orders

    def _send_or_fail(self, send: Callable[[], None], orders: Mapping[str, Order]) -> None:
        try:
            send()
        except CosmicError as exc:
            for order in orders.values():
                order.movement.fail(exc)
            if isinstance(exc, MoveRefused):
                self.group_refused.emit(exc.verdict)

    def stop(self, reason: str = "stop") -> None:
        """Stop every axis of the station, past every queue; needs no lease.

        Raises
        ------
        StationAway, StationTimeout
            It did not get there; in a thread that must not wait, the policy is told instead.
        """
        self._line.at_once("stop", {"reason": reason})
        logger.warning("stop: %s", reason)

    def reset_stop(self) -> None:
        """Allow motion again; only the holder of the lease may, and the station's operator."""
        self._line.do("reset_stop", {})

    # What the station tells

    def take_facts(self, facts: MicoFacts, scene: SceneModel | None) -> None:
        """Take what does not change; raises `ProtocolError`."""
        try:
            settings = MicoSettings.model_validate_json(facts.settings)
            others = [PositionerSettings.model_validate_json(each) for each in facts.others]
        except ValueError as exc:
            raise ProtocolError(f"the station's settings are not understood: {exc}") from exc
        with self._lock:
            self._facts = facts
            self.settings = settings
            self._others = {each.name: each for each in (*settings.positioner, *others)}
            self.clock = RatedClock(facts.rate)
            self.controller = RemoteController(facts.controller, facts.simulated)
        self.collision.learn(scene)

    def take_picture(self, picture: MicoPicture) -> None:
        """Begin anew with everything as it is at the station now."""
        with self._lock:
            self._away = ""
            self._status = None
            self._states = {}
        for each in picture.states:
            self.heed(each)
        self._take_status(picture.status)

    def lose(self, why: str) -> None:
        """Show that nobody knows how the axes are any more."""
        with self._lock:
            self._away = why
            lost = [_lost(each.state, why) for each in self._states.values()]
            for state in lost:
                self._states[state.name] = replace(self._states[state.name], state=state)
        for state in lost:
            self._devices[state.address.device].state_changed.emit(state)
        self.changed.emit()

    def take_event(self, event: object) -> None:
        """Take one thing that happened."""
        match event:
            case StampedState():
                self.heed(event)
            case MicoStatus():
                self._take_status(event)
            case Refused():
                self._on_refused(event)
            case Begun():
                begun = MovementBegun(
                    event.name,
                    event.motion,
                    event.from_position,
                    event.target,
                    event.unit,
                    event.time_s,
                    event.source,
                )
                self._tell_device(event.name, lambda device: device.movement_begun.emit(begun))
            case Ended():
                error = None if event.error is None else from_plain(event.error)
                ended = MovementEnded(event.name, event.position, error)
                self._tell_device(event.name, lambda device: device.movement_ended.emit(ended))
            case StartedTogether():
                self.group_started.emit(GroupStarted(event.names, event.skew_ms))
            case None:
                pass
            case _:
                logger.debug("the station tells something unknown: %r", event)

    def take_positions(self, told: object) -> None:
        """Take where the axes are."""
        if not isinstance(told, AxisPositions):
            return
        for name, (stamp, position, age_s) in told.places.items():
            known = self._states.get(name)
            if known is None or stamp < known.stamp or self._away:
                continue
            state = replace(known.state, position=position)
            self.heed(StampedState(stamp, state, age_s))

    def heed(self, stamped: StampedState) -> None:
        """Take the state of an axis, unless a newer one is known."""
        state = replace(stamped.state, read_wall_s=WALL.now_s() - stamped.age_s)
        with self._lock:
            before = self._states.get(state.name)
            if before is not None and stamped.stamp < before.stamp:
                return
            self._states[state.name] = replace(stamped, state=state)
            device = self._device(state.address.device)
            device.container.put(state, self._settings_of(state))
        if before is not None and _alike(before.state, state):
            return
        device.state_changed.emit(state)
        if state.position is not None and (
            before is None or before.state.position != state.position
        ):
            device.position_changed.emit(PositionChanged(state.name, state.position, state.unit))

    def _device(self, index: int) -> RemoteDevice:
        device = self._devices.get(index)
        if device is None:
            device = RemoteDevice(index, self._line)
            self._devices = {**self._devices, index: device}
        return device

    def _settings_of(self, state: PositionerState) -> PositionerSettings:
        found = self._others.get(state.name)
        if found is not None:
            return found
        where = state.address
        return PositionerSettings.model_construct(
            name=state.name, device=where.device, channel=where.channel, kind=state.kind.value
        )

    def _take_status(self, status: MicoStatus) -> None:
        with self._lock:
            before = self._status
            if before is not None and status.stamp < before.stamp:
                return
            self._status = status
        self.latch.show(status.stop)
        self.links.show(status.links)
        self.poses.show(status.poses)
        self.undo.show(status.undo)
        self.collision.show(status.taken_out, status.contacts)
        if before is None or _shape(before) != _shape(status):
            self.changed.emit()

    def _on_refused(self, refused: Refused) -> None:
        if refused.together:
            self.group_refused.emit(refused.verdict)
        elif refused.verdict.axis:
            verdict = refused.verdict
            name = refused.verdict.axis
            self._tell_device(name, lambda device: device.movement_refused.emit(verdict))

    def _tell_device(self, name: str, how: Callable[[RemoteDevice], None]) -> None:
        known = self._states.get(name)
        if known is not None:
            how(self._device(known.state.address.device))


def _alike(one: PositionerState, other: PositionerState) -> bool:
    return replace(one, read_wall_s=other.read_wall_s) == other


def _lost(state: PositionerState, why: str) -> PositionerState:
    sensed = state.kind is not PositionerKind.OPEN_LOOP
    confidence = Confidence.UNKNOWN if sensed else state.confidence
    return replace(state, present=False, in_motion=False, error=why, confidence=confidence)


def _shape(status: MicoStatus) -> tuple[object, ...]:
    return status.ready, status.failure, status.names, status.missing
