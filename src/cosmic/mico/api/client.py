"""MiCo of another process or computer, in the place of one that runs here."""

from collections.abc import Callable, Mapping
from threading import Event
from typing import Final

from PySide6.QtCore import QObject
from typing_extensions import override

from cosmic.frame.application import GuiFactory
from cosmic.frame.background import BackgroundJobs
from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.link import ApplicationLink
from cosmic.frame.network.proxy import proxy_of
from cosmic.frame.network.transport import Transport
from cosmic.frame.operation import Operation, Progress, Task
from cosmic.frame.threads import may_wait_here
from cosmic.mico.api.application_base import MicoApplicationBase
from cosmic.mico.api.initialisation import POLL_S, Confirm, confirmed
from cosmic.mico.api.mico import Mico
from cosmic.mico.api.planned_path import PlannedPath
from cosmic.mico.core.collision.clearance_watch import ClearanceWatch
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.motion.cautions import Cautions
from cosmic.mico.core.sequence.report import SequenceReport

FIRST_WORD_S: Final = 10.0
"""How long `initialize` waits for the station, where it may wait."""
_CLOSED: Final = "MiCo is closed here"


class MicoClient(MicoApplicationBase):
    """Shows and commands the axes of a station as if they were here.

    Everything goes through `Mico`, as the station declares it. Initialisation, detours, poses
    and trajectories run at the station; teleoperation reads its device in this process, and jogs
    there under the dead man. What moves there stops when this process ends, freezes or loses the
    lease.

    Parameters
    ----------
    transport : Transport
        The station, which hosts a `Mico` under the name "mico". Who made it closes it.
    kind : type
        What is declared there.
    """

    clearance_watch: ClearanceWatch

    def __init__(
        self,
        transport: Transport,
        policy: FailurePolicy,
        *,
        kind: type[Mico] = Mico,
        gui_factory: GuiFactory | None = None,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(policy, None, gui_factory, parent)
        self._link = ApplicationLink(kind, transport, "mico", policy)
        self._kind = kind
        self._background = BackgroundJobs("mico learns", policy)
        self._known = Event()
        self._asked = self._closed = False
        self._outline: tuple[object, ...] = ()
        self._report = SequenceReport(())
        self._scene: SceneModel | None = None
        self._micos: dict[str, Mico] = {}
        self.api: Mico = proxy_of(kind, self._link)
        self.api.belong_to(self)
        self.clearance_watch = ClearanceWatch(self.api.nearest, self.api.positions, policy)
        self.cautions = Cautions()  # what the station felt stands in the entries it publishes
        self.api.on_change(self._on_change)

    def mico(self, source: str) -> Mico:
        """Return what it offers, for whoever commands by the name of `source`."""
        found = self._micos.get(source)
        if found is None:
            found = self._micos[source] = proxy_of(self._kind, self._link)
            found.belong_to(self, source)
        return found

    @property
    @override
    def failure(self) -> str:
        return _CLOSED if self._closed else self.api.failure

    @property
    @override
    def scene(self) -> SceneModel | None:
        return self._scene

    @property
    @override
    def initialisation(self) -> SequenceReport:
        return self.api.initialisation

    # Beginning and ending

    @override
    def initialize(self) -> None:
        """Hear of the station from now on, and wait for its first word where that is possible.

        With a station that is away it stays open with `failure` set, and goes on by itself once
        the station is there.
        """
        self.start()
        self._link.open()
        if may_wait_here():
            self._known.wait(FIRST_WORD_S)

    @override
    def initialize_later(self) -> Task:
        """Do what `initialize` does without waiting, for windows."""
        self.start()
        self._link.open()
        task = Task("Looking for the station")
        task.finish()
        return task

    def _on_change(self) -> None:
        """Take note of a new state, in the thread that hears of it."""
        api = self.api
        outline = (api.ready, api.failure, tuple(api.axes), api.missing)
        if outline != self._outline:
            self._outline = outline
            self.status_changed.emit()
        report = api.initialisation
        if report != self._report:
            self._report = report
            self.initialisation_changed.emit(report)
        if not api.away and not self._asked:
            self._asked = True
            self._background.do(self._read_scene, self._learn)

    def _read_scene(self) -> SceneModel | None:
        return self.api.scene() if self.api.checks_collisions else None

    def _learn(self, scene: SceneModel | None, error: CosmicError | None) -> None:
        """Take note of what the station has for as long as it runs."""
        if error is not None:
            self._asked = False  # the next word of the station asks again
            return
        self._scene = scene
        if scene is not None:
            self.clearance_watch.start()
        self._known.set()
        self.rescanned.emit()
        self.status_changed.emit()

    @override
    def shut_down(self) -> None:
        """Stop hearing and commanding; any state. What was begun here stops at the station."""
        if self._closed:
            return
        self._closed = True
        self.request_end()
        self._end_teleoperation()
        self.recordings.close()
        self.clearance_watch.request_end()
        self.clearance_watch.join()
        self._link.close()
        self.join()
        self._background.request_end()
        self._background.join()

    # What takes long, at the station

    @override
    def rescan(self) -> Task:
        return self._begin_there("Looking for devices", self.api.begin_rescan)

    @override
    def plan_path(self, targets: Mapping[str, float], budget_s: float) -> PlannedPath:
        return self.api.begin_search(dict(targets), float(budget_s)).wait()

    @override
    def follow_path(self, path: PlannedPath, source: str) -> Task:
        return self._begin_there(
            "Following a path", lambda: self.api.begin_detour(path, source=source)
        )

    @override
    def initialise_platform(
        self,
        *,
        skip_known: bool = False,
        confirm: Confirm | None = None,
        may_hold: bool = False,
    ) -> Task:
        asks = confirm is not None
        return self._begin_there(
            "Initialisation",
            lambda: self.api.begin_initialisation(
                skip_known=skip_known, may_hold=may_hold, asks=asks
            ),
            confirm,
        )

    def _begin_there(
        self, title: str, begin: Callable[[], Operation[None]], confirm: Confirm | None = None
    ) -> Task:
        """Begin something at the station and follow it in this application's thread."""

        def job(task: Task) -> None:
            try:
                begun = begin()
                _accompany(begun, task)
                self._answer(begun, confirm)
                begun.wait()
                self.rescanned.emit()
                task.finish()
            except CosmicError as exc:
                task.fail(exc)

        return self.begin(title, job)

    def _answer(self, begun: Operation[None], confirm: Confirm | None) -> None:
        """Answer the questions of the sequence until it has ended."""
        over = Event()
        begun.add_callback(lambda _ended: over.set())
        answered: tuple[int | None, str] = (None, "")
        while confirm is not None and not over.wait(POLL_S):
            report = self.api.initialisation
            # By its step: the next one may ask the same before anybody has looked in between.
            asked = (report.running, report.question)
            if report.question and asked != answered:
                self.api.answer(confirmed(confirm, report.question))
            answered = asked


def _accompany(begun: Operation[None], task: Task) -> None:
    """Have `task` tell how far something at the station is; cancelling it ends that."""

    def on_progress(progress: Progress) -> None:
        if not progress.done:
            task.report(progress.fraction, progress.text)

    begun.subscribe(on_progress)
    task.on_cancel(begun.cancel)
