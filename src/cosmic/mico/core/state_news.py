"""What of the states of axes is news to those who listen."""

from collections.abc import Callable

from cosmic.mico.core.motion.messages import PositionChanged
from cosmic.mico.core.motion.positioner import PositionerState


class StateNews:
    """Tells states that differ from those told before; one thread at a time.

    Parameters
    ----------
    on_state, on_position : callable
        Told the new state, and the position after it where that is another one.
    """

    def __init__(
        self,
        on_state: Callable[[PositionerState], None],
        on_position: Callable[[PositionChanged], None],
    ) -> None:
        self._on_state = on_state
        self._on_position = on_position
        self._told: dict[str, PositionerState] = {}

    def tell(self, state: PositionerState) -> None:
        """Tell a state, unless all but the time of its reading was told already."""
        before = self._told.get(state.name)
        if before == state:  # whenever it was read
            return
        self._told[state.name] = state
        self._on_state(state)
        moved = before is None or before.position != state.position
        if moved and state.position is not None:
            self._on_position(PositionChanged(state.name, state.position, state.unit))
