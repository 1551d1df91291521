"""What scripts and windows use of MiCo, whether it runs in this process or at a station."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from pathlib import Path
from threading import Lock
from typing import Final

from PySide6.QtCore import QObject, Signal

from cosmic.frame.application import GuiFactory
from cosmic.frame.errors import CosmicError, MoveRefused
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.operation import Task
from cosmic.frame.task_application import TaskApplication
from cosmic.mico.api.initialisation import Confirm
from cosmic.mico.api.planned_path import PlannedPath
from cosmic.mico.api.trajectory_recording import Recordings
from cosmic.mico.core.collision.clearance_watch import ClearanceWatch
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.motion.cautions import Cautions
from cosmic.mico.core.sequence.report import SequenceReport
from cosmic.mico.core.teleoperation.teleoperation import SteeredPlatform, Teleoperation

PATH_BUDGET_S: Final = 1.0
"""How long a path is looked for, in wall time."""


class MicoApplicationBase(TaskApplication):
    """MiCo, here or at a station: what it has, and what it carries out in its own thread.

    Signals
    -------
    path_found(Way), path_missing(MoveVerdict)
        How `search_path` ended.
    initialisation_changed(SequenceReport)
        The initialisation sequence is further; in the application's thread.
    status_changed()
        Devices came or went, or MiCo failed.

    Attributes
    ----------
    busy : callable
        Returns why an input device steers nothing now, in words; empty where it may.
    """

    rescanned = Signal()
    path_found = Signal(object)
    path_missing = Signal(object)
    initialisation_changed = Signal(object)

    clearance_watch: ClearanceWatch | None
    cautions: Cautions

    def __init__(
        self,
        policy: FailurePolicy,
        folder: Path | None = None,
        gui_factory: GuiFactory | None = None,
        parent: QObject | None = None,
    ) -> None:
        super().__init__("MiCo", policy, gui_factory, parent)
        self.recordings = Recordings(policy)
        self._folder = folder
        self._steering = Lock()
        self._teleoperation: Teleoperation | None = None
        self.busy: Callable[[], str] = str

    def teleoperation_of(self, platform: SteeredPlatform) -> Teleoperation:
        """Return what steers the axes by an input device plugged in here; any thread.

        There is one for the whole program. It is made when it is first asked for, and anew where a
        station has other settings than were known then.
        """
        with self._steering:
            made = self._teleoperation
            if made is None or made.settings != platform.settings.teleoperation:
                if made is not None:
                    made.close()
                made = Teleoperation(platform, self._policy, folder=self._folder)
                made.busy = lambda: self.busy()
                self._teleoperation = made
                if self.end_requested:
                    made.close()
            return made

    def _end_teleoperation(self) -> None:
        with self._steering:
            if self._teleoperation is not None:
                self._teleoperation.close()

    @property
    @abstractmethod
    def scene(self) -> SceneModel | None:
        """What is watched for collisions; None without a scene, or before it is known here."""

    @property
    @abstractmethod
    def failure(self) -> str:
        """Why MiCo cannot work; empty when it can."""

    @abstractmethod
    def initialize_later(self) -> Task:
        """Do what `initialize` does without waiting; `rescanned` tells the end. For windows."""

    @abstractmethod
    def rescan(self) -> Task:
        """Look again for the hardware; returns at once.

        Raises
        ------
        NotAvailable
            Another long operation is under way.
        """

    @abstractmethod
    def plan_path(self, targets: Mapping[str, float], budget_s: float) -> PlannedPath:
        """Return a path of some axes to `targets`, in gate coordinates; waits for it.

        Raises
        ------
        NotAvailable
            There is no collision model.
        MoveRefused
            No path was found; the verdict says what blocks.
        """

    @abstractmethod
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

    @abstractmethod
    def follow_path(self, path: PlannedPath, source: str) -> Task:
        """Follow a path that was found; returns at once.

        Raises
        ------
        NotAvailable
            Another long operation is under way.
        """

    @property
    @abstractmethod
    def initialisation(self) -> SequenceReport:
        """How far the initialisation sequence is, or was."""

    def search_path(self, targets: Mapping[str, float], budget_s: float = PATH_BUDGET_S) -> Task:
        """Plan a path in the application's thread; `path_found` or `path_missing` tells."""

        def search(task: Task) -> None:
            try:
                path = self.plan_path(targets, budget_s)
            except MoveRefused as exc:
                self.path_missing.emit(exc.verdict)
                task.fail(exc)
            except CosmicError as exc:
                task.fail(exc)
            else:
                self.path_found.emit(path)
                task.finish()

        return self.begin("Planning a path", search)
