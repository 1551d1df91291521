"""`PeripheralThread`: lens and light, each at the end of its line, in a thread of their own."""

import logging
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from threading import Condition
from typing import Final

from PySide6.QtCore import QObject, Signal
from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import CosmicError, MoveCancelled, NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.heartbeat import OPEN_S, Heartbeat
from cosmic.frame.network.caller import caller_dead_man
from cosmic.frame.operation import Task
from cosmic.frame.threads import WorkerThread
from cosmic.vico.core.lens_history import LensHistory
from cosmic.vico.core.lens_move import Move
from cosmic.vico.core.lens_side import IDLE_S, LensSide, LightSide
from cosmic.vico.hw.peripherals import Lens, LensAxis, LensState, Light

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class PeripheralState:
    """Lens and light as last heard.

    Attributes
    ----------
    time_s, wall_s : float
        Platform time and wall time of it.
    zoom, focus : LensState or None
        None while the lens cannot be asked.
    light_percent : float or None
        None while the lamp cannot be asked.
    lens_problem, light_problem : str
        Why not; empty when all is well.
    """

    time_s: float
    wall_s: float
    zoom: LensState | None = None
    focus: LensState | None = None
    light_percent: float | None = None
    lens_problem: str = ""
    light_problem: str = ""

    def axis(self, axis: LensAxis) -> LensState | None:
        """Return one of the motors."""
        return self.zoom if axis is LensAxis.ZOOM else self.focus

    @property
    def moving(self) -> bool:
        """A motor runs."""
        return any(each is not None and each.moving for each in (self.zoom, self.focus))


MOVING_S: Final = 0.05
"""Time between two looks while something moves; a line carries more, but not much.

Of the platform, or who waits for a motor on an accelerated twin waits so many times too long. What
changes on the way is told as often by the wall.
"""


@dataclass(frozen=True, slots=True)
class _Order:
    """What is to be done; `lasts`: its task ends later than it is carried out."""

    task: Task
    carry_out: Callable[[Task], None]
    of_light: bool = False
    lasts: bool = False


