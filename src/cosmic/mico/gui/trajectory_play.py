"""`PlayControl`: runs the trajectory of the panel, as its bar and its question say."""

from collections.abc import Callable
from functools import partial

from PySide6.QtCore import QObject, Signal

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.relay import Relay
from cosmic.mico.api.mico import Mico
from cosmic.mico.api.trajectory_places import AwayFromStartError
from cosmic.mico.api.trajectory_player import TrajectoryPlayer
from cosmic.mico.api.trajectory_state import PlayProgress, PlayState, StartMode
from cosmic.mico.core.trajectory.model import Trajectory
from cosmic.mico.gui.trajectory_bars import RunBar, StartQuestion


class PlayControl(QObject):
    """Makes the player of a trajectory and commands it; GUI thread. Nothing here waits.

    Signals
    -------
    progressed(PlayProgress)
        The player has come to another line, or to another state.
    refused(str)
        It cannot be run; why.
    """

    progressed = Signal(object)
    refused = Signal(str)

    def __init__(self, mico: Mico, bar: RunBar, question: StartQuestion, parent: QObject) -> None:
        super().__init__(parent)
        self._application = mico.application
        self._api = mico.trajectories
        self._bar = bar
        self._question = question
        self._trajectory: Trajectory | None = None
        self._player: TrajectoryPlayer | None = None
        self._asked: Callable[[StartMode], None] | None = None
        self._relay = Relay(self._on_progressed)
        bar.run_requested.connect(self.run)
        bar.step_requested.connect(self.step)
        bar.pause_requested.connect(self._on_pause)
        bar.cancel_requested.connect(self._on_cancel)
        bar.speed_changed.connect(self._on_speed)
        question.chosen.connect(self._on_start_chosen)

    @property
    def trajectory(self) -> Trajectory | None:
        """What is run."""
        return self._trajectory

    @property
    def player(self) -> TrajectoryPlayer | None:
        """Its player; None before it was run."""
        return self._player

    def take(self, trajectory: Trajectory) -> None:
        """Run this one from now on."""
        self.forget()
        self._trajectory = trajectory

    def forget(self) -> None:
        """Let go of the trajectory; one that is paused is given up."""
        if self._player is not None and not self._player.done:
            self._player.cancel()
        self._trajectory = self._player = None
        self._question.hide()

    def run(self) -> None:
        """Run it, or go on where it was paused or has failed."""
        self._start(lambda player, start: player.resume(start))

    def step(self) -> None:
        """Make one line."""
        self._start(lambda player, start: player.step(start))

    def _start(self, begin: Callable[[TrajectoryPlayer, StartMode], None]) -> None:
        player = self._usable_player()
        if player is None:
            return
        player.loops = self._bar.wanted_loops
        player.speed = self._bar.speed.value()
        self._asked = lambda start: begin(player, start)
        self._try_start("refuse")

    def _try_start(self, start: StartMode) -> None:
        if self._asked is None:
            return
        self._question.hide()
        try:
            self._asked(start)
        except AwayFromStartError as exc:
            self._question.ask(str(exc), has_model=self._application.collision is not None)
        except CosmicError as exc:
            self.refused.emit(str(exc))

    def _on_start_chosen(self, mode: str) -> None:
        self._try_start("way" if mode == "way" else "straight")

    def _usable_player(self) -> TrajectoryPlayer | None:
        """Return a player that can go on, or a new one."""
        done = (PlayState.ENDED, PlayState.CANCELLED)
        if self._player is not None and self._player.state not in done:
            return self._player
        if self._trajectory is None:
            return None
        try:
            player = self._player = self._api.prepare(self._trajectory)
        except CosmicError as exc:
            self.refused.emit(str(exc))
            return None
        player.subscribe(partial(self._relay, player))
        return player

    def _on_pause(self) -> None:
        if self._player is not None:
            self._player.pause()

    def _on_cancel(self) -> None:
        if self._player is not None:
            self._player.cancel()

    def _on_speed(self, factor: float) -> None:
        if self._player is not None:
            self._player.speed = factor

    def _on_progressed(self, player: TrajectoryPlayer, progress: PlayProgress) -> None:
        if player is self._player:
            self.progressed.emit(progress)
