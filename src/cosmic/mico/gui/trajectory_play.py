"""`PlayControl`: runs the trajectory of the panel, as its bar and its question say."""

from collections.abc import Callable
from functools import partial

from PySide6.QtCore import QObject, Signal

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.relay import Relay
from cosmic.mico.api.mico import Mico
from cosmic.mico.api.trajectory_player import TrajectoryPlayer
from cosmic.mico.api.trajectory_start import AwayFromStartError
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
        self._mico = mico
        self._api = mico.trajectories
        self._bar = bar
        self._question = question
        self._trajectory: Trajectory | None = None
        self._player: TrajectoryPlayer | None = None
        self._asked: Callable[[StartMode], TrajectoryPlayer] | None = None
        self._relay = Relay(self._on_progressed)
        self._made = Relay(self._on_made)
        self._begun = Relay(self._on_begun)
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
        """Have the player begun, or a new one, where that may wait for a line."""
        player, trajectory = self._player, self._trajectory
        if trajectory is None:
            return
        loops, speed = self._bar.wanted_loops, self._bar.speed.value()
        if player is not None and player.state in (PlayState.ENDED, PlayState.CANCELLED):
            player = None

        def begun(start: StartMode) -> TrajectoryPlayer:
            nonlocal player
            if player is None:
                player = self._api.prepare(trajectory)
                self._made(player)
            player.loops, player.speed = loops, speed
            begin(player, start)
            return player

        self._asked = begun
        self._try_start("refuse")

    def _try_start(self, start: StartMode) -> None:
        if self._asked is not None:
            self._question.hide()
            if why := self._mico.application.busy():
                self.refused.emit(why)
                return
            asked = self._asked
            self._mico.carry_out(lambda: asked(start), self._begun)

    def _on_made(self, player: TrajectoryPlayer) -> None:
        self._player = player
        player.subscribe(partial(self._relay, player))

    def _on_begun(self, _player: TrajectoryPlayer | None, error: CosmicError | None) -> None:
        if isinstance(error, AwayFromStartError):
            self._question.ask(str(error), has_model=self._mico.checks_collisions)
        elif error is not None:
            self.refused.emit(str(error))

    def _on_start_chosen(self, mode: str) -> None:
        self._try_start("detour" if mode == "detour" else "straight")

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
