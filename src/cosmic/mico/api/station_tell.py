"""Tells other processes how the axes are."""

from collections.abc import Callable
from dataclasses import replace
from threading import Condition, RLock
from typing import TYPE_CHECKING, Final, Protocol

from PySide6.QtCore import Qt
from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.travelling_errors import to_plain
from cosmic.frame.threads import WorkerThread
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.api.station_words import (
    EVENTS,
    POSITIONS,
    AxisPositions,
    Begun,
    Ended,
    MicoPicture,
    MicoStatus,
    Refused,
    StampedState,
    StartedTogether,
)
from cosmic.mico.core.motion.device import Device
from cosmic.mico.core.motion.group_start import GroupStarted
from cosmic.mico.core.motion.messages import MovementBegun, MovementEnded
from cosmic.mico.core.motion.positioner import PositionerState

if TYPE_CHECKING:
    from cosmic.mico.api.application import MicoApplication

PERIOD_S: Final = 1 / 30
"""The least time between two tellings of positions."""
LOOK_S: Final = 0.5
"""How often it is looked whether something changed that nobody told."""


class Publishing(Protocol):
    """Where it is told: a station."""

    def publish(self, topic: str, payload: object) -> None:
        """Publish to a topic; returns at once."""


class MicoTeller(WorkerThread):
    """Keeps what was told last of each axis, with a stamp that grows, and tells what changed.

    A state goes out at once, in the order in which things happened; where nothing but the
    position is new, it goes out with the positions, at most 30 times a second.
    """

    def __init__(self, application: "MicoApplication", policy: FailurePolicy) -> None:
        super().__init__("mico tells", policy)
        self._application = application
        self._manager = application.manager
        self._changed = Condition(RLock())
        self._to: Publishing | None = None
        self._stamp = 0
        self._states: dict[str, StampedState] = {}
        self._moved: set[str] = set()
        self._status_due = True
        self._status = self._read_status()
        self._joined: dict[int, Device] = {}
        self._undo: list[Callable[[], object]] = []

    # Beginning and ending

    def begin(self, to: Publishing) -> None:
        """Tell everything from now on."""
        self._to = to
        self._join_devices()
        manager, direct = self._manager, Qt.ConnectionType.DirectConnection
        manager.changed.connect(self._on_changed, direct)
        manager.links_changed.connect(self._mark_status, direct)
        manager.group_refused.connect(self._on_group_refused, direct)
        manager.group_started.connect(self._on_group_started, direct)
        manager.latch.subscribe(self._mark_status)
        self._application.undo.changed.connect(self._mark_status, direct)
        self._application.status_changed.connect(self._mark_status, direct)
        if manager.exemptions is not None:
            self._undo.append(manager.exemptions.subscribe(self._mark_status))
        self.start()

    def close(self) -> None:
        """Tell nothing more; harmless the second time."""
        self._to = None
        for undo in self._undo:
            undo()
        self._undo.clear()
        self.request_end()
        self.join()

    @override
    def request_end(self) -> None:
        super().request_end()
        with self._changed:
            self._changed.notify_all()

    def _join_devices(self) -> None:
        direct = Qt.ConnectionType.DirectConnection
        for index, device in self._manager.devices.items():
            if self._joined.get(index) is not device:
                self._joined[index] = device
                device.state_changed.connect(self._on_state_changed, direct)
                device.movement_begun.connect(self._on_begun, direct)
                device.movement_ended.connect(self._on_ended, direct)
                device.movement_refused.connect(self._on_refused, direct)

    # What there is

    def state_of(self, name: str) -> StampedState | None:
        """Return the newest state of an axis."""
        with self._changed:
            found = self._states.get(name)
        return None if found is None else _aged(found)

    def picture(self) -> MicoPicture:
        """Return everything as it is now."""
        with self._changed:
            self._look_at_states()
            states = tuple(_aged(each) for each in self._states.values())
            self._tell_status(self._read_status())
            return MicoPicture(self._status, states)

    def status(self) -> MicoStatus:
        """Return how MiCo is as a whole, now."""
        with self._changed:
            self._tell_status(self._read_status())
            return self._status

    def note(self, name: str) -> StampedState | None:
        """Look at an axis now, which somebody has just changed, and return its state."""
        state = self._manager.state(name)
        with self._changed:
            self._on_state_changed(state)
            return self._states.get(name)

    # What happens, in the threads of the devices

    def _on_state_changed(self, state: PositionerState) -> None:
        with self._changed:
            before = self._states.get(state.name)
            same = before is not None and _told_alike(before.state, state)
            if same and before is not None and before.state.position == state.position:
                return
            self._stamp += 1
            stamped = self._states[state.name] = StampedState(self._stamp, state, 0.0)
            if same:
                self._moved.add(state.name)
                self._changed.notify_all()
            else:
                self._publish(_aged(stamped))

    def _on_begun(self, event: MovementBegun) -> None:
        self._publish(
            Begun(
                event.name,
                event.motion,
                event.from_position,
                event.target,
                event.unit,
                event.time_s,
                event.source,
            )
        )

    def _on_ended(self, event: MovementEnded) -> None:
        error = to_plain(event.error) if isinstance(event.error, CosmicError) else None
        self._publish(Ended(event.name, event.position, error))

    def _on_refused(self, verdict: MoveVerdict) -> None:
        self._publish(Refused(verdict, together=False))

    def _on_group_refused(self, verdict: MoveVerdict) -> None:
        self._publish(Refused(verdict, together=True))

    def _on_group_started(self, started: GroupStarted) -> None:
        self._publish(StartedTogether(started.names, started.skew_ms))

    def _on_changed(self) -> None:
        self._join_devices()
        self._mark_status()

    def _mark_status(self, *_what: object) -> None:
        with self._changed:
            self._status_due = True
            self._changed.notify_all()

    def _publish(self, event: object) -> None:
        to = self._to
        if to is not None:
            with self._changed:  # so that events go out in the order of their stamps
                to.publish(EVENTS, event)

    # Its own thread

    @override
    def run_body(self) -> None:
        while not self.end_requested:
            self._wait()
            with self._changed:
                if not (self._moved or self._status_due):
                    self._look_at_states()
                self._status_due = False
                status = self._read_status()
                self._tell_status(status)
                self._tell_positions()
            self._pause()

    def _wait(self) -> None:
        with self._changed:
            if not (self._moved or self._status_due or self.end_requested):
                self._changed.wait(LOOK_S)

    def _pause(self) -> None:
        """Let positions wait; what else changes does not."""
        until_s = WALL.now_s() + PERIOD_S
        with self._changed:
            while not (self._status_due or self.end_requested):
                left_s = until_s - WALL.now_s()
                if left_s <= 0.0:
                    return
                self._changed.wait(left_s)

    def _look_at_states(self) -> None:
        for state in self._manager.states().values():
            self._on_state_changed(state)

    def _tell_positions(self) -> None:
        self._moved.clear()
        now_s, places = WALL.now_s(), {}
        for name, state in self._manager.states().items():
            told = self._states.get(name)
            if told is None or told.state.position is None:
                continue
            fresh = max(state.read_wall_s, told.state.read_wall_s)
            places[name] = (told.stamp, told.state.position, max(0.0, now_s - fresh))
        to = self._to
        if places and to is not None:
            to.publish(POSITIONS, AxisPositions(places))

    def _tell_status(self, status: MicoStatus) -> None:
        if replace(status, stamp=self._status.stamp) != self._status:
            self._stamp += 1
            self._status = replace(status, stamp=self._stamp)
            self._publish(self._status)

    def _read_status(self) -> MicoStatus:
        application, manager = self._application, self._manager
        exempt = manager.exemptions
        return MicoStatus(
            stamp=0,
            ready=manager.ready,
            failure=application.failure,
            names=tuple(manager.names()),
            missing=manager.missing,
            stop=manager.latch.state,
            links=manager.links.links,
            taken_out=() if exempt is None else tuple(sorted(exempt.taken_out)),
            contacts=() if exempt is None else tuple(sorted(exempt.allowed_contacts)),
            undo=application.undo.entries,
            poses=tuple(application.trajectories.poses.poses.values()),
        )


def _told_alike(one: PositionerState, other: PositionerState) -> bool:
    """Return whether they differ in nothing but the position and when it was read."""
    return replace(one, position=other.position, read_wall_s=other.read_wall_s) == other and (
        one.position is None
    ) == (other.position is None)


def _aged(stamped: StampedState) -> StampedState:
    age_s = max(0.0, WALL.now_s() - stamped.state.read_wall_s)
    return replace(stamped, age_s=age_s)
