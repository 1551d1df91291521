"""The MiCo part of the scripted API: ``rig.mico``."""

from collections.abc import Callable, Iterator, Mapping
from threading import Lock
from typing import Literal, overload

from PySide6.QtCore import Qt
from typing_extensions import override

from cosmic.frame.errors import MoveRefused, NotAvailable
from cosmic.frame.task import Progress, Task
from cosmic.frame.threads import forbid_waiting_here
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.api.application_base import WAY_BUDGET_S, MicoApplicationBase
from cosmic.mico.api.axis import Axis
from cosmic.mico.api.axis_group import AxisGroup
from cosmic.mico.api.collision import Collision
from cosmic.mico.api.entry import Number, as_number
from cosmic.mico.api.group import GroupMovement, waited_for
from cosmic.mico.api.initialisation import Confirm
from cosmic.mico.api.links import check_linkable
from cosmic.mico.api.poses import Poses
from cosmic.mico.api.trajectories import Trajectories
from cosmic.mico.api.ways import Way
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.checker import NO_MODEL_TEXT
from cosmic.mico.core.device_commander import DeviceCommander
from cosmic.mico.core.links import Link
from cosmic.mico.core.orders import Motion, MoveBy, MoveTo
from cosmic.mico.core.ports import DevicePort
from cosmic.mico.core.teleoperation.teleoperation import Teleoperation
from cosmic.mico.core.undo import UndoEntry


