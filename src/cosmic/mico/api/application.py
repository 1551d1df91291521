"""MiCo as a CoSMic application (thesis 5.4)."""

import logging
from collections.abc import Mapping
from pathlib import Path

from PySide6.QtCore import QObject
from typing_extensions import override

from cosmic.frame.application import GuiFactory
from cosmic.frame.clock import Clock
from cosmic.frame.errors import CosmicError, DeviceError, NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.operation import Operation, Task
from cosmic.mico.api.application_base import MicoApplicationBase
from cosmic.mico.api.initialisation import Asker, Confirm, InitialisationRun
from cosmic.mico.api.planned_path import PlannedPath, follow, path_from_plan
from cosmic.mico.api.trajectory_player import Players
from cosmic.mico.api.trajectory_site import TrajectorySite
from cosmic.mico.core.collision.checker import NO_MODEL_TEXT, CollisionChecker
from cosmic.mico.core.collision.clearance_watch import ClearanceWatch
from cosmic.mico.core.collision.collision_manager import CollisionManager
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.motion.cautions import Cautions, ClosedGrippers
from cosmic.mico.core.motion.manager import DeviceManager, Mode
from cosmic.mico.core.motion.undo import UndoHistory
from cosmic.mico.core.path_planner import PathPlanner
from cosmic.mico.core.sequence.report import SequenceReport
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import Controller

logger = logging.getLogger(__name__)


