"""`TrajectoryPlayer`: makes the movements of a trajectory, line by line, through the gate (SCM)."""

import logging
from collections.abc import Callable
from threading import RLock
from typing import Final

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import (
    CosmicError,
    DeviceTimeout,
    MoveCancelled,
    NotAvailable,
    OperationCancelled,
)
from cosmic.frame.events import Event, Unsubscribe, notify
from cosmic.frame.operation import Task
from cosmic.frame.threads import forbid_waiting_here
from cosmic.mico.api.trajectory_moves import at_line
from cosmic.mico.api.trajectory_run import TrajectoryRun
from cosmic.mico.api.trajectory_site import TrajectorySite
from cosmic.mico.api.trajectory_state import (
    START_MODES,
    PlayControl,
    PlayProgress,
    PlayState,
    StartMode,
)
from cosmic.mico.core.trajectory.binding import Bound
from cosmic.mico.core.trajectory.model import Trajectory
from cosmic.mico.core.trajectory.rehearsal import Rehearsal

logger = logging.getLogger(__name__)

SPEEDS: Final = (0.01, 10.0)
_RESUMABLE: Final = (PlayState.READY, PlayState.PAUSED, PlayState.FAILED)


@checked_class
class TrajectoryPlayer:
    """Makes the movements of one trajectory; any thread, and every method returns at once.

    The gate decides each line when its turn comes. A stop, a refusal or a failure ends it at a
    line; `resume` goes on there once the reason is gone. During a pause nothing of it runs, so
    that a platform can be repaired, initialised or moved meanwhile.
    """

    def __init__(
        self,
        site: TrajectorySite,
        bound: Bound,
        *,
        source: str = "script",
        speed: float = 1.0,
        loops: int | None = 1,
        timed: bool = True,
    ) -> None:
        self._site = site
        self._trajectory = bound.trajectory
        self._control = PlayControl(timed=timed)
        self._changed = self._control.changed
        self._run = TrajectoryRun(site, bound, self._control, source)
        self._publishing = RLock()
        self._progressed: Event[PlayProgress] = Event()
        self._state = PlayState.READY
        self._failure: CosmicError | None = None
        self._task: Task | None = None
        self._played: Task | None = None
        self._text = ""
        self.speed = speed
        self.loops = loops

    # What it is at

    @property
    def trajectory(self) -> Trajectory:
        """What it plays."""
        return self._trajectory

    @property
    def rehearsal(self) -> Rehearsal | None:
        """What was found before the first movement; None before that."""
        return self._run.rehearsal

    @property
    def state(self) -> PlayState:
        """What it is at: ready, running, paused, failed, cancelled, ended."""
        return self._state

    @property
    def done(self) -> bool:
        """True when it has ended, was cancelled, or has failed and was not resumed."""
        return self._state in (PlayState.ENDED, PlayState.CANCELLED, PlayState.FAILED)

    @property
    def failure(self) -> CosmicError | None:
        """Why it stopped, with the line; None while nothing went wrong."""
        return self._failure

    @property
    def line(self) -> int:
        """Line of the file that is being carried out, or comes next; 0 before the first."""
        return 0 if self._state is PlayState.READY else self._run.line

    @property
    def left_s(self) -> float | None:
        """How long this pass still takes, without pauses; None before the rehearsal."""
        return 0.0 if self._state is PlayState.ENDED else self._run.left_s

    @property
    def progress(self) -> PlayProgress:
        """How far it is."""
        left_s, rehearsal = self.left_s, self._run.rehearsal
        share = 1.0 if self._state is PlayState.ENDED else 0.0
        if left_s is not None and rehearsal is not None and rehearsal.duration_s > 0.0:
            share = 1.0 - left_s / rehearsal.duration_s
        return PlayProgress(
            state=self._state,
            line=self.line,
            text=self._text,
            fraction=share,
            left_s=left_s,
            loop=self._run.loop,
            loops=self.loops,
            error=str(self._failure) if self._failure else "",
        )

    def subscribe(self, listener: Callable[[PlayProgress], object]) -> Unsubscribe:
        """Call `listener(progress)` at each line and change, in the thread that makes it."""
        with self._publishing:
            notify(listener, self.progress)
            return self._progressed.subscribe(listener)

    # How it goes

    @property
    def speed(self) -> float:
        """How fast it goes, 0.01 to 10 times as written; holds from the next line on.

        Times ``t=`` scale with it; a ``wait`` lasts as long as it says.
        """
        return self._control.speed

    @speed.setter
    def speed(self, factor: float) -> None:
        low, high = SPEEDS
        if not low <= factor <= high:
            raise NotAvailable(f"the speed factor lies between {low:g} and {high:g}: {factor!r}")
        with self._changed:
            self._run.change_speed(float(factor))

    @property
    def loops(self) -> int | None:
        """How many times it is run; None: until it is paused or cancelled."""
        return self._control.loops

    @loops.setter
    def loops(self, loops: int | None) -> None:
        if loops is not None and not loops >= 1:
            raise NotAvailable(f"a trajectory is run once or more, not {loops!r} times")
        self._control.loops = loops

    # What can be asked of it

    def resume(self, start: StartMode = "refuse") -> None:
        """Begin, or go on where it was paused or has failed.

        Parameters
        ----------
        start : str
            What to do where axes do not stand where the trajectory begins, or goes on: "refuse",
            go there "straight" and together, or have a "way" found.

        Raises
        ------
        NotAvailable
            It has ended or runs already, or another long operation is under way.
        AwayFromStartError
            Axes stand elsewhere, and `start` is "refuse"; nothing moved.
        """
        self._begin(start, one_line=False)

    def step(self, start: StartMode = "refuse") -> None:
        """Carry out one line, then pause; raises as `resume`."""
        self._begin(start, one_line=True)

    def pause(self) -> None:
        """Pause when the line under way is over; harmless while it does not run."""
        with self._changed:
            self._control.pausing = True
            self._changed.notify_all()

    def cancel(self) -> None:
        """End it now and stop its axes; nothing is latched."""
        with self._changed:
            task = self._task
            if self._state in _RESUMABLE:
                self._set_state(PlayState.CANCELLED)
        if task is not None:
            task.cancel()
        self._publish()

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait until it is done; raises what it failed with.

        Raises
        ------
        DeviceTimeout
            It was not done after `timeout_s` of wall time; it goes on.
        WrongThreadError
            Called in the GUI thread.
        """
        if not self.done:
            forbid_waiting_here("waiting for a trajectory")
        with self._changed:
            if not self._changed.wait_for(lambda: self.done, timeout_s):
                raise DeviceTimeout(f"the trajectory had not ended after {timeout_s:g} s")
        if self._failure is not None:
            raise self._failure

    def wait_for_pause(self, timeout_s: float | None = None) -> bool:
        """Wait until nothing of it runs; False after `timeout_s` of wall time."""
        forbid_waiting_here("waiting for a trajectory")
        with self._changed:
            return self._changed.wait_for(lambda: self._state is not PlayState.RUNNING, timeout_s)

    def _begin(self, start: StartMode, *, one_line: bool) -> None:
        if start not in START_MODES:
            raise NotAvailable(f"start is one of {', '.join(START_MODES)}, not {start!r}")
        with self._changed:
            if self._state not in _RESUMABLE:
                raise NotAvailable(f"{self.trajectory.name}: it is {self._state}")
            if start == "refuse":
                self._run.refuse_away()
            self._run.heed_stops()
            task = self._site.worker.begin(self.trajectory.name, self._play)
            control = self._control
            control.pausing, control.one_line, control.start = False, one_line, start
            self._failure, self._task = None, task
            self._set_state(PlayState.RUNNING)
        task.on_cancel(self._halt)
        task.add_callback(self._on_end)
        self._publish()

    def _on_end(self, task: Task) -> None:
        """End with a task whose turn never came; any thread."""
        with self._changed:
            if self._played is task:
                return
        error = task.failure
        cancelled = isinstance(error, OperationCancelled)
        self._failure = MoveCancelled(str(error)) if cancelled else CosmicError(str(error))
        self._leave(PlayState.CANCELLED if cancelled else PlayState.FAILED)

    # In the application's thread

    def _play(self, task: Task) -> None:
        with self._changed:  # whoever began it has noted everything then
            self._played = task
        try:
            ended = self._run.play(task, lambda text: self._say(task, text))
        except CosmicError as exc:
            self._fail(task, exc)
        except BaseException as exc:
            self._fail(task, CosmicError(repr(exc)))
            raise
        else:
            task.finish()
            self._leave(PlayState.ENDED if ended else PlayState.PAUSED)

    def _fail(self, task: Task, error: CosmicError) -> None:
        cancelled = isinstance(error, MoveCancelled) and task.cancel_requested
        found = at_line(error, self._run.line) if self._run.at_line else error
        self._failure = found
        task.fail(found)
        self._leave(PlayState.CANCELLED if cancelled else PlayState.FAILED)

    def _leave(self, state: PlayState) -> None:
        with self._changed:
            self._set_state(state)
        self._publish()

    def _halt(self) -> None:
        """Stop what is under way; any thread."""
        with self._changed:
            self._changed.notify_all()
        self._run.mover.halt()

    def _set_state(self, state: PlayState) -> None:
        self._state = state
        self._changed.notify_all()

    def _say(self, task: Task, text: str) -> None:
        self._text = text
        task.report(self.progress.fraction, text)
        self._publish()

    def _publish(self) -> None:
        with self._publishing:
            self._progressed.emit(self.progress)