class Mico:
    """The axes of the platform, by name; any thread.

    Parameters
    ----------
    application : MicoApplicationBase
        Where the hardware is.
    source : str
        Who commands through this object, for the log: "script", "window", "key".
    """

    def __init__(self, application: MicoApplicationBase, source: str = "script") -> None:
        self._application = application
        self._manager = application.manager
        self._source = source
        self._commanders: dict[int, DeviceCommander] = {}
        self._axes: dict[str, Axis] = {}
        self._joined: dict[int, DevicePort] = {}
        self._joining = Lock()
        self._connect()
        # Direct, because a script has no event loop that a queued call could arrive in.
        application.manager.changed.connect(self._connect, Qt.ConnectionType.DirectConnection)

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
    def simulated(self) -> bool:
        """True when no hardware moves."""
        return self._manager.controller.simulated

    @property
    def names(self) -> list[str]:
        """Names of all axes, in the order of the configuration."""
        return self._manager.names()

    @property
    def missing(self) -> tuple[str, ...]:
        """What was configured and is not there, a line each."""
        return self._manager.missing

    def __getitem__(self, name: str) -> Axis:
        """Return an axis; raises `UnknownAxisError`, a `CosmicError` and `KeyError`."""
        address = self._manager.address(name)
        axis = self._axes.get(name)
        if axis is None:
            if address.device not in self._commanders:
                self._connect()  # it was told of just now, and `changed` is on its way
            axis = Axis(name, self._manager, self._commanders[address.device])
            self._axes[name] = axis
        return axis

    def __contains__(self, name: object) -> bool:
        return name in self.names

    @override
    def __repr__(self) -> str:
        return f"<Mico: {', '.join(self.names)}>"

    def __iter__(self) -> Iterator[Axis]:
        return (self[name] for name in self.names)

    def __len__(self) -> int:
        return len(self.names)

    def initialise(
        self,
        progress: Callable[[Progress], None] | None = None,
        *,
        wait: bool = True,
        skip_known: bool = False,
        confirm: Confirm | None = None,
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

        Raises
        ------
        NotAvailable
            Another long operation is under way.
        CosmicError
            A step failed, was refused, stopped or answered with no; the text says which and what
            to do. What moved with it was stopped, and no further step is made.
        """
        task = self._application.initialise_platform(skip_known=skip_known, confirm=confirm)
        return self._follow(task, progress, wait=wait)

    def rescan(
        self, progress: Callable[[Progress], None] | None = None, *, wait: bool = True
    ) -> Task:
        """Look again for the hardware; the arguments are those of `initialise`."""
        return self._follow(self._application.rescan(), progress, wait=wait)

    @staticmethod
    def _follow(task: Task, progress: Callable[[Progress], None] | None, *, wait: bool) -> Task:
        if progress is not None:
            task.subscribe(progress)
        if wait:
            try:
                task.wait()
            except KeyboardInterrupt:
                task.cancel()
                raise
        return task

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
        motions: dict[str, Motion] = {}
        for name, value in distances.items():
            unit = self[name].unit
            motions[name] = MoveBy(as_number(value, unit, name), unit)
        return self._together(motions, wait=wait, consent=consent, match_arrival=match_arrival)

    def _targets(self, targets: Mapping[str, Number]) -> dict[str, Motion]:
        motions: dict[str, Motion] = {}
        for name, value in targets.items():
            motions[name] = MoveTo(self._in_gate(name, value), self[name].unit)
        return motions

    def _together(
        self, motions: Mapping[str, Motion], *, wait: bool, consent: bool, match_arrival: bool
    ) -> dict[str, float | None] | GroupMovement:
        orders = self._manager.order_together(
            motions, source=self._source, consent=consent, match_arrival=match_arrival
        )
        group = GroupMovement.of(orders)
        return waited_for(group) if wait else group

    def group(self, *names: str, name: str = "") -> AxisGroup:
        """Return axes that a bluesky plan moves as one; raises `UnknownAxisError`."""
        axes = {each: self[each].movable for each in names}
        return AxisGroup(axes, lambda to: self.move(to, wait=False), self.check, name)

    def check(self, targets: Mapping[str, Number]) -> MoveVerdict:
        """Return the gate's answer to absolute targets together, without moving.

        Raises
        ------
        UnknownAxisError
            One axis does not exist.
        """
        try:
            return self._manager.check(self._targets(targets))
        except MoveRefused as exc:
            return exc.verdict

    # Ways round (ECM)

    def find_way(self, targets: Mapping[str, Number], *, budget_s: float = WAY_BUDGET_S) -> Way:
        """Look for a way to absolute targets round what is in between, without moving.

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
            No way was found; the verdict says what blocks.
        WrongThreadError
            Called in the GUI thread.
        """
        forbid_waiting_here("looking for a way")
        places = {name: self._in_gate(name, value) for name, value in targets.items()}
        return self._application.find_way(places, budget_s)

    def follow(
        self, way: Way, progress: Callable[[Progress], None] | None = None, *, wait: bool = True
    ) -> Task:
        """Go a way that `find_way` found, part by part; the arguments are those of `initialise`.

        Raises
        ------
        NotAvailable
            Another long operation is under way.
        MoveRefused
            The gate refused a part: something has moved since.
        """
        return self._follow(self._application.follow_way(way, self._source), progress, wait=wait)

    def move_around(
        self, targets: Mapping[str, Number], *, budget_s: float = WAY_BUDGET_S, wait: bool = True
    ) -> Task:
        """Find a way to absolute targets and go it; raises as `find_way` and `follow`."""
        return self.follow(self.find_way(targets, budget_s=budget_s), wait=wait)

    def _in_gate(self, name: str, value: Number) -> float:
        axis = self[name]
        return as_number(value, axis.unit, name) + axis.details.zero

    # Teleoperation

    @property
    def teleoperation(self) -> Teleoperation:
        """Steering by a gamepad, keys or a haptic device; one for the whole program."""
        return self._application.teleoperation

    # Trajectories and named poses

    @property
    def trajectories(self) -> Trajectories:
        """Records, reads, rehearses and runs trajectories."""
        return Trajectories(self._application.trajectories, self._source)

    @property
    def poses(self) -> Poses:
        """Named poses: teach, go, remove."""
        return Poses(self._application.trajectories, self._source)

    # Links

    @property
    def links(self) -> tuple[Link, ...]:
        """The links in force, each with `first`, `second` and `ratio`."""
        return self._manager.links.links

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
            They are linked already, have no sensor, or are not of one kind.
        """
        check_linkable(self._manager, first, second)
        return self._manager.links.add(first, second, float(ratio))

    def unlink(self, axis: str) -> bool:
        """Take away every link of an axis; False when it had none.

        Raises
        ------
        UnknownAxisError
            There is no such axis.
        """
        return self._manager.links.remove(self[axis].name)

    # Taking back

    @property
    def undo_entries(self) -> tuple[UndoEntry, ...]:
        """What can be taken back, the newest first; ten of each assembly."""
        return self._application.undo.entries

    @overload
    def undo(
        self, group: str | None = None, *, wait: Literal[True] = True
    ) -> dict[str, float | None]: ...

    @overload
    def undo(self, group: str | None = None, *, wait: Literal[False]) -> GroupMovement: ...

    def undo(
        self, group: str | None = None, *, wait: bool = True
    ) -> dict[str, float | None] | GroupMovement:
        """Take the last movement of an assembly back, whoever made it, through the gate.

        Parameters
        ----------
        group : str
            Title of the assembly in the platform file; None takes the one that moved last.
        wait : bool
            False returns the `GroupMovement` at once.

        Raises
        ------
        NotAvailable
            There is nothing to take back, no such assembly, or it moves.
        MoveRefused
            The gate refused the way back; it can be tried again.
        DeviceError, MoveCancelled
            It did not get there; it can be tried again.
        """
        history = self._application.undo
        entry = history.newest(group)
        movement = GroupMovement.of(history.order(entry))

        def forget(ended: GroupMovement) -> None:
            if ended.success:
                history.drop(entry)

        movement.add_callback(forget)
        if not wait:
            return movement
        reached = waited_for(movement)
        history.drop(entry)
        return reached

    # Collisions

    @property
    def collision(self) -> Collision:
        """What is watched for collisions; raises `NotAvailable` without a collision model."""
        model = self._application.collision
        if model is None or not model.available:
            raise NotAvailable(f"{NO_MODEL_TEXT}: name a scene in the platform file")
        return Collision(self._manager, model, self._source)

    def clearance(self) -> Approach:
        """Return the nearest pair of bodies: `bodies`, `distance_um`, `place_um`.

        Raises
        ------
        NotAvailable
            There is no collision model, or the position of some axis is not known.
        """
        return self.collision.clearance()
