"""The control mode of a window: MCM, SCM, ECM with a collision model, or ACM (thesis 3.4)."""

import logging
from collections.abc import Mapping
from typing import Final

from PySide6.QtCore import QObject, QSettings, Signal

from cosmic.frame.gui.top_bar import NO_COLLISION_MODEL, TopBar

logger = logging.getLogger(__name__)

MCM: Final = "MCM"
SCM: Final = "SCM"
ECM: Final = "ECM"
ACM: Final = "ACM"
NO_MICO: Final = "nothing here moves"
NO_ACM: Final = "procedures need MiCo, DAQCo and ViCo, all in this program"
NO_ECM: Final = f"{NO_COLLISION_MODEL}; name a scene in the platform file"
_KEY: Final = "window/mode"


def blocked_modes(*, mico: bool, model: bool, campaigns: bool) -> dict[str, str]:
    """Return which modes cannot be chosen, and why.

    Parameters
    ----------
    mico, model : bool
        The window has axes, and a model of what they may collide with.
    campaigns : bool
        It has all that procedures need.
    """
    blocked = {} if mico else {SCM: NO_MICO}
    blocked |= {} if model else {ECM: NO_ECM}
    return blocked if campaigns else blocked | {ACM: NO_ACM}


class ControlMode(QObject):
    """Keeps the mode of one window, shows it and logs its changes; GUI thread.

    Parameters
    ----------
    bar : TopBar
        Where it is shown and chosen.
    settings : QSettings
        Where it is kept for the next start.
    blocked : mapping of str to str
        Modes that cannot be chosen, and why.

    Signals
    -------
    changed(str)
        Another mode is in force.
    """

    changed = Signal(str)

    def __init__(
        self,
        bar: TopBar,
        settings: QSettings,
        blocked: Mapping[str, str],
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self._bar = bar
        self._settings = settings
        self._mode = MCM
        self._available = tuple(mode for mode in (MCM, SCM, ECM, ACM) if mode not in blocked)
        for each in (SCM, ECM, ACM):
            bar.set_mode_available(each, blocked.get(each, ""))
        bar.mode_requested.connect(self.choose)

    @property
    def mode(self) -> str:
        """The mode in force."""
        return self._mode

    def restore(self) -> None:
        """Choose the mode of the last start, where it is to be had."""
        self.choose(str(self._settings.value(_KEY, MCM)))

    def choose(self, mode: str) -> None:
        """Put `mode` in force, if it can be chosen."""
        if mode not in self._available or mode == self._mode:
            return
        logger.info("control mode %s instead of %s", mode, self._mode)
        self._mode = mode
        self._settings.setValue(_KEY, mode)
        self._bar.set_mode(mode)
        self.changed.emit(mode)
