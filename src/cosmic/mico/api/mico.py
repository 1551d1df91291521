"""The one interface of MiCo: ``rig.mico``, its windows, plans and stations use nothing else."""

from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from math import isfinite
from numbers import Real
from threading import Lock
from typing import Final, Literal, Protocol, overload, runtime_checkable

from PySide6.QtCore import Qt
from typing_extensions import override

from cosmic.frame.application import CosmicApplicationBase
from cosmic.frame.arguments import checked_class, reason_of
from cosmic.frame.clock import Clock
from cosmic.frame.declaration import Companion, Declared, command, part, state, stream
from cosmic.frame.errors import (
    ConfigError,
    CosmicError,
    MoveCancelled,
    MoveRefused,
    NotAvailable,
    UnknownAxisError,
)
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.caller import current_call, one_line, source_of
from cosmic.frame.network.lease import StationLease
from cosmic.frame.network.transport import Rule
from cosmic.frame.operation import Operation, Progress, Task, wait_or_cancel
from cosmic.frame.renamed import Renamed, renamed_parameters
from cosmic.frame.threads import forbid_waiting_here, may_wait_here
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.frame.weakly import weakly
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.application_base import PATH_BUDGET_S, MicoApplicationBase
from cosmic.mico.api.axis import Axis
from cosmic.mico.api.axis_group import AxisGroup
from cosmic.mico.api.axis_numbers import Number, as_number
from cosmic.mico.api.collision import Collision, LiveClearance
from cosmic.mico.api.companion import MicoCompanion
from cosmic.mico.api.group_movement import GroupMovement
from cosmic.mico.api.initialisation import Confirm
from cosmic.mico.api.news import (
    AxisBegun,
    AxisEnded,
    AxisPositions,
    MovementNews,
    SentMotion,
    follow_movements,
    follow_positions,
)
from cosmic.mico.api.planned_path import PlannedPath
from cosmic.mico.api.poses import Poses
from cosmic.mico.api.remote_axis import foreseen
from cosmic.mico.api.tools import Tools
from cosmic.mico.api.trajectories import Trajectories
from cosmic.mico.api.trajectory_recording import Recordings
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.checker import NO_MODEL_TEXT
from cosmic.mico.core.collision.collision_manager import CollisionManager
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.motion.device import Device
from cosmic.mico.core.motion.device_commander import DeviceCommander
from cosmic.mico.core.motion.links import Link
from cosmic.mico.core.motion.orders import Motion, MoveBy, MoveTo
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.core.motion.stop_latch import StopState
from cosmic.mico.core.motion.undo import UndoEntry, undo_text
from cosmic.mico.core.poses import Pose
from cosmic.mico.core.sequence.report import SequenceReport
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.core.teleoperation.teleoperation import Teleoperation
from cosmic.mico.core.trajectory.binding import AxisFacts, PlatformFacts
from cosmic.mico.core.trajectory.recorder import Recorded
from cosmic.mico.hw.interface import PositionerKind

SCENE_LIMIT_S: Final = 10.0
"""How long the shapes of all bodies may take on the way."""
LONGEST_SEARCH_S: Final = 60.0
"""For how long a path may be looked for on a line; other long operations wait for it."""
NOTHING_KNOWN: Final = MicoSettings(positioner=())
"""Stands for settings while a station was never reached."""
NOT_YET: Final = "No state of MiCo at the station has arrived yet"


