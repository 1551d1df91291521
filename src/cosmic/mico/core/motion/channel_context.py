"""What the channels of one device share: the library, the gate, and how they report."""

from dataclasses import dataclass, replace

from cosmic.frame.clock import Clock
from cosmic.frame.errors import CosmicError, refusal
from cosmic.frame.inbox import Inbox
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.core.motion.data_container import DeviceDataContainer
from cosmic.mico.core.motion.gate import Gate
from cosmic.mico.core.motion.gate_queue import GateQueue
from cosmic.mico.core.motion.messages import (
    DeviceSignals,
    Message,
    MovementBegun,
    MovementEnded,
    Order,
    PositionChanged,
)
from cosmic.mico.core.motion.positioner import PositionerState
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import Controller


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
