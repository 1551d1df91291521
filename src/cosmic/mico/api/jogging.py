"""A continuous movement, as whoever holds the key sees it."""

from types import TracebackType
from typing import Self

from cosmic.mico.core.motion.device_commander import DeviceCommander
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import Order


class Jogging:
    """A continuous movement that goes on while it is renewed; made by `Axis.jog`.

    As a context manager it stops at the end of the block.
    """

    def __init__(self, order: Order, commander: DeviceCommander) -> None:
        self._order = order
        self._commander = commander

    @property
    def movement(self) -> Movement:
        """The movement; done when the axis stands."""
        return self._order.movement

    @property
    def done(self) -> bool:
        """True when it has ended: let go, at a limit, stopped or refused."""
        return self._order.movement.done

    def renew(self) -> None:
        """Keep it alive; call it at least every 0.1 s. Any thread."""
        self._commander.renew_jog(self._order)

    def end(self) -> None:
        """Let go: the axis stops at once."""
        if not self.done:
            self._commander.stop(self._order.channel, "jog ended")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.end()