@checked_class
class Mico(Declared):
    """The axes of the platform by name, and what they do together; any thread.

    Parameters
    ----------
    application : MicoApplication
        Where the hardware is.
    source : str
        Who commands through this object, for the log: "script", "window", "key".
    """

    _live_clearance: LiveClearance | None = None

    def __init__(self, application: MicoApplication, source: str = "script") -> None:
        self._application: MicoApplicationBase = application
        self._home: MicoApplication = application
        self._manager = application.manager
        self._source = source
        self._axes: dict[str, Axis] = {}
        self._commanders: dict[int, DeviceCommander] = {}
        self._joined: dict[int, Device] = {}
        self._joining = Lock()
        self._poses = Poses(application.trajectories, source)
        self._trajectories = Trajectories(self, application.trajectories, application.players)
        direct = Qt.ConnectionType.DirectConnection
        manager, changed = application.manager, weakly(self.note_change)
        manager.links_changed.connect(changed, direct)
        manager.changed.connect(changed, direct)
        manager.changed.connect(weakly(self._connect), direct)
        manager.device_lost.connect(changed, direct)
        application.undo.changed.connect(changed, direct)
        application.status_changed.connect(changed, direct)
        application.initialisation_changed.connect(changed, direct)
        manager.latch.subscribe(lambda _state: changed())
        if manager.exemptions is not None:
            manager.exemptions.subscribe(changed)
        self._connect()

    @override
    def take_lease_of(self, lease: StationLease) -> None:
        if not isinstance(lease, StationLease):
            raise TypeError(f"lease must be that of a station, not {str(lease)[:60]}")
        if self.remote:
            raise NotAvailable("the lease of a station is decided at the station")
        self._manager.lease.join(lease)

    # Where the axes are at another station

    @override
    def set_up_proxy(self, key: str, policy: FailurePolicy) -> None:
        if not isinstance(policy, FailurePolicy):
            raise TypeError(f"policy must be a FailurePolicy, not {str(policy)[:60]}")
        self._source = "script"
        self._axes = {}
        self._policy = policy
        self._published_away = ""

    @override
    def made_companion(self) -> Companion:
        """Follow positions, and stop there what was begun here when something here fails."""
        return MicoCompanion(self, self._policy)

    def belong_to(self, application: MicoApplicationBase, source: str = "") -> None:
        """Work for an application at this end; for whoever makes a proxy."""
        if not isinstance(application, MicoApplicationBase):
            raise TypeError(f"application must be a MiCo, not {str(application)[:60]}")
        if not self.remote:
            raise NotAvailable("this MiCo belongs to the application that it was made with")
        self._application = application
        self._source = source or self._source
        self.trajectories.belong_to(self)
        self.poses.belong_to(self._source)

    @override
    def note_change(self) -> None:
        super().note_change()
        if self.remote and self.away != self._published_away:
            self._published_away = self.away
            for axis in self.axes.values():
                axis.note_change()

    # Each axis

    def _connect(self) -> None:
        """Join the commanders to the devices there are now."""
        token = self._manager.lease.local_token
        with self._joining:
            for index, device in self._manager.devices.items():
                commander = self._commanders.get(index)
                if commander is None:
                    commander = self._commanders[index] = DeviceCommander(token, self._source)
                if self._joined.get(index) is not device:
                    self._joined[index] = device
                    self._manager.connect_device_commander(index, commander)

    @property
    def application(self) -> MicoApplicationBase:
        """The application behind it."""
        return self._application

    @property
    @override
    def clock(self) -> Clock:
        """The platform's."""
        return self._manager.clock

    @override
    def __repr__(self) -> str:
        return f"<Mico: {', '.join(self.names)}>"

    @property
    @part
    def axes(self) -> Mapping[str, Axis]:
        """Each axis by its name, in the order of the configuration."""
        return {name: self[name] for name in self._manager.names()}

    def __getitem__(self, name: str) -> Axis:
        """Return an axis; raises `UnknownAxisError`, a `CosmicError` and `KeyError`."""
        if self.remote:
            return self._remote_axis(name)
        address = self._manager.address(name)
        axis = self._axes.get(name)
        if axis is None:
            if address.device not in self._commanders:
                self._connect()  # it was told of just now, and `changed` is on its way
            axis = Axis(name, self._manager, self._commanders[address.device])
            self._axes[name] = axis
        return axis

    def _remote_axis(self, name: str) -> Axis:
        axis = self.axes.get(name) if isinstance(name, str) else None
        if axis is None:
            raise UnknownAxisError(name, self.names)
        if name not in self._axes:
            axis.commander.source = self._source
            if axis.far is not None:
                axis.far.platform = lambda: self.settings
                axis.far.foresee = self._foreseen
            self._axes[name] = axis
        return axis

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[Axis]:
        return (self[name] for name in self.names)

    def __len__(self) -> int:
        return len(self.names)

    # What is known

    @property
    def names(self) -> list[str]:
        """Names of all axes, in the order of the configuration."""
        return list(self.axes) if self.remote else self._manager.names()

    @property
    @state(fixed=True, unknown=NOTHING_KNOWN)
    def settings(self) -> MicoSettings:
        """What the platform file says."""
        return self._manager.settings

    @property
    @state(fixed=True)
    def platform(self) -> str:
        """Name of the platform."""
        return self._home.trajectories.platform

    @property
    @state(fixed=True)
    def controller(self) -> str:
        """Name of the library that drives the axes."""
        return self._manager.controller.name

    @property
    @state(fixed=True)
    def simulated(self) -> bool:
        """True when no hardware moves."""
        return self._manager.controller.simulated

    @property
    @state(fixed=True)
    def checks_collisions(self) -> bool:
        """Whether there is a collision model."""
        return self._home.collision is not None

    @property
    def source(self) -> str:
        """Who commands through this object, for the log."""
        return self._source

    def states(self) -> dict[str, PositionerState]:
        """Return the state of every axis by name, in gate coordinates."""
        if not self.remote:
            return self._manager.states()  # all at one moment, also while devices are looked for
        return {name: axis.details for name, axis in self.axes.items()}

    def positions(self) -> dict[str, float] | None:
        """Return where every axis is, in gate coordinates; None while one is not known."""
        found: dict[str, float] = {}
        for name, each in self.states().items():
            if each.position is None or each.confidence is Confidence.UNKNOWN or not each.present:
                return None
            found[name] = each.position
        return found or None

    @property
    def missing(self) -> tuple[str, ...]:
        """What was configured and is not there, a line each."""
        return (self.away, *self._missing) if self.away else self._missing

    @property
    @state
    def _missing(self) -> tuple[str, ...]:
        return self._manager.missing

    @property
    def ready(self) -> bool:
        """True while axes can be moved."""
        return not self.away and self._ready

    @property
    @state
    def _ready(self) -> bool:
        return self._manager.ready

    @property
    def failure(self) -> str:
        """Why MiCo cannot work; empty when it can."""
        return self.away or self._failure

    @property
    @state(unknown=NOT_YET)
    def _failure(self) -> str:
        return self._home.failure

    @property
    @state(unknown=StopState(None, 0))
    def stop_state(self) -> StopState:
        """Whether motion is stopped, and why."""
        return self._manager.latch.state

    def follow_stop(self, listener: Callable[[StopState], object]) -> Callable[[], None]:
        """Call `listener(state)` when motion is stopped or allowed again; returns what ends it.

        In the thread that did it, or that hears of it from the station; it must return at once.
        """
        if not self.remote:
            return self._manager.latch.subscribe(listener)
        before = self.stop_state

        def look() -> None:
            nonlocal before
            now = self.stop_state
            changed, before = now != before, now
            if changed:
                listener(now)

        return self.on_change(look)

    @property
    @state
    def links(self) -> tuple[Link, ...]:
        """The links in force, each with `first`, `second` and `ratio`."""
        return self._manager.links.links

    @property
    @state
    def undo_entries(self) -> tuple[UndoEntry, ...]:
        """What can be taken back, the newest first; ten of each assembly."""
        return self._home.undo.entries

    @property
    @state(unknown=SequenceReport(()))
    def initialisation(self) -> SequenceReport:
        """How far the initialisation sequence is, or was."""
        return self._home.initialisation

    @property
    def taken_out(self) -> tuple[str, ...]:
        """Axes taken out of collision detection."""
        if not self.checks_collisions:
            return ()
        return tuple(name for name, axis in self.axes.items() if not axis.collision_detection)

    @property
    @state
    def allowed_contacts(self) -> tuple[str, ...]:
        """Contacts of the scene that are allowed now."""
        model = self._manager.exemptions
        return () if model is None else tuple(sorted(model.allowed_contacts))

    @stream(Rule.LATEST, topic="positions")
    def follow_positions(self, receiver: Callable[[AxisPositions], object]) -> Callable[[], None]:
        """Call `receiver` with where the axes are while one moves, at most 30 times a second."""
        return follow_positions(self._home.manager, receiver)

    @stream(Rule.ALL, topic="movements")
    def follow_movements(self, receiver: Callable[[MovementNews], object]) -> Callable[[], None]:
        """Call `receiver` with each movement that begins, ends or is refused."""
        return follow_movements(self._home.manager, receiver)

    # Moving several axes

    @overload
    def move(
        self,
        targets: Mapping[str, Number],
        *,
        wait: Literal[True] = True,
        consent: bool = False,
        match_arrival: bool = False,
    ) -> dict[str, float | None]: ...

    @overload
    def move(
        self,
        targets: Mapping[str, Number],
        *,
        wait: Literal[False],
        consent: bool = False,
        match_arrival: bool = False,
    ) -> GroupMovement: ...

    def move(
        self,
        targets: Mapping[str, Number],
        *,
        wait: bool = True,
        consent: bool = False,
        match_arrival: bool = False,
    ) -> dict[str, float | None] | GroupMovement:
        """Move several axes to positions together; returns the positions reached.

        They are decided together and started back to back; each goes at its own speed, so the
        path is not a straight line. The failure of one stops the others. Axes that are linked to
        them, and not named, move with them.

        Parameters
        ----------
        targets : mapping
            Positions by axis name, in the unit of each axis, from the user's zero.
        wait : bool
            False returns the `GroupMovement` at once.
        match_arrival : bool
            Slow the axes down to the one that takes longest, so that all arrive together; their
            own speeds come back afterwards.

        Raises
        ------
        MoveRefused
            The gate refused; nothing moved.
        UnknownAxisError
            One axis does not exist; nothing moved.
        DeviceError, MoveCancelled
            One of them failed or was stopped.
        """
        motions = self._targets(targets)
        return self._together(motions, wait=wait, consent=consent, match_arrival=match_arrival)

    @overload
    def move_by(
        self,
        distances: Mapping[str, Number],
        *,
        wait: Literal[True] = True,
        consent: bool = False,
        match_arrival: bool = False,
    ) -> dict[str, float | None]: ...

    @overload
    def move_by(
        self,
        distances: Mapping[str, Number],
        *,
        wait: Literal[False],
        consent: bool = False,
        match_arrival: bool = False,
    ) -> GroupMovement: ...

    def move_by(
        self,
        distances: Mapping[str, Number],
        *,
        wait: bool = True,
        consent: bool = False,
        match_arrival: bool = False,
    ) -> dict[str, float | None] | GroupMovement:
        """Move several axes by distances together; otherwise as `move`."""
        motions: dict[str, SentMotion] = {}
        for name, value in distances.items():
            unit = self[name].unit
            motions[name] = MoveBy(as_number(value, unit, name), unit)
        return self._together(motions, wait=wait, consent=consent, match_arrival=match_arrival)

    def _targets(self, targets: Mapping[str, Number]) -> dict[str, SentMotion]:
        motions: dict[str, SentMotion] = {}
        for name, value in targets.items():
            motions[name] = MoveTo(self._in_gate(name, value), self[name].unit)
        return motions

    def _together(
        self, motions: Mapping[str, SentMotion], *, wait: bool, consent: bool, match_arrival: bool
    ) -> dict[str, float | None] | GroupMovement:
        group = self.begin_together(
            dict(motions), consent=consent, match_arrival=match_arrival, source=self._source
        )
        return wait_or_cancel(group) if wait else group

    @command(moves=True)
    def begin_together(
        self,
        motions: dict[str, SentMotion],
        *,
        consent: bool = False,
        linked: bool = True,
        match_arrival: bool = False,
        source: str = "script",
    ) -> GroupMovement:
        """Decide motions in gate coordinates together and start them, or none of them.

        Parameters
        ----------
        linked : bool
            Axes linked to those named move with them; False moves those named only.

        Raises
        ------
        MoveRefused, UnknownAxisError
            As `move`.
        """
        if _halted_since(motions):
            stopped = GroupMovement.followed(f"the movement of {', '.join(motions)}")
            stopped.fail(MoveCancelled(f"{', '.join(motions)}: halted before they started"))
            return stopped
        orders = self._manager.groups.order_together(
            motions,
            source=source_of(source),
            consent=consent,
            linked=linked,
            match_arrival=match_arrival,
        )
        group = GroupMovement.of(orders)
        if _halted_since(orders):  # meanwhile, or an axis that is linked to one of them
            group.cancel()
        return group

    def group(self, *names: str, name: str = "") -> AxisGroup:
        """Return axes that a bluesky plan moves as one; raises `UnknownAxisError`."""
        axes = {each: self[each] for each in names}
        return AxisGroup(axes, lambda to: self.move(to, wait=False), self.check, name)

    def check(self, targets: Mapping[str, Number]) -> MoveVerdict:
        """Return the gate's answer to absolute targets together, without moving.

        Raises
        ------
        UnknownAxisError
            One axis does not exist.
        """
        try:
            motions = self._targets(targets)
        except MoveRefused as exc:
            return exc.verdict
        return self.verdict_on(motions)

    judge = Renamed("verdict_on")

    def verdict_on(
        self, motions: Mapping[str, SentMotion], *, consent: bool = False
    ) -> MoveVerdict:
        """Return the gate's answer to motions in gate coordinates, without moving.

        Where the axes are at another station and this thread must not wait (a window), it is what
        can be said without collisions; the gate there decides each movement in any case.
        """
        if self.remote and not may_wait_here():
            return self._foreseen(motions, consent)
        try:
            return self.check_motions(dict(motions), consent=consent)
        except UnknownAxisError:
            raise
        except MoveRefused as exc:
            return exc.verdict
        except CosmicError as exc:
            return refuse(Reason.NO_ANSWER, f"the station does not answer: {exc}")

    @command
    def check_motions(
        self, motions: dict[str, SentMotion], *, consent: bool = False
    ) -> MoveVerdict:
        """Return the gate's answer to motions in gate coordinates, without moving."""
        return self._manager.groups.check(motions, consent=consent)

    def _foreseen(self, motions: Mapping[str, Motion], consent: bool) -> MoveVerdict:
        reason = self.stop_state.reason
        return foreseen(motions, self.states(), self.settings, consent=consent, stop_reason=reason)

    def _in_gate(self, name: str, value: Number) -> float:
        axis = self[name]
        return as_number(value, axis.unit, name) + axis.details.zero

    # Stopping

    @command(at_once=True)
    def stop(self, reason: str = "stop from a script") -> None:
        """Stop every axis now; nothing moves again before `reset_stop`. Anybody may.

        Raises
        ------
        StationAway, StationTimeout
            The axes are at a station that cannot be reached. What was begun here stops by itself.
        """
        call = current_call()
        said = (
            reason
            if call is None
            else f"{one_line(reason_of(reason)) or 'stopped'} (from {call.caller.name})"
        )
        self._manager.stop(said)

    @command(moves=True, aside=True)
    def reset_stop(self) -> None:
        """Allow motion again; what was stopped does not go on by itself."""
        self._manager.reset_stop()

    # What takes long

    def initialise(
        self,
        progress: Callable[[Progress], None] | None = None,
        *,
        wait: bool = True,
        skip_known: bool = False,
        confirm: Confirm | None = None,
        may_hold: bool = False,
    ) -> Task:
        """Carry out the initialisation sequence of the platform file, step by step.

        Starting it is the consent to move axes whose position is unknown.

        Parameters
        ----------
        progress : callable
            Called with each `Progress`.
        wait : bool
            False returns at once; the task has `progress`, `cancel` and `wait`.
        skip_known : bool
            Leave out of the steps that find positions those axes whose position is known.
        confirm : callable
            Called with the text of a step that asks; True goes on. Without one the answer is no.
        may_hold : bool
            Go on although something may be held or touched: a gripper that was closed, a force.

        Raises
        ------
        NotAvailable
            Another long operation is under way, or something may be held, without `may_hold`.
        CosmicError
            A step failed, was refused, stopped or answered with no; the text says which and what
            to do. What moved with it was stopped, and no further step is made.
        """
        task = self._application.initialise_platform(
            skip_known=skip_known, confirm=confirm, may_hold=may_hold
        )
        return self._follow(task, progress, wait=wait)

    def rescan(
        self, progress: Callable[[Progress], None] | None = None, *, wait: bool = True
    ) -> Task:
        """Look again for the hardware; the arguments are those of `initialise`."""
        return self._follow(self._application.rescan(), progress, wait=wait)

    @command(moves=True)
    def begin_initialisation(
        self, *, skip_known: bool = False, may_hold: bool = False, asks: bool = False
    ) -> Task:
        """Begin the initialisation sequence where the axes are; see `initialise`.

        Parameters
        ----------
        asks : bool
            Somebody reads `initialisation.question` and gives the answer with `answer`.
        """
        return self._home.begin_initialisation(skip_known=skip_known, may_hold=may_hold, asks=asks)

    @command(moves=True)
    def answer(self, agreed: bool) -> None:
        """Answer the question that the initialisation sequence asks."""
        self._home.answer(agreed)

    @command(moves=True)
    def begin_rescan(self) -> Task:
        """Begin to look again for the hardware."""
        return self._home.rescan()

    @staticmethod
    def _follow(task: Task, progress: Callable[[Progress], None] | None, *, wait: bool) -> Task:
        if progress is not None:
            task.subscribe(progress)
        if wait:
            wait_or_cancel(task)
        return task

    # Detours, in mode ECM

    find_way = Renamed("plan_path")

    def plan_path(
        self, targets: Mapping[str, Number], *, budget_s: float = PATH_BUDGET_S
    ) -> PlannedPath:
        """Plan a path to absolute targets around obstacles, without moving.

        Parameters
        ----------
        targets : mapping
            Positions by axis name, in the unit of each axis, from the user's zero.
        budget_s : float
            How long to look, in wall time.

        Raises
        ------
        NotAvailable
            There is no collision model.
        UnknownAxisError
            One axis does not exist.
        MoveRefused
            No path was found; the verdict says what blocks.
        WrongThreadError
            Called in the GUI thread.
        """
        forbid_waiting_here("planning a path")
        goal = {name: self._in_gate(name, value) for name, value in targets.items()}
        return self._application.plan_path(goal, budget_s)

    @command
    def begin_search(self, targets: dict[str, float], budget_s: float) -> Operation[PlannedPath]:
        """Begin to look for a path to targets in gate coordinates, for at most a minute."""
        if not 0.0 < budget_s <= LONGEST_SEARCH_S:
            raise NotAvailable(f"a path is looked for during at most {LONGEST_SEARCH_S:g} s")
        return self._home.begin_search(targets, budget_s)

    @command(moves=True)
    def begin_detour(self, path: PlannedPath, *, source: str = "script") -> Task:
        """Begin to follow a planned path, where the axes are; see `follow`."""
        return self._home.follow_path(path, source_of(source))

    @renamed_parameters(way="path")
    def follow(
        self,
        path: PlannedPath,
        progress: Callable[[Progress], None] | None = None,
        *,
        wait: bool = True,
    ) -> Task:
        """Follow a planned path, part by part; the arguments are those of `initialise`.

        Raises
        ------
        NotAvailable
            Another long operation is under way.
        MoveRefused
            The gate refused a part: something has moved since.
        """
        return self._follow(self._application.follow_path(path, self._source), progress, wait=wait)

    def move_around(
        self, targets: Mapping[str, Number], *, budget_s: float = PATH_BUDGET_S, wait: bool = True
    ) -> Task:
        """Plan a path to absolute targets and follow it; raises as `plan_path` and `follow`."""
        return self.follow(self.plan_path(targets, budget_s=budget_s), wait=wait)

    # Teleoperation

    @property
    def teleoperation(self) -> Teleoperation:
        """Steering by a gamepad, keys or a haptic device; one for the whole program."""
        return self._application.teleoperation_of(self)

    # Trajectories and named poses

    @property
    @part
    def trajectories(self) -> Trajectories:
        """Records, reads, rehearses and runs trajectories."""
        return self._trajectories

    @property
    @part
    def poses(self) -> Poses:
        """Named poses: teach, go, remove."""
        return self._poses

    def pose(self, name: str) -> Pose:
        """Return a named pose; raises `NotAvailable`."""
        return self.poses[name]

    def facts(self) -> PlatformFacts:
        """Return what a trajectory is checked against, as it is known here."""
        axes = {name: AxisFacts.of(each) for name, each in self.states().items()}
        poses = {each.name: each for each in self.poses}
        return PlatformFacts(self.platform, axes, self.settings.defaults, poses)

    @property
    def recordings(self) -> Recordings:
        """What this process records of movements."""
        return self._application.recordings

    def follow_recorded(self, receiver: Callable[[Recorded], object]) -> Callable[[], None]:
        """Call `receiver` with every movement as a recorder takes it; returns what ends it."""

        def on_movement(news: MovementNews) -> None:
            if isinstance(news, AxisBegun | AxisEnded):
                receiver(news.recorded())

        return self.follow_movements(on_movement)

    # Links

    def link(self, first: str, second: str, ratio: float = 1.0) -> Link:
        """Link two axes: a movement of one to or by a position moves the other as well.

        They are decided together, started together and arrive together. Neither can be moved
        otherwise while they are linked: steps, jogs and reference runs are refused.

        Parameters
        ----------
        ratio : float
            How far `second` goes when `first` goes 1; below 0 the other way.

        Raises
        ------
        UnknownAxisError
            One of them does not exist.
        NotAvailable
            They are linked already, have no sensor, or are not of one kind, one of them moves, or
            `ratio` is outside 0.001 to 1000, either way.
        """
        self._check_linkable(first, second)
        self.add_link(first, second, float(ratio))
        return Link(first, second, float(ratio))

    @command(moves=True, aside=True)
    def add_link(self, first: str, second: str, ratio: float) -> None:
        """Link two axes; raises as `link`."""
        self._check_linkable(first, second)
        self._manager.links.add(first, second, ratio)

    def unlink(self, axis: str) -> bool:
        """Take away every link of an axis; False when it had none.

        Raises
        ------
        UnknownAxisError
            There is no such axis.
        NotAvailable
            One of the axes linked moves.
        """
        linked = bool(self[axis].linked_to)
        self.remove_links(self[axis].key)
        return linked

    @command(moves=True, aside=True)
    def remove_links(self, axis: str) -> None:
        """Take away every link of an axis; raises as `unlink`."""
        self._check_links_may_change(axis)
        self._manager.links.remove(axis)

    def _check_linkable(self, first: str, second: str) -> None:
        self._check_links_may_change(first, second)
        kinds = {self[name].kind for name in (first, second)}
        if len(kinds) > 1 or PositionerKind.OPEN_LOOP in kinds:
            text = f"{first} and {second} cannot be linked: both must be linear, or both rotary"
            raise NotAvailable(text)

    def _check_links_may_change(self, *names: str) -> None:
        """Raise `NotAvailable` where a link that changes would leave an axis to move alone."""
        linked = {other for name in names for other in self[name].linked_to}
        moving = sorted(name for name in {*names, *linked} if self[name].details.in_motion)
        if moving:
            text = f"{', '.join(moving)} is moving; change the links when it is stationary"
            raise NotAvailable(text)

    # Taking back

    @overload
    def undo(
        self, group: str | None = None, *, wait: Literal[True] = True, confirm: bool = False
    ) -> dict[str, float | None]: ...

    @overload
    def undo(
        self, group: str | None = None, *, wait: Literal[False], confirm: bool = False
    ) -> GroupMovement: ...

    def undo(
        self, group: str | None = None, *, wait: bool = True, confirm: bool = False
    ) -> dict[str, float | None] | GroupMovement:
        """Take the last movement of an assembly back, whoever made it, through the gate.

        It goes at the speed of ``[mico.undo]``.

        Parameters
        ----------
        group : str
            Title of the assembly in the platform file; None takes the one that moved last.
        wait : bool
            False returns the `GroupMovement` at once.
        confirm : bool
            Go back although something was felt since, or may be held.

        Raises
        ------
        NotAvailable
            There is nothing to take back, no such assembly, or it moves; or something was felt
            since or may be held, and `confirm` does not say that this was looked at.
        MoveRefused
            The gate refused the way back; it can be tried again.
        DeviceError, MoveCancelled
            It did not get there; it can be tried again.
        """
        entry = self.undo_entry(group)
        doubts = () if confirm else self.undo_doubts(entry)
        if doubts:
            raise NotAvailable(
                f"going back would move {undo_text(entry, self.states())}, but "
                f"{'; '.join(doubts)}. Look where it goes, then undo with confirm=True"
            )
        movement = self.begin_undo(entry.number)
        if not wait:
            return movement
        reached = wait_or_cancel(movement)
        if not self.remote:  # what ends a movement tells it after whoever waits
            self._home.undo.drop(entry)
        return reached

    @command(moves=True)
    def begin_undo(self, number: int) -> GroupMovement:
        """Begin to take back the movement of that number in the history; raises as `undo`."""
        history = self._home.undo
        entry = next((each for each in history.entries if each.number == number), None)
        if entry is None:
            raise NotAvailable("there is nothing to undo any more: something moved since")
        if history.newest(entry.group).number != number:
            raise NotAvailable(f"{entry.group} has moved since; look again what undo takes back")
        movement = GroupMovement.of(history.order(entry))
        movement.add_callback(lambda ended: history.drop(entry) if ended.success else None)
        return movement

    def undo_entry(self, group: str | None = None) -> UndoEntry:
        """Return what `undo` would take back now; raises `NotAvailable` where there is nothing."""
        if not self.remote:
            return self._home.undo.newest(group)
        for entry in self.undo_entries:
            if group in (None, entry.group):
                return entry
        raise NotAvailable(f"there is nothing to undo{f' of {group}' if group else ''}")

    def undo_doubts(self, entry: UndoEntry) -> tuple[str, ...]:
        """Return what speaks against taking `entry` back: felt since, or so now."""
        since = [each for each in self.undo_entries if each.number >= entry.number]
        felt = [text for each in since for text in each.felt]
        return tuple(dict.fromkeys([*self._application.cautions.reasons(), *felt]))

    # Collisions

    @property
    def collision(self) -> Collision:
        """What is watched for collisions; raises `NotAvailable` without a collision model."""
        if not self.checks_collisions:
            raise NotAvailable(f"{NO_MODEL_TEXT}: name a scene in the platform file")
        scene = self._application.scene
        if scene is None:
            raise NotAvailable("the scene of the station has not arrived yet")
        return Collision(self, scene, None if self.remote else self._model, self._source)

    @property
    def scene_model(self) -> SceneModel:
        """What is watched for collisions; raises `NotAvailable` without a scene."""
        return self.collision.scene

    @property
    def tools(self) -> Tools:
        """The tools of the scene by name, moved in space whatever angle they stand at."""
        return Tools(self, self._source)

    def clearance(self) -> Approach:
        """Return the nearest pair of bodies: `bodies`, `distance_um`, `place_um`.

        Raises
        ------
        NotAvailable
            There is no collision model, or the position of some axis is not known.
        """
        return self.collision.clearance()

    @property
    def live_clearance(self) -> LiveClearance:
        """The distance of the nearest bodies for plans; raises `NotAvailable` without a model."""
        watch = self._application.clearance_watch
        if watch is None:
            raise NotAvailable(f"{NO_MODEL_TEXT}: name a scene in the platform file")
        if self._live_clearance is None:
            self._live_clearance = LiveClearance(watch)
        return self._live_clearance

    @command(reads=True)
    def nearest(self, positions: dict[str, float]) -> Approach | None:
        """Return the nearest pair of bodies with the axes at `positions`, as the gate counts.

        Raises
        ------
        UnknownAxisError
            There is no such axis.
        ConfigError
            A position is no finite number.
        NoAnswerError
            The gate does not answer.
        """
        for name, value in positions.items():
            if name not in self:
                raise UnknownAxisError(name, self.names)
            if not isinstance(value, Real) or not isfinite(value):
                raise ConfigError(f"{name}: a position is a finite number, not {value!r}")
        return self._model.nearest(positions)

    @command(reads=True, timeout_s=SCENE_LIMIT_S)
    def scene(self) -> SceneModel:
        """Return what is watched for collisions, and what it looks like."""
        return self._model.model

    @command(moves=True, aside=True)
    def set_contact(self, name: str, *, allowed: bool, source: str = "script") -> None:
        """Let the bodies of an operation touch, or watch them again."""
        change = self._model.allow_contact if allowed else self._model.forbid_contact
        change(name, source=source_of(source))

    @property
    def _model(self) -> CollisionManager:
        model = self._home.collision
        if model is None:
            raise NotAvailable(f"{NO_MODEL_TEXT}: name a scene in the station's platform file")
        return model


def _halted_since(names: Iterable[str]) -> bool:
    """Return whether the client whose call this is has halted one of the axes since it called."""
    call = current_call()
    return call is not None and any(call.overtaken(("axes", name)) for name in names)


@runtime_checkable
class RemoteMico(Protocol):
    """A MiCo whose axes are at a station."""

    @abstractmethod
    def mico(self, source: str) -> Mico:
        """Return what it offers, for whoever commands by the name of `source`."""


def mico_of(application: CosmicApplicationBase, source: str = "script") -> Mico:
    """Return what an application offers, whether its axes are here or at another station.

    Raises
    ------
    TypeError
        It is no MiCo.
    """
    if isinstance(application, MicoApplication):
        return Mico(application, source)
    if isinstance(application, RemoteMico):
        return application.mico(source)
    raise TypeError(f"{application!r} is not a MiCo")
