"""Named poses of the scripted API: ``rig.mico.poses``."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from typing_extensions import override

from cosmic.frame.arguments import checked_class
from cosmic.frame.declaration import Declared, command, state
from cosmic.frame.errors import CosmicError, MoveCancelled, NotAvailable, UnknownAxisError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.caller import source_of
from cosmic.frame.operation import Task, wait_or_cancel
from cosmic.frame.renamed import renamed_parameters
from cosmic.mico.api.group_movement import move_together
from cosmic.mico.api.trajectory_site import TrajectorySite
from cosmic.mico.core.motion.orders import Motion, MoveTo
from cosmic.mico.core.motion.positioner import Confidence
from cosmic.mico.core.poses import Pose, pose_misfits, pose_named

PATH_BUDGET_S = 2.0


@checked_class
class Poses(Declared):
    """The named poses of the platform; any thread.

    They are kept, taught and gone to where the axes are. Positions are kept as the gate counts
    them: a user's zero changes nothing.
    """

    _source = "script"

    def __init__(self, site: TrajectorySite, source: str = "script") -> None:
        self._site = site
        self._source = source

    @override
    def set_up_proxy(self, key: str, policy: FailurePolicy) -> None:
        """Nothing is kept on this side but who commands."""

    def belong_to(self, source: str) -> None:
        """Command by this name, for the log; for whoever makes a proxy."""
        self._source = source

    @property
    @state
    def kept(self) -> tuple[Pose, ...]:
        """All of them."""
        return tuple(self._site.poses.poses.values())

    @property
    @state
    def path(self) -> Path | None:
        """The file they are kept in; None: they are kept until the program ends."""
        return self._site.poses.path

    @property
    def names(self) -> list[str]:
        """Names of all poses."""
        return [pose.name for pose in self.kept]

    def __getitem__(self, name: str) -> Pose:
        return pose_named(name, {pose.name: pose for pose in self.kept})

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[Pose]:
        return iter(self.kept)

    def __len__(self) -> int:
        return len(self.names)

    def teach(self, name: str, axes: str | Iterable[str] | None = None) -> Pose:
        """Keep where axes stand now under a name; an older pose of that name is replaced.

        Parameters
        ----------
        axes : str, iterable of str or None
            Axes, or the title of a group of the window; None: all with a sensor. Axes without
            sensor are left out, for nothing can bring them back.

        Raises
        ------
        NotAvailable
            The name is none, or the position of an axis is not known.
        UnknownAxisError
            There is no such axis or group.
        """
        wanted = axes if axes is None or isinstance(axes, str) else list(axes)
        self.learn(name, wanted)
        return self[name]

    @command(aside=True)
    def learn(self, name: str, axes: str | list[str] | None = None) -> None:
        """Keep where axes stand now under a name; arguments and errors as `teach`."""
        facts = self._site.facts().axes
        positions: dict[str, float] = {}
        for axis in self._axes(axes):
            if axis not in facts:
                raise UnknownAxisError(axis, facts)
            if not facts[axis].has_sensor:
                continue
            state = self._site.manager.state(axis)
            if state.position is None or state.confidence is not Confidence.KNOWN:
                raise NotAvailable(f"{axis}: its position is not known; initialise it first")
            positions[axis] = state.position
        self._site.poses.put(Pose(name, positions))
        self.note_change()

    def _axes(self, axes: str | Iterable[str] | None) -> tuple[str, ...]:
        manager = self._site.manager
        if axes is None:
            return tuple(manager.names())
        if not isinstance(axes, str):
            return tuple(axes)
        for group in manager.settings.group:
            if axes == group.title:
                return group.positioners
        return (axes,)

    @command(aside=True)
    def remove(self, name: str) -> None:
        """Forget a pose; raises `NotAvailable` where there is none."""
        self._site.poses.remove(name)
        self.note_change()

    @renamed_parameters(way="detour")
    def go(self, name: str, *, detour: bool = False, wait: bool = True) -> Task:
        """Move to a pose, all its axes together.

        Parameters
        ----------
        detour : bool
            Plan a path around what is in between; else the gate decides the straight one.
        wait : bool
            False returns at once; the task has `progress`, `cancel` and `wait`.

        Raises
        ------
        NotAvailable
            There is no such pose, it names an axis that is not there, or another long operation is
            under way.
        MoveRefused
            The gate refused it; with `detour`, no path was found.
        """
        task = self.begin(name, detour=detour, source=self._source)
        if wait:
            wait_or_cancel(task)
        return task

    @command(moves=True)
    def begin(self, name: str, *, detour: bool = False, source: str = "script") -> Task:
        """Begin to move to a pose, where the axes are; raises `NotAvailable` as `go`."""
        pose, said = self._site.poses[name], source_of(source)
        wrong = pose_misfits({name: pose}, self._site.manager.settings.kinds)
        if wrong:
            raise NotAvailable(f"pose {'; '.join(wrong)}")
        return self._site.worker.begin(
            f"Going to {name}", lambda task: self._go(pose, task, said, detour=detour)
        )

    def _go(self, pose: Pose, task: Task, source: str, *, detour: bool) -> None:
        manager = self._site.manager
        try:
            parts = [pose.positions]
            model = self._site.worker.collision
            if detour and model is not None and model.available:
                task.report(0.0, "planning a path")
                parts = list(self._site.worker.plan_path(pose.positions, PATH_BUDGET_S).waypoints)
            for number, targets in enumerate(parts):
                if task.cancel_requested:
                    raise MoveCancelled(f"the path to {pose.name} was abandoned")
                task.report(number / len(parts), ", ".join(targets))
                motions: dict[str, Motion] = {
                    axis: MoveTo(target, manager.state(axis).unit)
                    for axis, target in targets.items()
                }
                move_together(manager, motions, task, source=source)
            task.finish()
        except CosmicError as exc:
            task.fail(exc)