class MicoApplication(MicoApplicationBase):
    """Owns the `DeviceManager` and carries out what takes long, in its own thread."""

    manager: DeviceManager
    collision: CollisionManager | None
    undo: UndoHistory

    def __init__(
        self,
        controller: Controller,
        settings: MicoSettings,
        *,
        clock: Clock,
        policy: FailurePolicy,
        checker: CollisionChecker | None = None,
        platform: str = "",
        folder: Path | None = None,
        gui_factory: GuiFactory | None = None,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(policy, folder, gui_factory, parent)
        self.manager = DeviceManager(
            controller, settings, clock=clock, policy=policy, checker=checker
        )
        self.collision = checker if isinstance(checker, CollisionManager) else None
        self.clearance_watch = (
            ClearanceWatch(self.collision.nearest, self.manager.positions, policy)
            if self.collision is not None
            else None
        )
        self.path_planner = (
            PathPlanner(self.manager, self.collision.model) if self.collision is not None else None
        )
        self.cautions = Cautions()
        self._grippers = ClosedGrippers(self.manager.state_changed)
        self.cautions.add(self._grippers.doubt)
        self.undo = UndoHistory(self.manager, self.cautions)
        self.trajectories = TrajectorySite(self, policy, platform, folder)
        self.players = Players()
        self._failure = ""
        self._report = SequenceReport(())
        self._asker = Asker(lambda: True)
        self._forget = policy.on_safe_stop(self.manager.stop)

    @property
    @override
    def failure(self) -> str:
        """Why MiCo cannot work; empty when it can."""
        return self._failure

    @property
    @override
    def scene(self) -> SceneModel | None:
        return None if self.collision is None else self.collision.model

    @override
    def initialize(self) -> None:
        """Open the hardware and start all threads.

        With no controller to be reached it stays open with `failure` set, and can rescan.
        """
        self._start()
        try:
            self.manager.initialize_devices()
            self._failure = ""
        except DeviceError as exc:
            self._failure = str(exc)
            logger.error("MiCo cannot reach its hardware: %s", exc)
        self.status_changed.emit()

    @override
    def initialize_later(self) -> Task:
        """Do what `initialize` does in the application's thread; returns at once.

        For windows, which stand before the hardware is there. `rescanned` tells the end.
        """
        self._start()
        return self.rescan()

    def _start(self) -> None:
        self.start()
        if self.clearance_watch is not None:
            self.clearance_watch.start()

    @override
    def rescan(self) -> Task:
        """Look again for the hardware; returns at once.

        Raises
        ------
        NotAvailable
            Another long operation is under way.
        """
        return self.begin("Looking for devices", self._rescan)

    # Initialisation

    @override
    def initialise_platform(
        self,
        *,
        skip_known: bool = False,
        confirm: Confirm | None = None,
        may_hold: bool = False,
    ) -> Task:
        """Carry the initialisation sequence out; returns at once.

        `initialisation_changed` tells how far it is; the arguments are those of
        `Mico.initialise`.

        Raises
        ------
        NotAvailable
            Another long operation is under way, or something may be held or touched and `may_hold`
            does not say that this was looked at.
        """
        doubts = () if may_hold else self.cautions.reasons()
        if doubts:
            raise NotAvailable(
                f"the initialisation drives every axis: {'; '.join(doubts)}. Put away what is held "
                "and go clear of it, or initialise with may_hold=True"
            )
        run = InitialisationRun(
            self.manager,
            skip_known=skip_known,
            confirm=confirm,
            on_report=self._on_report,
        )
        return self.begin("Initialisation", run.run)

    @property
    @override
    def initialisation(self) -> SequenceReport:
        return self._report

    def _on_report(self, report: SequenceReport) -> None:
        self._report = report
        self.initialisation_changed.emit(report)

    def begin_initialisation(self, *, skip_known: bool, may_hold: bool, asks: bool) -> Task:
        """Begin the sequence for somebody at another station, who `answer`s where it `asks`."""
        asker = Asker(self._nobody_waits)
        task = self.initialise_platform(
            skip_known=skip_known, may_hold=may_hold, confirm=asker.ask if asks else None
        )
        self._asker = asker
        return task

    def _nobody_waits(self) -> bool:
        task = self.running_task
        return task is None or task.cancel_requested or self.manager.latch.state.latched

    def answer(self, agreed: bool) -> None:
        """Answer the question that the sequence asks."""
        self._asker.answer(agreed)

    # Detours, in mode ECM

    @override
    def plan_path(self, targets: Mapping[str, float], budget_s: float) -> PlannedPath:
        """Return a path of some axes to `targets`, in gate coordinates; waits for it.

        Raises
        ------
        NotAvailable
            There is no collision model.
        MoveRefused
            No path was found; the verdict says what blocks.
        """
        if self.path_planner is None:
            raise NotAvailable(f"{NO_MODEL_TEXT}: without one no path can be planned")
        return path_from_plan(self.path_planner.plan_path(targets, budget_s))

    def begin_search(self, targets: Mapping[str, float], budget_s: float) -> Operation[PlannedPath]:
        """Begin to look for a path in the application's thread; raises `NotAvailable`."""
        found: Operation[PlannedPath] = Operation("Looking for a path")

        def search(task: Task) -> None:
            try:
                path = self.plan_path(targets, budget_s)
            except CosmicError as exc:
                found.fail(exc)
                task.fail(exc)
            else:
                found.finish(path)
                task.finish()

        task = self.begin(found.title, search)
        task.when_failed(found.fail)
        found.on_cancel(task.cancel)
        return found

    @override
    def follow_path(self, path: PlannedPath, source: str) -> Task:
        return self.begin("Following a path", lambda task: follow(self.manager, path, task, source))

    def _rescan(self, task: Task) -> None:
        task.report(0.1, "closing and opening the library")
        try:
            self.manager.rescan()
            self._failure = ""
            task.finish()
        except CosmicError as exc:
            if self.manager.mode is Mode.FAILED:
                self._failure = str(exc)
            task.fail(exc)
        self.rescanned.emit()
        self.status_changed.emit()

    @override
    def shut_down(self) -> None:
        """Stop every movement, release the hold, end all threads; any state."""
        self.request_end()
        self._end_teleoperation()
        self.recordings.close()
        if self.clearance_watch is not None:
            self.clearance_watch.request_end()
            self.clearance_watch.join()
        if self.path_planner is not None:
            self.path_planner.close()
        self.manager.close()
        self.join()
        self._forget()
