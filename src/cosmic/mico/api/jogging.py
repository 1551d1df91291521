"""`Jogging`: a continuous movement in the hands of whoever renews it."""

from collections.abc import Callable
from types import TracebackType
from typing import Self

from cosmic.frame.arguments import checked
from cosmic.mico.core.motion.movement import Movement


class Jogging:
    """A continuous movement that goes on while it is renewed; made by `Axis.jog` and `Axis.steer`.

    As a context manager it stops at the end of the block.

    Parameters
    ----------
    renew : callable
        Keeps it alive, at a signed speed; at the one it has with None.
    end : callable
        Stops it, with the reason.
    """

    def __init__(
        self,
        movement: Movement,
        renew: Callable[[float | None], object],
        end: Callable[[str], object],
    ) -> None:
        self._movement = movement
        self._renew = renew
        self._end = end

    @property
    def movement(self) -> Movement:
        """The movement; done when the axis stands."""
        return self._movement

    @property
    def done(self) -> bool:
        """True when it has ended: let go, at a limit, stopped or refused."""
        return self._movement.done

    @checked
    def renew(self, velocity: float | None = None) -> None:
        """Keep it alive; call it at least every 0.1 s. Any thread, and it does not wait.

        Parameters
        ----------
        velocity : float
            Signed speed from now on, of what `Axis.steer` began; None: as it is. At 0 an axis
            stands still, and of one without sensor the movement ends.
        """
        self._renew(velocity)

    def end(self, why: str = "jog ended") -> None:
        """Let go: the axis stops at once."""
        if not self.done:
            self._end(why)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.end()
