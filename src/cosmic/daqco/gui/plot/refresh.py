"""How often it makes sense to paint."""

from typing import Final

from PySide6.QtGui import QScreen

USUAL_HZ: Final = 60.0


def shown_rate_hz(wanted_hz: float, screen: QScreen | None) -> float:
    """Return `wanted_hz`, or what the screen can show; some screens do not know and say 0."""
    most = screen.refreshRate() if screen is not None else USUAL_HZ
    return min(wanted_hz, most if most > 1.0 else USUAL_HZ)
