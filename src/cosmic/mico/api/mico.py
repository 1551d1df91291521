"""The MiCo part of the scripted API: ``rig.mico``."""

from collections.abc import Callable, Mapping
from typing import Literal, overload

from typing_extensions import override

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import NotAvailable
from cosmic.frame.operation import Progress, Task, wait_or_cancel
from cosmic.frame.threads import forbid_waiting_here
from cosmic.mico.api.application_base import WAY_BUDGET_S, MicoApplicationBase
from cosmic.mico.api.axes_together import AxesTogether
from cosmic.mico.api.collision import Collision
from cosmic.mico.api.entry import Number
from cosmic.mico.api.group import GroupMovement
from cosmic.mico.api.initialisation import Confirm
from cosmic.mico.api.links import check_linkable, check_links_may_change
from cosmic.mico.api.poses import Poses
from cosmic.mico.api.trajectories import Trajectories
from cosmic.mico.api.ways import Way
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.checker import NO_MODEL_TEXT
from cosmic.mico.core.motion.links import Link
from cosmic.mico.core.motion.undo import UndoEntry, undo_text
from cosmic.mico.core.teleoperation.teleoperation import Teleoperation


@checked_class
class Mico(AxesTogether):
    """The axes of the platform, by name; any thread.

    Parameters
    ----------
    application : MicoApplicationBase
        Where the hardware is.
    source : str
        Who commands through this object, for the log: "script", "window", "key".
    """

    def __init__(self, application: MicoApplicationBase, source: str = "script") -> None:
        super().__init__(application.manager, source)
        self._application = application

    @property
    def application(self) -> MicoApplicationBase:
        """The application behind it."""
        return self._application

    @override
    def __repr__(self) -> str:
        return f"<Mico: {', '.join(self.names)}>"

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

    @staticmethod
    def _follow(task: Task, progress: Callable[[Progress], None] | None, *, wait: bool) -> Task:
        if progress is not None:
            task.subscribe(progress)
        if wait:
            wait_or_cancel(task)
        return task

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
            They are linked already, have no sensor, or are not of one kind, or one of them moves.
        """
        check_linkable(self._manager, first, second)
        return self._manager.links.add(first, second, float(ratio))

    def unlink(self, axis: str) -> bool:
        """Take away every link of an axis; False when it had none.

        Raises
        ------
        UnknownAxisError
            There is no such axis.
        NotAvailable
            One of the axes linked moves.
        """
        check_links_may_change(self._manager, {self[axis].name})
        return self._manager.links.remove(self[axis].name)

    # Taking back

    @property
    def undo_entries(self) -> tuple[UndoEntry, ...]:
        """What can be taken back, the newest first; ten of each assembly."""
        return self._application.undo.entries

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
        history = self._application.undo
        entry = history.newest(group)
        doubts = () if confirm else self.undo_doubts(entry)
        if doubts:
            raise NotAvailable(
                f"going back would move {undo_text(entry, self._manager.states())}, but "
                f"{'; '.join(doubts)}. Look where it goes, then undo with confirm=True"
            )
        movement = GroupMovement.of(history.order(entry))

        def forget(ended: GroupMovement) -> None:
            if ended.success:
                history.drop(entry)

        movement.add_callback(forget)
        if not wait:
            return movement
        reached = wait_or_cancel(movement)
        history.drop(entry)
        return reached

    def undo_doubts(self, entry: UndoEntry) -> tuple[str, ...]:
        """Return what speaks against taking `entry` back: felt since, or so now."""
        since = [each for each in self.undo_entries if each.number >= entry.number]
        told = [text for each in since for text in each.felt]
        return tuple(dict.fromkeys([*self._application.cautions.reasons(), *told]))

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
