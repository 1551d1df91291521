"""MiCo of another process or computer, with the face of a `MicoApplication`."""

import logging
from collections.abc import Callable, Mapping
from threading import Event
from typing import Final

from PySide6.QtCore import QObject, Qt
from typing_extensions import override

from cosmic.frame.application import GuiFactory
from cosmic.frame.errors import CosmicError, NotAvailable, ProtocolError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.ongoing import Ongoing
from cosmic.frame.network.transport import Presence, Rule, Subscription, Transport
from cosmic.frame.operation import Progress, Task
from cosmic.mico.api.application_base import MicoApplicationBase
from cosmic.mico.api.remote_line import CommandLine, may_wait_here
from cosmic.mico.api.remote_manager import RemoteManager
from cosmic.mico.api.remote_mirrors import RemoteCollision
from cosmic.mico.api.station_words import EVENTS, POSITIONS, MicoFacts, MicoPicture
from cosmic.mico.api.trajectory_site import TrajectorySite
from cosmic.mico.api.ways import Way
from cosmic.mico.core.collision.clearance_watch import ClearanceWatch
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.motion.undo import Cautions
from cosmic.mico.core.teleoperation.teleoperation import Teleoperation

logger = logging.getLogger(__name__)

FIRST_WORD_S: Final = 10.0
"""How long `initialize` waits for the station, where it may wait."""
SCENE_LIMIT_S: Final = 10.0
"""How long the shapes of all bodies may take on the way."""
_CLOSED: Final = "MiCo is closed here"


