"""What the channels of one device share: the library, the way to the gate, and how they report."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Lock

from cosmic.frame.clock import Clock
from cosmic.frame.errors import CosmicError, refusal
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.inbox import Inbox
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.operation import Operation
from cosmic.frame.threads import JOIN_TIMEOUT_S
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.motion.data_container import DeviceDataContainer
from cosmic.mico.core.motion.gate import Gate, GateQuery
from cosmic.mico.core.motion.messages import (
    CheckedMove,
    DeviceSignals,
    GateAnswer,
    Message,
    MovementBegun,
    MovementEnded,
    OnChecked,
    Order,
    PositionChanged,
)
from cosmic.mico.core.motion.positioner import PositionerState
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import Controller

GateCheck = Callable[[GateQuery], CheckedMove]
"""Puts a query to the gate and waits for the answer; any thread."""


class GateQueue:
    """Asks the gate in a thread of its own, so that positions and dead men are looked at meanwhile.

    Device thread, unless said otherwise. The answers come back through the inbox of the device;
    each is worth something only if `take` says so.
    """

    def __init__(
        self, gate: Gate, *, clock: Clock, inbox: Inbox[Message], policy: FailurePolicy, device: int
    ) -> None:
        self._gate = gate
        self._inbox = inbox
        self._open: dict[int, tuple[Order, GateQuery]] = {}
        self._jobs = JobQueue(f"gate of device {device}", policy)
        self._waiting = clock.worker()
        self._intake = Lock()
        self._closed = False

    def start(self) -> None:
        """Start the thread, if one is needed; any thread."""
        if not self._gate.prompt:
            self._jobs.start()

    def request_end(self) -> None:
        """Ask the thread to end; any thread."""
        self._jobs.request_end()

    def join(self, timeout_s: float = JOIN_TIMEOUT_S) -> bool:
        """Wait for the end of the thread; any thread."""
        return self._jobs.join(timeout_s)

    @property
    def orders(self) -> list[Order]:
        """The orders that wait for the gate."""
        return [order for order, _ in self._open.values()]

    def ask(self, order: Order, check: GateCheck, on_checked: OnChecked) -> None:
        """Have `check` ask the gate, then `on_checked` called in the device thread."""
        query = GateQuery()
        if self._gate.prompt:
            on_checked(check(query))
            return
        self._open[order.number] = order, query
        self._waiting.busy()  # a fast clock waits for the answer

        def ask_gate() -> None:
            self._put(GateAnswer(check(query), on_checked))

        def on_end(ended: Operation[None]) -> None:
            if ended.failure is not None:
                text = f"the check of the movement failed: {ended.failure}"
                checked = CheckedMove(order, None, refuse(Reason.NO_ANSWER, text))
                self._put(GateAnswer(checked, on_checked))

        self._jobs.submit(ask_gate, f"check of order {order.number}").add_callback(on_end)

    def _put(self, answer: GateAnswer) -> None:
        """Hand an answer to the device thread; any thread."""
        with self._intake:
            running = not self._closed
            if running:
                self._inbox.put(answer)
        if not running:
            self._gate.withdraw(answer.checked.reservation)

    def take(self, answer: GateAnswer) -> bool:
        """Take an answer from the inbox; False where nobody waits for it any more."""
        return self._pop(answer.checked.order) is not None

    def withdraw(self, order: Order) -> None:
        """Have the gate hold nothing for an order that is not wanted any more."""
        query = self._pop(order)
        if query is not None:
            self._gate.withdraw_query(query)

    def fail_all(self, error: CosmicError) -> None:
        """Withdraw and fail all that wait; a reservation that still comes is released."""
        for order in self.orders:
            self.withdraw(order)
            order.movement.fail(error)

    def close_intake(self) -> None:
        """Put no answer into the inbox any more."""
        with self._intake:
            self._closed = True

    def close(self) -> None:
        """Let a fast clock wait for no answer any more."""
        self._waiting.close()

    def _pop(self, order: Order) -> GateQuery | None:
        _, query = self._open.pop(order.number, (order, None))
        if not self._open:
            self._waiting.idle()
        return query


class AxisReports:
    """Reports what happens to the axes of one device, by its signals; device thread."""

    def __init__(self, signals: DeviceSignals, container: DeviceDataContainer) -> None:
        self._signals = signals
        self._container = container
        self._shown: dict[int, PositionerState] = {}

    def begun(self, begun: MovementBegun) -> None:
        """Report a movement that was sent to the controller."""
        self._signals.movement_begun.emit(begun)

    def finished(self, name: str, position: float | None) -> None:
        """Report a movement that ended well."""
        self._signals.movement_ended.emit(MovementEnded(name, position, None))

    def failed(self, name: str, error: CosmicError) -> None:
        """Report a movement that ended badly."""
        self._signals.movement_ended.emit(MovementEnded(name, None, error))

    def refused(self, order: Order, verdict: MoveVerdict) -> None:
        """Fail an order that was refused, and report it; any thread."""
        order.movement.fail(refusal(verdict))
        self._signals.movement_refused.emit(verdict)

    def stopped_by_gate(self, verdict: MoveVerdict) -> None:
        """Report that a movement under way was refused to go on."""
        self._signals.movement_refused.emit(verdict)

    def state(self, channel: int) -> None:
        """Report the state of a channel where it differs from what was reported last."""
        state = self._container.state(channel)
        if state is None:
            return
        before = self._shown.get(channel)
        if before is not None and replace(before, read_wall_s=state.read_wall_s) == state:
            return
        self._shown[channel] = state
        self._signals.state_changed.emit(state)
        moved = before is None or before.position != state.position
        if moved and state.position is not None:
            changed = PositionChanged(state.name, state.position, state.unit)
            self._signals.position_changed.emit(changed)


@dataclass(slots=True)
class ChannelContext:
    """What the channels of one device share.

    Attributes
    ----------
    queries : GateQueue
        Asks the gate where that may take long.
    inbox : Inbox
        Queue of the device thread.
    poll_s : float
        How often the position of a moving axis is asked for, in wall seconds.
    """

    controller: Controller
    container: DeviceDataContainer
    gate: Gate
    clock: Clock
    settings: MicoSettings
    queries: GateQueue
    reports: AxisReports
    inbox: Inbox[Message]
    poll_s: float = 0.05
