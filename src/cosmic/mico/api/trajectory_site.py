"""What trajectories need where the axes are: players, poses, and rehearsals."""

import logging
from collections.abc import Callable, Mapping
from pathlib import Path
from threading import Lock
from typing import Protocol

from cosmic.frame.config import user_file
from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.operation import Operation, Task
from cosmic.frame.task_application import Job
from cosmic.mico.api.planned_path import PlannedPath
from cosmic.mico.core.collision.checker import CollisionChecker, NoCollisionModel
from cosmic.mico.core.collision.collision_manager import CollisionManager
from cosmic.mico.core.motion.checks import Limits
from cosmic.mico.core.motion.manager import DeviceManager
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.core.poses import PoseBook, pose_misfits
from cosmic.mico.core.trajectory.binding import AxisFacts, Bound, PlatformFacts
from cosmic.mico.core.trajectory.clearance import ClearanceSearch
from cosmic.mico.core.trajectory.pure_gate import PureAnswers, pure_copy
from cosmic.mico.core.trajectory.rehearsal import OnProgress, Rehearsal, RehearsalSetup, rehearse

logger = logging.getLogger(__name__)


class Worker(Protocol):
    """What carries out long operations and finds ways: the application."""

    @property
    def manager(self) -> DeviceManager:
        """Where the axes are."""

    @property
    def collision(self) -> CollisionManager | None:
        """The collision model, where there is one."""

    def begin(self, title: str, job: Job) -> Task:
        """See `TaskApplication.begin`."""

    def plan_path(self, targets: Mapping[str, float], budget_s: float) -> PlannedPath:
        """See `MicoApplication.plan_path`."""


class TrajectorySite:
    """The platform as trajectories see it; any thread.

    Parameters
    ----------
    platform : str
        Name of the platform; empty where there is none.
    folder : Path or None
        Folder of the platform file, where the named poses are kept.
    """

    def __init__(
        self,
        worker: Worker,
        policy: FailurePolicy,
        platform: str = "",
        folder: Path | None = None,
    ) -> None:
        self.worker = worker
        self.policy = policy
        self.manager = worker.manager
        self.platform = platform
        self.poses = PoseBook(user_file(self.manager.settings.poses, folder))
        for text in pose_misfits(self.poses.poses, self.manager.settings.kinds):
            logger.warning("%s: %s", self.poses.path, text)
        self._answers: PureAnswers | None = None
        self._rehearsing = Lock()

    def states(self) -> dict[str, PositionerState]:
        """Return the state of every axis."""
        return {name: self.manager.state(name) for name in self.manager.names()}

    def facts(self) -> PlatformFacts:
        """Return what a trajectory is checked against."""
        axes = {name: AxisFacts.of(state) for name, state in self.states().items()}
        return PlatformFacts(
            name=self.platform,
            axes=axes,
            defaults=self.manager.settings.defaults,
            poses=self.poses.poses,
        )

    def positions(self) -> dict[str, float]:
        """Return where the axes with a sensor stand, as far as it is known."""
        return {
            name: state.position
            for name, state in self.states().items()
            if state.position is not None and state.confidence is Confidence.KNOWN
        }

    def step_um(self, axis: str) -> float:
        """Return how far a step of an axis without sensor is taken to go."""
        for each in self.manager.settings.positioner:
            if each.name == axis and each.step_um is not None:
                return each.step_um
        return self.manager.settings.defaults.nominal_step_um

    def rehearse(
        self,
        bound: Bound,
        *,
        speed: float = 1.0,
        timed: bool = True,
        progress: OnProgress | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> Rehearsal:
        """Run a trajectory through the pure gate; one at a time, in the calling thread."""
        states = self.states()
        with self._rehearsing:
            checker, search = self._pure_gate(bound)
            setup = RehearsalSetup(
                states=states,
                facts=self.facts(),
                frequencies_hz={
                    name: float(self.manager.usual_frequency_hz(name)) for name in states
                },
                step_um={name: self.step_um(name) for name in states},
                checker=checker,
                rules=Limits.of(self.manager.settings),
                clearance=search,
                speed=speed,
                timed=timed,
                progress=progress or (lambda _part, _text: None),
                cancelled=cancelled or (lambda: False),
            )
            return rehearse(bound, setup)

    def begin_rehearsal(
        self, bound: Bound, *, speed: float = 1.0, timed: bool = True
    ) -> Operation[Rehearsal]:
        """Begin to rehearse in the application's thread; raises `NotAvailable`. See `rehearse`."""
        found: Operation[Rehearsal] = Operation(f"Rehearsing {bound.trajectory.name}")

        def job(task: Task) -> None:
            try:
                rehearsal = self.rehearse(
                    bound,
                    speed=speed,
                    timed=timed,
                    progress=found.report,
                    cancelled=lambda: task.cancel_requested,
                )
            except CosmicError as exc:
                found.fail(exc)
                task.fail(exc)
            else:
                found.finish(rehearsal)
                task.finish()

        task = self.worker.begin(found.title, job)
        task.when_failed(found.fail)
        found.on_cancel(task.cancel)
        return found

    def _pure_gate(self, bound: Bound) -> tuple[CollisionChecker, ClearanceSearch | None]:
        live = self.worker.collision
        if live is None:
            return NoCollisionModel(), None
        if self._answers is None:
            self._answers = PureAnswers(live.model)
        checker = pure_copy(live, self._answers, self.manager.names())
        axes = bound.trajectory.axes
        return checker, ClearanceSearch(self._answers.sweep, axes, live.ignored_pairs)