class RemoteMicoApplication(MicoApplicationBase):
    """Shows and commands the axes of a station as if they were here.

    Reading takes what the station told last. Sequences (initialisation, ways, trajectories) are
    carried out in this process, each movement by the station; what moves there stops when this
    process ends, freezes or loses the lease. The station's gate decides every movement.

    Parameters
    ----------
    transport : Transport
        The station, which hosts a `MicoStationSide` under the name "mico". Who made it closes it.
    """

    manager: RemoteManager
    collision: RemoteCollision
    clearance_watch: ClearanceWatch

    def __init__(
        self,
        transport: Transport,
        policy: FailurePolicy,
        *,
        gui_factory: GuiFactory | None = None,
        parent: QObject | None = None,
    ) -> None:
        super().__init__("MiCo", policy, gui_factory, parent)
        self._transport = transport
        self._line = CommandLine(transport, policy)
        self._subscriptions: list[Subscription] = []
        self._told = Event()
        self._here = False
        self._closed = self._dressed = False
        self.manager = RemoteManager(self._line)
        self.collision = self.manager.collision
        self.clearance_watch = ClearanceWatch(self.collision, self.manager.positions, policy)
        self.undo = self.manager.undo
        self.cautions = Cautions()  # what the station felt stands in the entries it tells
        self.teleoperation = Teleoperation(self.manager, policy)
        self.trajectories = TrajectorySite(self, policy)
        self.trajectories.poses = self.manager.poses
        self.manager.changed.connect(self.status_changed, Qt.ConnectionType.DirectConnection)
        self._forget = policy.on_safe_stop(self._on_safe_stop)
        self._leave_presence: Callable[[], None] = lambda: None

    @property
    @override
    def failure(self) -> str:
        return self.manager.failure

    # Beginning and ending

    @override
    def initialize(self) -> None:
        """Hear of the station from now on, and wait for its first word where that is possible.

        With a station that is away it stays open with `failure` set, and goes on by itself once
        the station is there.
        """
        self.start()
        self._line.start()
        hears = (
            (EVENTS, Rule.ALL, self.manager.take_event),
            (POSITIONS, Rule.LATEST, self.manager.take_positions),
        )
        self._subscriptions = [self._transport.subscribe(*each) for each in hears]
        self._leave_presence = self._transport.presence(self._on_presence)
        if may_wait_here():
            self._told.wait(FIRST_WORD_S)

    @override
    def initialize_later(self) -> Task:
        """Do what `initialize` does without waiting, for windows."""
        self.initialize()
        task = Task("Looking for the station")
        task.finish()
        return task

    def _on_presence(self, presence: Presence) -> None:
        if presence.here and not self._here:
            self._here = True
            self._line.post(self._learn)
        elif not presence.here:
            self._here = False
            self.manager.lose(f"{presence.name} is away: {presence.why}")
            self.status_changed.emit()

    def _learn(self) -> None:
        """Ask the station for everything; in the thread of the orders."""
        try:
            facts = self._line.call("facts", {})
            picture = self._line.call("picture", {})
            if not (isinstance(facts, MicoFacts) and isinstance(picture, MicoPicture)):
                raise ProtocolError("the station does not say what it has")
            scene = self._line.call("scene", {}, SCENE_LIMIT_S) if facts.checks else None
            if not (scene is None or isinstance(scene, SceneModel)):
                raise ProtocolError("the station sends something else than its scene")
            self.manager.take_facts(facts, scene)
            self.manager.take_picture(picture)
            self._dress(facts)
        except CosmicError as exc:
            logger.warning("MiCo of the station cannot be used: %s", exc)
            self.manager.lose(str(exc))
        self._told.set()
        self.rescanned.emit()
        self.status_changed.emit()

    def _dress(self, facts: MicoFacts) -> None:
        """Make what depends on the settings of the station, once they are known."""
        self.trajectories.platform = facts.platform
        if self._dressed:
            return
        self._dressed = True
        self.teleoperation.close()
        self.teleoperation = Teleoperation(self.manager, self._policy)
        if self.collision.available:
            self.clearance_watch.start()

    def _on_safe_stop(self, reason: str) -> None:
        """Stop what was begun here, when something here has failed."""
        if self._here and self._line.open_orders():
            self._line.at_once_later("stop", {"reason": reason})

    @override
    def shut_down(self) -> None:
        """Stop hearing and commanding; any state. What was begun here stops at the station."""
        if self._closed:
            return
        self._closed = True
        self._forget()
        self._line.give_up()
        self._leave_presence()
        self.request_end()
        self.teleoperation.close()
        self.trajectories.close()
        self.clearance_watch.request_end()
        self.clearance_watch.join()
        self.join()
        for each in self._subscriptions:
            each.close()
        self._line.close()
        self.manager.lose(_CLOSED)

    # What takes long

    @override
    def rescan(self) -> Task:
        return self.begin("Looking for devices", self._rescan)

    def _rescan(self, task: Task) -> None:
        try:
            ongoing = self._ongoing("rescan", {})
            follow_task(ongoing, task)
            ongoing.wait()
            self._learn()
            task.finish()
        except CosmicError as exc:
            task.fail(exc)

    @override
    def find_way(self, targets: Mapping[str, float], budget_s: float) -> Way:
        arguments = {"targets": dict(targets), "budget_s": float(budget_s)}
        found = self._ongoing("find_way", arguments).wait()
        if not isinstance(found, Way):
            raise ProtocolError(f"the station found something else than a way: {found!r:.80}")
        return found

    def _ongoing(self, function: str, arguments: Mapping[str, object]) -> Ongoing:
        found = self._line.run(lambda: self._line.call(function, arguments))
        if not isinstance(found, Ongoing):
            raise NotAvailable(f"the station did not begin {function}: {found!r:.80}")
        return found


def follow_task(ongoing: Ongoing, task: Task) -> None:
    """Have `task` tell how far something at the station is; cancelling it ends that."""

    def on_progress(progress: Progress) -> None:
        if not progress.done:
            task.report(progress.fraction, progress.text)

    subscribe = getattr(ongoing, "subscribe", None)
    if subscribe is not None:
        subscribe(on_progress)
    task.on_cancel(ongoing.cancel)
