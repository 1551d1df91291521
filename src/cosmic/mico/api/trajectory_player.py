"""`TrajectoryPlayer`: makes the movements of a trajectory, line by line, through the gate (SCM)."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import count
from threading import Event, Lock, RLock
from typing import Final

from typing_extensions import override

from cosmic.frame.arguments import checked_class
from cosmic.frame.clock import WALL
from cosmic.frame.declaration import Declared, command, state
from cosmic.frame.errors import (
    CosmicError,
    DeviceTimeout,
    MoveCancelled,
    NotAvailable,
    OperationCancelled,
)
from cosmic.frame.events import Event as ChangeEvent
from cosmic.frame.events import Unsubscribe, notify
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.travelling_errors import from_plain, to_plain
from cosmic.frame.operation import Task
from cosmic.frame.threads import forbid_waiting_here
from cosmic.mico.api.trajectory_moves import at_line
from cosmic.mico.api.trajectory_run import TrajectoryRun
from cosmic.mico.api.trajectory_site import TrajectorySite
from cosmic.mico.api.trajectory_state import (
    START_MODES,
    PlayControl,
    PlayerSnapshot,
    PlayProgress,
    PlayState,
    StartMode,
    present_mode,
)
from cosmic.mico.core.trajectory import reader
from cosmic.mico.core.trajectory.binding import Bound
from cosmic.mico.core.trajectory.model import Trajectory, TrajectoryError
from cosmic.mico.core.trajectory.rehearsal import Rehearsal
from cosmic.mico.core.trajectory.writer import to_text

logger = logging.getLogger(__name__)

SPEEDS: Final = (0.01, 10.0)
MOST_PLAYERS: Final = 4
"""How many players other programs can still reach."""
_RESUMABLE: Final = (PlayState.READY, PlayState.PAUSED, PlayState.FAILED)
_DONE: Final = (PlayState.ENDED, PlayState.CANCELLED, PlayState.FAILED)
_LOOK_S: Final = 0.25
"""How often whoever waits looks whether the station is still there."""


@checked_class
class TrajectoryPlayer(Declared):
    """Makes the movements of one trajectory; any thread, and every method returns at once.

    It runs where the axes are, and what it runs for another program ends with that program as a
    movement does. The gate decides each line when its turn comes. A stop, a refusal or a failure
    ends it at a line; `resume` goes on there once the reason is gone. During a pause nothing of it
    runs, so that a platform can be repaired, initialised or moved meanwhile.
    """

    _failure: CosmicError | None = None
    _trajectory: Trajectory | None = None

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
        self._brief: Rehearsal | None = None
        self._state = PlayState.READY
        self._task: Task | None = None
        self._played: Task | None = None
        self._text = ""
        self.speed = speed
        self.loops = loops

    @override
    def set_up_proxy(self, key: str, policy: FailurePolicy) -> None:
        self._publishing = RLock()

    # What it is at

    @property
    @state
    def now(self) -> PlayerSnapshot:
        """All that is known of it."""
        error = self._failure
        return PlayerSnapshot(
            self._progress(),
            self._control.speed,
            self._rehearsed(),
            None if error is None else to_plain(error),
        )

    def _rehearsed(self) -> Rehearsal | None:
        """Return what the rehearsal found without its poses, which are many."""
        found, brief = self._run.rehearsal, self._brief
        if found is not None and brief is None:
            brief = self._brief = replace(found, poses=(), left_s=())
        return brief

    def _progress(self) -> PlayProgress:
        begun, rehearsal = self._state is not PlayState.READY, self._run.rehearsal
        ended = self._state is PlayState.ENDED
        left_s = 0.0 if ended else self._run.left_s
        share = 1.0 if ended else 0.0
        if left_s is not None and rehearsal is not None and rehearsal.duration_s > 0.0:
            share = 1.0 - left_s / rehearsal.duration_s
        return PlayProgress(
            state=self._state,
            line=self._run.line if begun else 0,
            text=self._text,
            fraction=share,
            left_s=left_s,
            loop=self._run.loop,
            loops=self._control.loops,
            error=str(self._failure) if self._failure else "",
        )

    @command(reads=True)
    def text(self) -> str:
        """Return the text of what it plays."""
        return text_of(self.trajectory)

    @property
    def trajectory(self) -> Trajectory:
        """What it plays."""
        if self._trajectory is None:  # somebody else had it prepared
            self._trajectory = reader.parse(self.text())
        return self._trajectory

    def keep_trajectory(self, trajectory: Trajectory) -> None:
        """Know what it plays; for whoever had it prepared."""
        self._trajectory = trajectory

    @property
    def rehearsal(self) -> Rehearsal | None:
        """What was found before the first movement; None before that.

        Of a player at another station it is without poses.
        """
        return self.now.rehearsal if self.remote else self._run.rehearsal

    @property
    def done(self) -> bool:
        """True when it has ended, was cancelled, or has failed and was not resumed."""
        return self.progress.state in _DONE

    @property
    def failure(self) -> CosmicError | None:
        """Why it stopped, with the line; None while nothing went wrong."""
        plain = self.now.failure
        return None if plain is None else self._failure or from_plain(plain)

    @property
    def line(self) -> int:
        """Line of the file that is being carried out, or comes next; 0 before the first."""
        return self.progress.line

    @property
    def left_s(self) -> float | None:
        """How long this pass still takes, without pauses; None before the rehearsal."""
        return self.progress.left_s

    @property
    def progress(self) -> PlayProgress:
        """How far it is."""
        return self.now.progress

    def subscribe(self, listener: Callable[[PlayProgress], object]) -> Unsubscribe:
        """Call `listener(progress)` at each line and change, in the thread that makes it.

        Of a player at another station it is called with what was published last.
        """

        def on_change() -> None:
            with self._publishing:
                notify(listener, self.progress)

        with self._publishing:
            on_change()
            return self.on_change(on_change)

    # How it goes

    @property
    def speed(self) -> float:
        """How fast it goes, 0.01 to 10 times as written; holds from the next line on.

        Times ``t=`` scale with it; a ``wait`` lasts as long as it says.
        """
        return self.now.speed

    @speed.setter
    def speed(self, factor: float) -> None:
        self.go_at(factor)

    @command(moves=True, aside=True)
    def go_at(self, factor: float) -> None:
        """Go at another speed from the next line on; raises `NotAvailable`."""
        low, high = SPEEDS
        if not low <= factor <= high:
            raise NotAvailable(f"the speed factor lies between {low:g} and {high:g}: {factor!r}")
        with self._changed:
            self._run.change_speed(float(factor))

    @property
    def loops(self) -> int | None:
        """How many times it is run; None: until it is paused or cancelled."""
        return self.progress.loops

    @loops.setter
    def loops(self, loops: int | None) -> None:
        self.repeat(loops)

    @command(moves=True, aside=True)
    def repeat(self, loops: int | None) -> None:
        """Run it so many times; None: until it is paused or cancelled. Raises `NotAvailable`."""
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
            go there "straight" and together, or by a planned "detour".

        Raises
        ------
        NotAvailable
            It has ended or runs already, or another long operation is under way.
        AwayFromStartError
            Axes stand elsewhere, and `start` is "refuse"; nothing moved.
        """
        self.begin(present_mode(start), one_line=False)

    def step(self, start: StartMode = "refuse") -> None:
        """Carry out one line, then pause; raises as `resume`."""
        self.begin(present_mode(start), one_line=True)

    @command(at_once=True)
    def pause(self) -> None:
        """Pause when the line under way is over; harmless while it does not run."""
        with self._changed:
            self._control.pausing = True
            self._changed.notify_all()

    @command(at_once=True)
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
        if not self._wait_until(lambda: self.done, timeout_s):
            raise DeviceTimeout(f"the trajectory had not ended after {timeout_s:g} s")
        if (failure := self.failure) is not None:
            raise failure

    def wait_for_pause(self, timeout_s: float | None = None) -> bool:
        """Wait until nothing of it runs; False after `timeout_s` of wall time."""
        forbid_waiting_here("waiting for a trajectory")
        return self._wait_until(lambda: self.progress.state is not PlayState.RUNNING, timeout_s)

    def _wait_until(self, over: Callable[[], bool], timeout_s: float | None) -> bool:
        """Wait until something is so; raises `NotAvailable` where the station is away."""
        until_s = float("inf") if timeout_s is None else WALL.now_s() + timeout_s
        changed = Event()
        end = self.on_change(changed.set)
        try:
            while not over():
                if self.away:
                    raise NotAvailable(self.away)
                left_s = until_s - WALL.now_s()
                if left_s <= 0.0:
                    return False
                changed.wait(min(left_s, _LOOK_S))
                changed.clear()
        finally:
            end()
        return True

    @command(moves=True)
    def begin(self, start: StartMode = "refuse", *, one_line: bool = False) -> Task:
        """Begin, or go on, and return what ends with a pause, too; raises as `resume`."""
        start = "detour" if start == "way" else start  # as an older client says it
        if start not in START_MODES:
            raise NotAvailable(f"start is one of {', '.join(START_MODES)}, not {start!r}")
        with self._changed:
            if self._state not in _RESUMABLE:
                raise NotAvailable(f"{self.trajectory.name}: it is {self._state}")
            if start == "refuse":
                self._run.refuse_away()
            self._run.watch_stops()
            task = self._site.worker.begin(self.trajectory.name, self._play)
            control = self._control
            control.pausing, control.one_line, control.start = False, one_line, start
            self._failure, self._task = None, task
            self._set_state(PlayState.RUNNING)
        task.on_cancel(self._halt)
        task.add_callback(self._on_end)
        self._publish()
        return task

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
            self.note_change()

    # Last, for the name is that of a declaration as well

    @property
    def state(self) -> PlayState:
        """What it is at: ready, running, paused, failed, cancelled, ended."""
        return self.progress.state


