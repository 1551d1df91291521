"""MiCo as a CoSMic application (thesis 5.4)."""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from PySide6.QtCore import QObject, Signal
from typing_extensions import override

from cosmic.frame.application import GuiFactory
from cosmic.frame.clock import Clock
from cosmic.frame.errors import CosmicError, DeviceError, MoveRefused, NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.task import Task
from cosmic.frame.task_application import TaskApplication
from cosmic.mico.api.initialisation import Confirm, InitialisationRun
from cosmic.mico.api.trajectory_site import TrajectorySite
from cosmic.mico.api.ways import Way, follow, way_from_plan
from cosmic.mico.core.collision.checker import NO_MODEL_TEXT, CollisionChecker
from cosmic.mico.core.collision.clearance_watch import ClearanceWatch
from cosmic.mico.core.collision.collision_manager import CollisionManager
from cosmic.mico.core.device_manager import DeviceManager, Mode
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.core.teleoperation.teleoperation import Teleoperation
from cosmic.mico.core.undo import UndoHistory
from cosmic.mico.core.way_finder import WayFinder
from cosmic.mico.hw.interface import Controller

logger = logging.getLogger(__name__)

WAY_BUDGET_S: Final = 1.0
"""How long a way is looked for, in wall time."""


class MicoApplication(TaskApplication):
    """Owns the `DeviceManager` and carries out what takes long, in its own thread.

    Signals
    -------
    way_found(Way), way_missing(MoveVerdict)
        How `search_way` ended.
    initialisation_changed(SequenceReport)
        The initialisation sequence is further; in the application's thread.
    status_changed()
        Devices came or went, or MiCo failed.
    """

    rescanned = Signal()
    way_found = Signal(object)
    way_missing = Signal(object)
    initialisation_changed = Signal(object)

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
        super().__init__("MiCo", policy, gui_factory, parent)
        self.manager = DeviceManager(
            controller, settings, clock=clock, policy=policy, checker=checker
        )
        self.collision = checker if isinstance(checker, CollisionManager) else None
        self.clearance_watch = (
            ClearanceWatch(self.collision, self.manager.positions, policy)
            if self.collision is not None
            else None
        )
        self.way_finder = (
            WayFinder(self.manager, self.collision.model) if self.collision is not None else None
        )
        self.undo = UndoHistory(self.manager)
        self.teleoperation = Teleoperation(self.manager, policy)
        self.trajectories = TrajectorySite(self, policy, platform, folder)
        self._failure = ""
        self._forget = policy.on_safe_stop(self.manager.stop)

    @property
    def failure(self) -> str:
        """Why MiCo cannot work; empty when it can."""
        return self._failure

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

    def initialise_platform(
        self, *, skip_known: bool = False, confirm: Confirm | None = None
    ) -> Task:
        """Carry the initialisation sequence out; returns at once.

        `initialisation_changed` tells how far it is; the arguments are those of
        `Mico.initialise`.

        Raises
        ------
        NotAvailable
            Another long operation is under way.
        """
        run = InitialisationRun(
            self.manager,
            skip_known=skip_known,
            confirm=confirm,
            on_report=self.initialisation_changed.emit,
        )
        return self.begin("Initialisation", run.run)

    def rescan(self) -> Task:
        """Look again for the hardware; returns at once.

        Raises
        ------
        NotAvailable
            Another long operation is under way.
        """
        return self.begin("Looking for devices", self._rescan)

    # Ways round (ECM)

    def find_way(self, targets: Mapping[str, float], budget_s: float) -> Way:
        """Return a way of some axes to `targets`, in gate coordinates; waits for it.

        Raises
        ------
        NotAvailable
            There is no collision model.
        MoveRefused
            No way was found; the verdict says what blocks.
        """
        if self.way_finder is None:
            raise NotAvailable(f"{NO_MODEL_TEXT}: without one there is nothing to go round")
        return way_from_plan(self.way_finder.find(targets, budget_s))

    def search_way(self, targets: Mapping[str, float], budget_s: float = WAY_BUDGET_S) -> Task:
        """Look for a way in the application's thread; `way_found` or `way_missing` tells."""

        def search(task: Task) -> None:
            try:
                way = self.find_way(targets, budget_s)
            except MoveRefused as exc:
                self.way_missing.emit(exc.verdict)
                task.fail(exc)
            except CosmicError as exc:
                task.fail(exc)
            else:
                self.way_found.emit(way)
                task.finish()

        return self.begin("Looking for a way", search)

    def follow_way(self, way: Way, source: str) -> Task:
        """Go a way that was found; returns at once.

        Raises
        ------
        NotAvailable
            Another long operation is under way.
        """
        return self.begin("Going round", lambda task: follow(self.manager, way, task, source))

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
        self.teleoperation.close()
        self.trajectories.close()
        if self.clearance_watch is not None:
            self.clearance_watch.request_end()
            self.clearance_watch.join()
        if self.way_finder is not None:
            self.way_finder.close()
        self.manager.close()
        self.join()
        self._forget()
