"""`TrajectoryPlayer`: makes the movements of a trajectory, line by line, through the gate (SCM)."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from threading import Condition, RLock
from typing import Final, Literal

from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    DeviceTimeout,
    MoveCancelled,
    MoveRefused,
    NotAvailable,
    refusal,
)
from cosmic.frame.listeners import tell
from cosmic.frame.task import Task
from cosmic.frame.threads import forbid_waiting_here
from cosmic.frame.units import format_quantity
from cosmic.frame.verdict import Reason, refuse
from cosmic.mico.api.group import GroupMovement
from cosmic.mico.api.trajectory_site import TrajectorySite
from cosmic.mico.core.orders import Motion, MoveTo, Step
from cosmic.mico.core.trajectory.binding import Bound, BoundLeg, BoundSpeed
from cosmic.mico.core.trajectory.model import Trajectory, Wait
from cosmic.mico.core.trajectory.rehearsal import Rehearsal
from cosmic.mico.core.trajectory.timing import scaled_hz

logger = logging.getLogger(__name__)

StartMode = Literal["refuse", "straight", "way"]
START_MODES: Final = ("refuse", "straight", "way")
SPEEDS: Final = (0.01, 10.0)
WAY_BUDGET_S: Final = 2.0
_LOOK_S: Final = 0.03
"""How often a wait looks, in wall time, whether it shall end."""
_SLACK: Final = 2.0
"""How many tolerances an axis may stand away from where a line left it."""


class PlayState(StrEnum):
    """What a player is at."""

    READY = "ready"
    RUNNING = "running"
    PAUSED = "paused"
    FAILED = "failed"
    CANCELLED = "cancelled"
    ENDED = "ended"


class AwayFromStartError(NotAvailable):
    """Axes do not stand where a trajectory begins or goes on; the text says which and how far.

    Attributes
    ----------
    targets : mapping of float
        Where they should stand, in gate coordinates.
    """

    def __init__(self, text: str, targets: Mapping[str, float]) -> None:
        super().__init__(text)
        self.targets = dict(targets)


@dataclass(frozen=True, slots=True)
class PlayProgress:
    """How far a player is.

    Attributes
    ----------
    line : int
        Line of the file that is being carried out, or comes next; 0 before the first.
    fraction : float
        Of this pass, 0 to 1, by time.
    left_s : float or None
        How long this pass still takes, without pauses; None before the rehearsal.
    loop, loops : int, int or None
        Which pass this is, and of how many; None: until it is paused or cancelled.
    error : str
        Why it stopped, empty while nothing went wrong.
    """

    state: PlayState
    line: int
    text: str
    fraction: float
    left_s: float | None
    loop: int
    loops: int | None
    error: str


class TrajectoryPlayer:
    """Makes the movements of one trajectory; any thread, and every method returns at once.

    The gate decides each line when its turn comes. A stop, a refusal or a failure ends it at a
    line; `resume` goes on there once the reason is gone. Between two lines nothing of it runs,
    so that a platform can be repaired, initialised or moved during a pause.
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
        rehearsal: Rehearsal | None = None,
    ) -> None:
        self._site = site
        self._manager = site.manager
        self._bound = bound
        self._source = source
        self._guard = RLock()
        self._changed = Condition(self._guard)
        self._telling = RLock()
        self._listeners: tuple[Callable[[PlayProgress], None], ...] = ()
        self._state = PlayState.READY
        self._failure: CosmicError | None = None
        self._task: Task | None = None
        self._group: GroupMovement | None = None
        self._rehearsal = rehearsal
        self._remaining = dict(rehearsal.left_s) if rehearsal is not None else {}
        self._timed = timed
        self._speed = 1.0
        self._loops: int | None = 1
        self._loop = 1
        self._next = 0
        self._text = ""
        self._pausing = False
        self._one_line = False
        self._start_mode: StartMode = "refuse"
        self._expected: dict[str, float] = {
            axis: bound.start[axis] for axis in bound.trajectory.start if axis in bound.start
        }
        self._usual: dict[str, int] = {}
        self._wanted: dict[str, int | None] = {}
        self._sent: dict[str, int] = {}
        self._counted: dict[str, float] = {}
        self._mark = (0.0, 0.0)
        self._waited_s = 0.0
        self._elapsed_s = 0.0
        self.speed = speed
        self.loops = loops

    # What it is at

    @property
    def trajectory(self) -> Trajectory:
        """What it plays."""
        return self._bound.trajectory

    @property
    def rehearsal(self) -> Rehearsal | None:
        """What was found before the first movement; None before that."""
        return self._rehearsal

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
        steps = self._bound.steps
        if self._state is PlayState.READY or not steps:
            return 0
        return steps[min(self._next, len(steps) - 1)].line

    @property
    def left_s(self) -> float | None:
        """How long this pass still takes, without pauses; None before the rehearsal."""
        rehearsal = self._rehearsal
        if rehearsal is None:
            return None
        if self._state is PlayState.ENDED or self._next >= len(self._bound.steps):
            return 0.0
        for step in self._bound.steps[self._next :]:
            if step.line in self._remaining:
                return self._remaining[step.line]
        return 0.0

    @property
    def progress(self) -> PlayProgress:
        """How far it is."""
        left_s, whole_s = self.left_s, self._rehearsal.duration_s if self._rehearsal else 0.0
        share = 1.0 - left_s / whole_s if left_s is not None and whole_s > 0.0 else 0.0
        return PlayProgress(
            state=self._state,
            line=self.line,
            text=self._text,
            fraction=1.0 if self._state is PlayState.ENDED else share,
            left_s=left_s,
            loop=self._loop,
            loops=self._loops,
            error=str(self._failure) if self._failure else "",
        )

    def subscribe(self, listener: Callable[[PlayProgress], None]) -> None:
        """Call `listener(progress)` at each line and change, in the thread that makes it."""
        with self._telling:
            self._listeners = (*self._listeners, listener)
            tell([listener], self.progress)

    # How it goes

    @property
    def speed(self) -> float:
        """How fast it goes, 0.01 to 10 times as written; holds from the next line on.

        Times ``t=`` scale with it; a ``wait`` lasts as long as it says.
        """
        return self._speed

    @speed.setter
    def speed(self, factor: float) -> None:
        low, high = SPEEDS
        if not low <= factor <= high:
            raise NotAvailable(f"the speed factor lies between {low:g} and {high:g}: {factor!r}")
        with self._guard:
            self._mark = (self._manager.clock.now_s(), self._time_s())
            self._speed = float(factor)

    @property
    def loops(self) -> int | None:
        """How many times it is run; None: until it is paused or cancelled."""
        return self._loops

    @loops.setter
    def loops(self, loops: int | None) -> None:
        if loops is not None and not loops >= 1:
            raise NotAvailable(f"a trajectory is run once or more, not {loops!r} times")
        self._loops = loops

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
            self._pausing = True
            self._changed.notify_all()

    def cancel(self) -> None:
        """End it now and stop its axes; nothing is latched."""
        with self._changed:
            task = self._task
            if self._state in (PlayState.READY, PlayState.PAUSED, PlayState.FAILED):
                self._set_state(PlayState.CANCELLED)
        if task is not None:
            task.cancel()
        self._tell()

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
            if self._state not in (PlayState.READY, PlayState.PAUSED, PlayState.FAILED):
                raise NotAvailable(f"{self.trajectory.name}: it is {self._state}")
            if start == "refuse":
                self._refuse_away()
            task = self._site.worker.begin(self.trajectory.name, self._play)
            self._pausing, self._one_line, self._start_mode = False, one_line, start
            self._failure, self._task = None, task
            self._set_state(PlayState.RUNNING)
            task.on_cancel(self._halt)
        self._tell()

    # In the application's thread

    def _play(self, task: Task) -> None:
        with self._guard:  # whoever began it has noted everything then
            self._sent = {}
            clock_s = self._manager.clock.now_s()
            self._mark = (clock_s, self._mark[1] if self._next else 0.0)
        try:
            self._prepare(task)
            ended = self._run(task)
        except CosmicError as exc:
            self._fail(task, exc)
        except BaseException as exc:
            self._fail(task, CosmicError(f"line {self.line}: {exc!r}"))
            raise
        else:
            self._leave(task, PlayState.ENDED if ended else PlayState.PAUSED)

    def _prepare(self, task: Task) -> None:
        """Rehearse before the first movement, and go to where it begins."""
        if self._rehearsal is None:
            self._say(task, "rehearsing")
            self._rehearsal = self._site.rehearse(
                self._bound,
                speed=self._speed,
                timed=self._timed,
                progress=lambda part, text: task.report(0.0, f"rehearsing {part:.0%}, {text}"),
                cancelled=lambda: task.cancel_requested,
            )
            self._remaining = dict(self._rehearsal.left_s)
        found = self._rehearsal
        if not found.allowed:
            verdict = found.verdict
            raise refusal(replace(verdict, text=f"line {found.line}: {verdict}"))
        if self._next == 0 and self._loop == 1:
            self._check_loop(found)
        self._go_to_expected(task)

    def _check_loop(self, found: Rehearsal) -> None:
        """See that a loop closes before it is begun."""
        if self._loops == 1 or self._start_mode != "refuse":
            return
        away = self._away(self._home(), found.end)
        if away:
            raise AwayFromStartError(
                f"it does not end where it begins ({', '.join(away)}), so it cannot be looped; "
                "run it with start='straight' or start='way' to go back each time",
                self._home(),
            )

    def _home(self) -> dict[str, float]:
        start, axes = self._bound.start, self.trajectory.axes
        sensed = self._site.facts().axes
        return {
            axis: start[axis]
            for axis in axes
            if axis in start and axis in sensed and sensed[axis].has_sensor
        }

    def _run(self, task: Task) -> bool:
        """Carry out line after line; returns False when it was paused."""
        steps = self._bound.steps
        while True:
            while self._next < len(steps):
                step = steps[self._next]
                if task.cancel_requested:
                    raise MoveCancelled("cancelled")
                if self._pausing:
                    return False
                self._say(task, self._line_text(step.line))
                if not self._carry_out(step, task):
                    return False
                self._next += 1
                if self._one_line and not isinstance(step, BoundSpeed):
                    self._pausing = True
            if self._loops is not None and self._loop >= self._loops:
                return True
            self._loop += 1
            self._next = 0
            self._mark = (self._manager.clock.now_s(), 0.0)
            self._expected |= self._home()
            if self._pausing:
                return False
            self._go_to_expected(task)

    def _line_text(self, line: int) -> str:
        lines = self.trajectory.lines
        said = lines[line - 1].strip() if 0 < line <= len(lines) else ""
        return f"line {line}: {said}" if said else f"line {line}"

    def _carry_out(self, step: BoundLeg | BoundSpeed | Wait, task: Task) -> bool:
        """Return False when it was paused before the end of a wait."""
        match step:
            case BoundSpeed():
                self._wanted[step.axis] = step.frequency_hz
                return True
            case Wait():
                if not self._wait_at(step.at_s, task):
                    return False
                if not self._wait_for(step.duration_s - self._waited_s, task):
                    return False
                self._waited_s = 0.0
                return True
            case BoundLeg():
                if not self._wait_at(step.at_s, task):
                    return False
                self._move(step, task)
                return True

    def _move(self, leg: BoundLeg, task: Task) -> None:
        motions = {
            axis: found
            for axis, motion in leg.motions.items()
            if (found := self._left_to_do(axis, motion)) is not None
        }
        for axis, motion in motions.items():
            if isinstance(motion, MoveTo):
                self._set_frequency(axis)
            elif isinstance(motion, Step):
                motions[axis] = replace(
                    motion, frequency_hz=scaled_hz(motion.frequency_hz, self._speed)
                )
                self._counted.setdefault(axis, self._manager.state(axis).position or 0.0)
        if motions:
            self._go(motions, task)
        self._counted.clear()
        for axis, motion in leg.motions.items():
            if isinstance(motion, MoveTo):
                self._expected[axis] = motion.target
            else:
                self._expected.pop(axis, None)

    def _left_to_do(self, axis: str, motion: Motion) -> Motion | None:
        """Return what is left of steps that were cut short; positions are simply gone to again."""
        before = self._counted.get(axis)
        if before is None or not isinstance(motion, Step):
            return motion
        each = self._site.step_um(axis) * motion.amplitude_v / 100.0
        made = round(((self._manager.state(axis).position or 0.0) - before) / each)
        left = motion.steps - made
        self._counted.pop(axis)
        return replace(motion, steps=left) if left * motion.steps > 0 else None

    def _go(self, motions: Mapping[str, Motion], task: Task) -> None:
        """Start movements together and wait for all; the failure of one stops the others."""
        orders = self._manager.order_together(motions, source=self._source)
        group = GroupMovement({name: order.movement for name, order in orders.items()})
        with self._guard:
            self._group = group
        if task.cancel_requested:
            group.cancel()
        try:
            group.wait()
        except CosmicError as exc:
            raise self._blamed(group, exc) from exc
        finally:
            with self._guard:
                self._group = None

    def _blamed(self, group: GroupMovement, error: CosmicError) -> CosmicError:
        """Return what ended a group, with the device where one is to blame."""
        for name, movement in group.movements.items():
            found = movement.exception(None)
            if isinstance(found, DeviceError):
                text = f"{found} (device {self._manager.address(name).device})"
                return DeviceError(text, fault=found.fault)
        return error

    def _halt(self) -> None:
        """Stop what is under way; any thread."""
        with self._changed:
            group = self._group
            self._changed.notify_all()
        if group is not None:
            group.cancel()

    # Speeds

    def _set_frequency(self, axis: str) -> None:
        usual = self._usual.setdefault(axis, self._site.frequency_hz(axis))
        hertz = scaled_hz(self._wanted.get(axis) or usual, self._speed)
        if hertz != self._sent.get(axis, usual):
            self._send_frequency(axis, hertz)

    def _send_frequency(self, axis: str, hertz: int) -> None:
        channel = self._manager.address(axis).channel
        self._manager.device(axis).set_frequency(channel, hertz)
        self._sent[axis] = hertz

    def _restore_frequencies(self) -> None:
        for axis, hertz in self._sent.items():
            if axis in self._usual and hertz != self._usual[axis]:
                self._send_frequency(axis, self._usual[axis])
        self._usual.clear()

    # Time

    def _time_s(self) -> float:
        """Return the time of the trajectory."""
        since_s, at_s = self._mark
        return at_s + (self._manager.clock.now_s() - since_s) * self._speed

    def _wait_at(self, at_s: float | None, task: Task) -> bool:
        """Wait until the time of the trajectory is `at_s`."""
        if at_s is None or not self._timed:
            return True
        while (left_s := at_s - self._time_s()) > 0.0:
            if not self._sleep(left_s / self._speed, task):
                return False
        return True

    def _wait_for(self, duration_s: float, task: Task) -> bool:
        clock = self._manager.clock
        began_s = clock.now_s()
        while (left_s := began_s + duration_s - clock.now_s()) > 0.0:
            if not self._sleep(left_s, task):
                self._waited_s += clock.now_s() - began_s
                return False
        return True

    def _sleep(self, duration_s: float, task: Task) -> bool:
        """Wait a moment; returns False for a pause, and raises for a stop."""
        if task.cancel_requested:
            raise MoveCancelled("cancelled")
        stop = self._manager.latch.state
        if stop.latched:
            text = f"stopped: {stop.reason}"
            raise refusal(refuse(Reason.STOPPED, text))
        if self._pausing:
            return False
        clock = self._manager.clock
        look_s = _LOOK_S * clock.rate if clock.rate else duration_s
        with self._changed:
            clock.wait(self._changed, clock.now_s() + min(duration_s, look_s))
        return True

    # Where it begins

    def _away(self, wanted: Mapping[str, float], stands: Mapping[str, float]) -> list[str]:
        """Return which axes stand elsewhere, in words."""
        watch = self._manager.settings.watch
        words = []
        for axis, target in wanted.items():
            state = self._manager.state(axis)
            slack = _SLACK * (watch.tolerance_deg if state.unit == "deg" else watch.tolerance_um)
            position = stands.get(axis)
            if position is None or not abs(position - target) <= slack:
                where = "somewhere" if position is None else format_quantity(position, state.unit)
                words.append(f"{axis} at {where} instead of {format_quantity(target, state.unit)}")
        return words

    def _targets_now(self) -> dict[str, float]:
        """Return where axes should stand that the next line does not send anywhere itself."""
        steps = self._bound.steps
        step = steps[self._next] if self._next < len(steps) else None
        own = step.motions if isinstance(step, BoundLeg) and self._next else {}
        return {axis: value for axis, value in self._expected.items() if axis not in own}

    def _refuse_away(self) -> None:
        wanted = self._targets_now()
        away = self._away(wanted, self._site.positions())
        if away:
            begins = "goes on" if self._next or self._loop > 1 else "begins"
            raise AwayFromStartError(
                f"the axes do not stand where it {begins}: {', '.join(away)}; go there first, or "
                "run it with start='straight' or start='way'",
                wanted,
            )

    def _go_to_expected(self, task: Task) -> None:
        wanted = self._targets_now()
        stands = self._site.positions()
        if not self._away(wanted, stands):
            return
        if self._start_mode == "refuse":
            self._refuse_away()
        self._say(task, "going to where it begins")
        for waypoint in self._waypoints(wanted):
            motions: dict[str, Motion] = {
                axis: MoveTo(target, self._manager.state(axis).unit)
                for axis, target in waypoint.items()
            }
            if task.cancel_requested:
                raise MoveCancelled("cancelled")
            self._go(motions, task)

    def _waypoints(self, wanted: Mapping[str, float]) -> tuple[Mapping[str, float], ...]:
        if self._start_mode == "straight" or self._site.worker.collision is None:
            return (wanted,)
        return self._site.worker.find_way(wanted, WAY_BUDGET_S).waypoints

    # Ends

    def _fail(self, task: Task, error: CosmicError) -> None:
        cancelled = isinstance(error, MoveCancelled) and task.cancel_requested
        found = error if cancelled or not self._begun() else _at_line(error, self.line)
        with self._guard:
            self._failure = found
        self._leave(task, PlayState.CANCELLED if cancelled else PlayState.FAILED)

    def _begun(self) -> bool:
        return self._text.startswith("line ")

    def _leave(self, task: Task, state: PlayState) -> None:
        self._mark = (self._manager.clock.now_s(), self._time_s())
        try:
            self._restore_frequencies()
        except CosmicError as exc:
            logger.warning("speeds were not restored: %s", exc)
        failure = self._failure
        if failure is not None:
            task.fail(failure)
        else:
            task.finish()
        with self._changed:
            self._set_state(state)
        self._tell()

    def _set_state(self, state: PlayState) -> None:
        self._state = state
        self._changed.notify_all()

    def _say(self, task: Task, text: str) -> None:
        self._text = text
        task.report(self.progress.fraction, text)
        self._tell()

    def _tell(self) -> None:
        with self._telling:
            tell(self._listeners, self.progress)


def _at_line(error: CosmicError, line: int) -> CosmicError:
    """Return `error` with the line at which it happened."""
    text = f"line {line}: {error}"
    match error:
        case MoveRefused():
            return refusal(replace(error.verdict, text=text))
        case AwayFromStartError():
            return AwayFromStartError(text, error.targets)
        case DeviceError():
            return DeviceError(text, fault=error.fault)
        case MoveCancelled():
            return MoveCancelled(text)
        case _:
            return CosmicError(text)