class Players:
    """The players that were made last, by number; any thread."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._numbers = count(1)
        self._players: dict[str, TrajectoryPlayer] = {}
        self.changed: ChangeEvent[[]] = ChangeEvent()

    @property
    def newest(self) -> TrajectoryPlayer | None:
        """What was made last; None before that."""
        return next(reversed(self._players.values()), None)

    @property
    def by_number(self) -> Mapping[str, TrajectoryPlayer]:
        """Those that other programs can reach, the newest last."""
        return self._players

    def add(self, player: TrajectoryPlayer) -> str:
        """Keep a player and return its number.

        Raises
        ------
        NotAvailable
            Another trajectory is running.
        """
        with self._lock:
            running = self.newest
            if running is not None and running.state is PlayState.RUNNING:
                name = running.trajectory.name
                raise NotAvailable(f"{name} is running; pause or cancel it first")
            number = str(next(self._numbers))
            kept = list(self._players.items())[1 - MOST_PLAYERS :]
            self._players = {**dict(kept), number: player}
        self.changed.emit()
        return number


def text_of(trajectory: Trajectory) -> str:
    """Return a trajectory as text, with the lines of its file where it still says the same."""
    text = "\n".join([*trajectory.lines, ""])
    if trajectory.lines:
        try:
            same = reader.parse(text, cut_off=True).statements == trajectory.statements
        except TrajectoryError:
            same = False
        if same:
            return text
    return to_text(trajectory)
