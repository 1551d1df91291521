"""Whether motion was stopped since something began, for what must not go on by itself."""

from collections.abc import Callable
from typing import Final

from cosmic.app.platform import Platform

RESET_SINCE: Final = "it was stopped, and the stop was reset since"


def stopped_since(platform: Platform) -> Callable[[], str | None]:
    """Return what tells why motion is or was stopped; None: never since it was asked first.

    A reset allows motion again, but what was stopped before it does not go on.
    """
    epoch: int | None = None

    def stopped() -> str | None:
        nonlocal epoch
        if platform.mico is None:
            return None
        state = platform.mico.manager.latch.state
        if epoch is None:
            epoch = state.epoch
        if state.reason is not None:
            return state.reason
        return RESET_SINCE if state.epoch != epoch else None

    return stopped
