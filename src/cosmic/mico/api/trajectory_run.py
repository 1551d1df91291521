"""A trajectory being carried out, line by line, in the application's thread."""

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from cosmic.frame.errors import MoveCancelled, refusal
from cosmic.frame.operation import Task
from cosmic.frame.verdict import Reason, refuse
from cosmic.mico.api.trajectory_moves import LegMover
from cosmic.mico.api.trajectory_site import TrajectorySite
from cosmic.mico.api.trajectory_start import StartPositions
from cosmic.mico.api.trajectory_state import PlayControl
from cosmic.mico.core.trajectory.binding import Bound, BoundLeg, BoundSpeed, BoundStep
from cosmic.mico.core.trajectory.model import Wait
from cosmic.mico.core.trajectory.rehearsal import Rehearsal

_LOOK_S: Final = 0.03
"""How often a wait looks, in wall time, whether it shall end."""


class TrajectoryRun:
    """Keeps how far a trajectory is, from one job to the next; one thread at a time."""

    def __init__(
        self, site: TrajectorySite, bound: Bound, control: PlayControl, source: str
    ) -> None:
        self._site = site
        self._bound = bound
        self._control = control
        self._clock = site.manager.clock
        self.mover = LegMover(site, source)
        self.start_positions = StartPositions(site, bound)
        self.rehearsal: Rehearsal | None = None
        self.next = 0
        self.loop = 1
        self.at_line = False
        self._remaining: dict[int, float] = {}
        # When the time of the trajectory was looked at, None while it stands, and what it was.
        self._mark: tuple[float | None, float] = (None, 0.0)
        self._waited_s = 0.0
        self._epoch = 0

    # How far it is

    @property
    def following(self) -> BoundStep | None:
        """What is carried out, or comes next; None behind the last line."""
        steps = self._bound.steps
        return steps[self.next] if self.next < len(steps) else None

    @property
    def begun(self) -> bool:
        """True after its first line."""
        return self.next > 0 or self.loop > 1

    @property
    def line(self) -> int:
        """Line of the file that is carried out, or comes next."""
        steps = self._bound.steps
        return steps[min(self.next, len(steps) - 1)].line if steps else 0

    @property
    def left_s(self) -> float | None:
        """How long this pass still takes; None before the rehearsal."""
        if self.rehearsal is None:
            return None
        if self.next == 0:
            return self.rehearsal.duration_s
        later = (step.line for step in self._bound.steps[self.next :])
        return next((self._remaining[line] for line in later if line in self._remaining), 0.0)

    def refuse_away(self) -> None:
        """Raise `AwayFromStartError` where axes do not stand where it begins or goes on."""
        wanted = self.start_positions.wanted(self.following, begun=self.begun)
        self.start_positions.refuse_away(wanted, begun=self.begun)

    def watch_stops(self) -> None:
        """Have every stop from now on end what is played next."""
        self._epoch = self._site.manager.latch.state.epoch

    def change_speed(self, factor: float) -> None:
        """Go on at another speed; any thread, under the control's lock."""
        if self._mark[0] is not None:
            self._run_from(self._time_s())
        self._control.speed = factor

    # Carrying out

    def play(self, task: Task, say: Callable[[str], None]) -> bool:
        """Carry out line after line; returns False when it was paused.

        Raises
        ------
        CosmicError
            What ended it.
        """
        self.at_line = False
        try:
            self._prepare(task, say)
            self._run_from(self._mark[1])
            while not self._pass(task, say):
                if self._control.pausing:
                    return False
                self._begin_again(task, say)
            return True
        finally:
            self._halt_at(self._time_s())
            self.mover.restore_speeds()

    def _prepare(self, task: Task, say: Callable[[str], None]) -> None:
        """Rehearse before the first movement, and go to where it begins."""
        if self.rehearsal is None:
            say("rehearsing")
            self.rehearsal = self._site.rehearse(
                self._bound,
                speed=self._control.speed,
                timed=self._control.timed,
                progress=lambda part, text: task.report(0.0, f"rehearsing {part:.0%}, {text}"),
                cancelled=lambda: task.cancel_requested,
            )
            self._remaining = dict(self.rehearsal.left_s)
        found = self.rehearsal
        if not found.allowed:
            text = f"line {found.line}: {found.verdict}"
            raise refusal(replace(found.verdict, text=text))
        control = self._control
        if not self.begun and control.loops != 1 and control.start == "refuse":
            self.start_positions.check_loop(found.end)
        self._go_to_place(task, say)

    def _go_to_place(self, task: Task, say: Callable[[str], None]) -> None:
        wanted = self.start_positions.wanted(self.following, begun=self.begun)
        if self.start_positions.stands(wanted):
            return
        if self._control.start == "refuse":
            self.start_positions.refuse_away(wanted, begun=self.begun)
        say("going to where it begins")
        for waypoint in self.start_positions.waypoints(wanted, self._control.start):
            self._look_for_stop(task)
            self.mover.go_to(waypoint, task)

    def _begin_again(self, task: Task, say: Callable[[str], None]) -> None:
        self._go_to_place(task, say)
        self._run_from(self._mark[1])

    def _pass(self, task: Task, say: Callable[[str], None]) -> bool:
        """Go on to the last line; returns True when that was the last pass."""
        control = self._control
        while (step := self.following) is not None:
            self.at_line = True
            self._look_for_stop(task)
            if control.pausing:
                return False
            say(self._line_text(step.line))
            if not self._carry_out(step, task):
                return False
            self.next += 1
            if control.one_line and not isinstance(step, BoundSpeed):
                control.pausing = True
        if control.loops is not None and self.loop >= control.loops:
            return True
        self.loop += 1
        self.next = 0
        self._halt_at(0.0)
        self.start_positions.begin_again()
        self.mover.begin_again()
        return False

    def _line_text(self, line: int) -> str:
        lines = self._bound.trajectory.lines
        said = lines[line - 1].strip() if 0 < line <= len(lines) else ""
        return f"line {line}: {said}" if said else f"line {line}"

    def _carry_out(self, step: BoundStep, task: Task) -> bool:
        """Return False when it was paused before its end."""
        match step:
            case BoundSpeed():
                self.mover.set_speed(step)
                return True
            case Wait():
                return self._wait_at(step.at_s, task) and self._wait_for(step.duration_s, task)
            case BoundLeg():
                if not self._wait_at(step.at_s, task):
                    return False
                self.mover.move(step, self._control.speed, task)
                self.start_positions.note(step)
                return True

    # Time

    def _time_s(self) -> float:
        """Return the time of the trajectory."""
        since_s, at_s = self._mark
        if since_s is None:
            return at_s
        return at_s + (self._clock.now_s() - since_s) * self._control.speed

    def _run_from(self, at_s: float) -> None:
        """Have the time of the trajectory go on from `at_s`."""
        with self._control.changed:
            self._mark = (self._clock.now_s(), at_s)

    def _halt_at(self, at_s: float) -> None:
        """Have it stand at `at_s`: a pause, a rehearsal and the path to its start take none."""
        with self._control.changed:
            self._mark = (None, at_s)

    def _wait_at(self, at_s: float | None, task: Task) -> bool:
        """Wait until the time of the trajectory is `at_s`."""
        if at_s is None or not self._control.timed:
            return True
        while (left_s := at_s - self._time_s()) > 0.0:
            if not self._sleep(left_s / self._control.speed, task):
                return False
        return True

    def _wait_for(self, duration_s: float, task: Task) -> bool:
        """Wait, or what is left of a wait that was interrupted."""
        began_s = self._clock.now_s() - self._waited_s
        while (left_s := began_s + duration_s - self._clock.now_s()) > 0.0:
            if not self._sleep(left_s, task):
                self._waited_s = self._clock.now_s() - began_s
                return False
        self._waited_s = 0.0
        return True

    def _sleep(self, duration_s: float, task: Task) -> bool:
        """Wait a moment; returns False for a pause, and raises for a stop."""
        look_s = _LOOK_S * self._clock.rate if self._clock.rate else duration_s
        with self._control.changed:
            self._look_for_stop(task)
            if self._control.pausing:
                return False
            until_s = self._clock.now_s() + min(duration_s, look_s)
            self._clock.wait(self._control.changed, until_s)
        return True

    def _look_for_stop(self, task: Task) -> None:
        """Raise for a stop, even one that was reset meanwhile, and for a cancelled task."""
        if task.cancel_requested:
            raise MoveCancelled("cancelled")
        stop = self._site.manager.latch.state
        if stop.latched or stop.epoch != self._epoch:
            text = f"stopped: {stop.reason or 'the stop was reset meanwhile'}"
            raise refusal(refuse(Reason.STOPPED, text))