class PeripheralThread(WorkerThread):
    """Opens lens and light, carries out commands, and publishes what it hears.

    A lost line is told and left alone until `reopen`; lens and light fail each for itself.
    Closing stops what moves.

    Parameters
    ----------
    open_lens, open_light : callable
        Open the device; return None where the platform has none.
    timeout_s : float
        Platform time after which a movement has failed.

    Signals
    -------
    state_changed(PeripheralState)
        Something is different from before; at most 20 times a second.

    Attributes
    ----------
    history : LensHistory
        Where the motors were, and how bright it was, at moments past.
    heartbeat : Heartbeat
        Stays away while a call of a driver does not return.
    """

    may_wait = False

    state_changed = Signal(object)

    def __init__(
        self,
        open_lens: Callable[[], Lens | None],
        open_light: Callable[[], Light | None],
        clock: Clock,
        policy: FailurePolicy,
        *,
        timeout_s: float = 60.0,
        parent: QObject | None = None,
    ) -> None:
        super().__init__("lens and light", policy, parent)
        self.history = LensHistory()
        self._clock = clock
        self._timeout_s = timeout_s
        self._lens = LensSide(open_lens, clock, self.history)
        self._light = LightSide(open_light, clock, self.history)
        self._orders: deque[_Order] = deque()
        self._wake = Condition()
        self._abort_wanted = False
        self._over = False
        self._stall = ""
        self._running: tuple[Task, ...] = ()
        self.heartbeat = Heartbeat(self._on_stall)
        self._state = PeripheralState(clock.now_s(), WALL.now_s())
        self._published = self._state

    # What there is; any thread

    @property
    def state(self) -> PeripheralState:
        """What was last heard."""
        return self._state

    @property
    def lens_name(self) -> str:
        """What the operator reads; empty while there is none."""
        return self._lens.name

    @property
    def light_name(self) -> str:
        """What the operator reads; empty while there is none."""
        return self._light.name

    # Commands; any thread, all return at once

    def home(self, *axes: LensAxis) -> Task:
        """Begin to run motors, or both, to where counting begins."""
        return self._move("Homing the lens", dict.fromkeys(axes or tuple(LensAxis)))

    def seek(self, axis: LensAxis, target_counts: int) -> Task:
        """Begin to move a motor; its task fails with `NotAvailable` when it was not homed."""
        return self._move(f"Moving the {axis}", {axis: target_counts})

    def set_light(self, percent: float) -> Task:
        """Begin to make the light so bright; of several that wait the last counts."""
        with self._wake:
            replaced = [each for each in self._orders if each.of_light]
            self._orders = deque(each for each in self._orders if not each.of_light)
        for each in replaced:
            each.task.fail(MoveCancelled("replaced by a newer brightness"))
        task = Task("Setting the light")
        return self._put(_Order(task, lambda _: self._light.set_percent(percent), of_light=True))

    def reopen(self) -> Task:
        """Begin to open again what was lost."""

        def carry_out(_: Task) -> None:
            self._open()
            problems = [each for each in (self._lens.problem, self._light.problem) if each]
            if problems:
                raise NotAvailable("; ".join(problems))

        return self._put(_Order(Task("Connecting lens and light"), carry_out))

    def abort(self) -> None:
        """Stop both motors, ahead of everything that waits; movements that wait are cancelled."""
        with self._wake:
            self._abort_wanted = True
            dropped = [each for each in self._orders if not each.of_light]
            self._orders = deque(each for each in self._orders if each.of_light)
            self._wake.notify_all()
        for order in dropped:
            order.task.fail(MoveCancelled("aborted before it started"))

    def _move(self, title: str, targets: Mapping[LensAxis, int | None]) -> Task:
        dead_man = caller_dead_man()

        def carry_out(task: Task) -> None:
            self._lens.begin(Move(task, targets, self._clock, self._timeout_s, dead_man))

        task = self._put(_Order(Task(title), carry_out, lasts=True))
        task.on_cancel(self.abort)
        return task

    def _put(self, order: _Order) -> Task:
        with self._wake:
            refused = "lens and light are closed" if self._over else self._stall
            if not refused:
                self._orders.append(order)
                self._wake.notify_all()
        if refused:
            order.task.fail(NotAvailable(refused))
        return order.task

    def _on_stall(self, stalled_s: float) -> None:
        """Say that a driver hangs, or that it goes on; thread of the watch."""
        text = (
            f"lens and light: a driver has not returned from a call for {stalled_s:g} s; whether "
            "the lens moves is unknown. Unplug it and plug it in again, or restart the program"
        )
        with self._wake:
            self._stall = text if stalled_s else ""
            left = list(self._orders) if stalled_s else []
            self._orders = deque(each for each in self._orders if each not in left)
        if not stalled_s:
            logger.warning("lens and light: the driver has returned, and goes on")
            return
        logger.error("%s", text)
        error = NotAvailable(text)
        for task in (*(each.task for each in left), *self._lens.tasks, *self._running):
            task.fail(error)
        self._state = self._published = PeripheralState(
            self._clock.now_s(), WALL.now_s(), lens_problem=text, light_problem=text
        )
        self.state_changed.emit(self._state)

    @override
    def request_end(self) -> None:
        super().request_end()
        with self._wake:
            self._wake.notify_all()

    # In its own thread

    @override
    def run_body(self) -> None:
        try:
            self._open()
            while not self.end_requested:
                self.heartbeat.beat()
                self._publish()
                self._rest()
                self._obey()
                self._lens.look()
                self._light.look()
        finally:
            self._close()
            self.heartbeat.end()

    def _open(self) -> None:
        self.heartbeat.beat(OPEN_S)
        self._lens.open()
        self._light.open()
        self._lens.look()
        self._light.look()

    def _rest(self) -> None:
        with self._wake:
            if self._orders or self._abort_wanted or self.end_requested:
                return
            if self._lens.busy and self._clock.rate > 1.0:
                self._clock.wait(self._wake, self._clock.now_s() + MOVING_S)
            else:
                self._wake.wait(MOVING_S if self._lens.busy else IDLE_S)

    def _obey(self) -> None:
        while not self.end_requested:
            with self._wake:
                abort, self._abort_wanted = self._abort_wanted, False
                order = self._orders.popleft() if self._orders and not abort else None
            if abort:
                self._lens.abort()
            elif order is None:
                return
            elif not order.task.done:
                self._carry_out(order)

    def _carry_out(self, order: _Order) -> None:
        self.heartbeat.beat()
        self._running = (order.task,)
        try:
            order.carry_out(order.task)
        except CosmicError as exc:
            self._publish()  # whoever hears of the end sees how things are
            order.task.fail(exc)
        else:
            if not order.lasts:
                self._publish()
                order.task.finish()

    def _publish(self) -> None:
        before = self._published
        lens, light = self._lens, self._light
        now = PeripheralState(
            time_s=self._clock.now_s(),
            wall_s=WALL.now_s(),
            zoom=lens.states.get(LensAxis.ZOOM),
            focus=lens.states.get(LensAxis.FOCUS),
            light_percent=light.percent,
            lens_problem=lens.problem,
            light_problem=light.problem,
        )
        self._state = now
        same_time = replace(now, time_s=before.time_s, wall_s=before.wall_s)
        if same_time != before and not self._only_travels(before, now):
            self._published = now
            self.state_changed.emit(now)
        lens.publish_ends()

    def _only_travels(self, before: PeripheralState, now: PeripheralState) -> bool:
        """Return whether motors go on as told just before; a fast twin is looked at more often."""
        if not (self._clock.rate > 1.0 and before.moving and now.moving):
            return False
        same = replace(now, time_s=before.time_s, wall_s=before.wall_s)
        same = replace(same, zoom=before.zoom, focus=before.focus)
        return same == before and now.wall_s - before.wall_s < MOVING_S

    def _close(self) -> None:
        with self._wake:
            self._over = True
            left, self._orders = list(self._orders), deque()
        for order in left:
            order.task.fail(NotAvailable("lens and light are closed"))
        self._lens.close()
        self._light.close()
        self._lens.publish_ends()
