"""The axes of a station, as they were told of last."""

import logging
from collections.abc import Mapping
from dataclasses import replace
from threading import RLock
from typing import Final

from PySide6.QtCore import QObject, Signal

from cosmic.frame.clock import WALL, Clock, RatedClock
from cosmic.frame.errors import NotAvailable, ProtocolError, UnknownAxisError
from cosmic.mico.api.remote_device import RemoteDevice
from cosmic.mico.api.remote_line import CommandLine
from cosmic.mico.api.remote_mirrors import (
    RemoteCollision,
    RemoteController,
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
from cosmic.mico.core.motion.device_commander import CommanderType, DeviceCommander
from cosmic.mico.core.motion.group_start import GroupStarted
from cosmic.mico.core.motion.lease import Lease
from cosmic.mico.core.motion.orders import Order
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.core.motion.undo import UndoEntry
from cosmic.mico.core.settings import MicoSettings, PositionerSettings
from cosmic.mico.hw.interface import Channel, PositionerKind

logger = logging.getLogger(__name__)

_OUTDATED: Final = -1
NOT_YET: Final = "MiCo of the station has not told anything yet"


class RemoteAxes(QObject):
    """Keeps what a station tells of its axes; any thread.

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
        self._status: MicoStatus | None = None
        self._states: dict[str, StampedState] = {}
        self._telling = RLock()
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
        commander.attach(device.slots, kind)

    def _order_undo(self, entry: UndoEntry) -> dict[str, Order]:
        raise NotImplementedError

    # What the station tells

    def take_facts(self, facts: MicoFacts, scene: SceneModel | None) -> None:
        """Take what does not change; raises `ProtocolError`."""
        try:
            settings = MicoSettings.model_validate_json(facts.settings)
            others = [PositionerSettings.model_validate_json(each) for each in facts.others]
        except ValueError as exc:
            raise ProtocolError(f"the station's settings are not understood: {exc}") from exc
        with self._lock:
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
            for name, known in self._states.items():
                self._states[name] = replace(known, stamp=_OUTDATED)
        for each in picture.states:
            self.heed(each)
        with self._lock:
            kept = {n: each for n, each in self._states.items() if each.stamp != _OUTDATED}
            self._states = kept
        self._take_status(picture.status)

    def lose(self, why: str) -> None:
        """Show that nobody knows how the axes are any more."""
        with self._lock:
            self._away = why
            lost = [_lost(each.state, why) for each in self._states.values()]
            for state in lost:
                self._states[state.name] = replace(self._states[state.name], state=state)
        for state in lost:
            self._tell(state.name)
        self.changed.emit()

    def take_event(self, event: object) -> None:
        """Take one thing that happened."""
        match event:
            case StampedState():
                self.heed(event)
            case MicoStatus():
                self._take_status(event)
            case Refused(together=True):
                self.group_refused.emit(event.verdict)
            case Refused():
                self._tell_device(event.verdict.axis, event)
            case Begun() | Ended():
                self._tell_device(event.name, event)
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
            if self._away or (before is not None and stamped.stamp < before.stamp):
                return
            self._states[state.name] = replace(stamped, state=state)
            device = self._device(state.address.device)
            device.container.put(state, self._settings_of(state))
        self._tell(state.name)

    def _tell(self, name: str) -> None:
        """Emit the newest state of an axis; one at a time, so that the newest comes last."""
        with self._telling:
            known = self._states.get(name)
            if known is None:
                return
            device = self._device(known.state.address.device)
            device.news.tell(known.state)

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
        if before is None or before.outline != status.outline:
            self.changed.emit()

    def _tell_device(self, name: str, event: Begun | Ended | Refused) -> None:
        known = self._states.get(name)
        if known is not None:
            self._device(known.state.address.device).tell(event)


def _lost(state: PositionerState, why: str) -> PositionerState:
    sensed = state.kind is not PositionerKind.OPEN_LOOP
    confidence = Confidence.UNKNOWN if sensed else state.confidence
    return replace(state, present=False, in_motion=False, error=why, confidence=confidence)
