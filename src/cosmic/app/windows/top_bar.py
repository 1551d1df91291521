"""What the top bar shows of the platform: the control mode (thesis 3.4) and the clearance."""

import logging
from collections.abc import Mapping
from typing import Final

from PySide6.QtCore import QObject, QSettings, Signal

from cosmic.frame.gui.clearance_meter import Clearance
from cosmic.frame.gui.top_bar import MODE_WORDS, NO_COLLISION_MODEL, TopBar
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.gui.mico_widget import MicoWidget

logger = logging.getLogger(__name__)

NOT_REFERENCED: Final = "not referenced"


class CollisionBar(QObject):
    """Keeps clearance, axes taken out and contacts allowed in sight; GUI thread.

    Parameters
    ----------
    bar : TopBar
        Where they are shown.
    panel : MicoWidget
        Whose platform it is.
    """

    def __init__(self, bar: TopBar, panel: MicoWidget, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._bar = bar
        self._panel = panel
        self._application = panel.mico.application
        panel.collision.changed.connect(self._on_collision_changed)
        watch = self._application.clearance_watch
        if watch is not None:
            watch.changed.connect(self._on_clearance)  # its thread; queued to this one
            panel.refreshed.connect(self._on_refreshed)
        self._on_collision_changed()
        self._on_refreshed()

    def _on_collision_changed(self) -> None:
        self._bar.set_collision_model(present=self._panel.collision.has_model)
        self._bar.set_unwatched(self._panel.collision.unwatched)
        self._bar.set_contacts(self._panel.collision.contacts)

    def _on_refreshed(self) -> None:
        watch = self._application.clearance_watch
        self._on_clearance(watch.latest if watch is not None else None)

    def _on_clearance(self, nearest: Approach | None) -> None:
        if nearest is None:
            self._bar.set_clearance(None, self._why_unknown())
            return
        reading = Clearance(nearest.distance_um, nearest.bodies, nearest.margin_um)
        self._bar.set_clearance(reading)

    def _why_unknown(self) -> str:
        mico = self._panel.mico
        if not mico.ready:
            return "MiCo is not ready"
        if mico.positions() is None:
            return NOT_REFERENCED
        return "no answer yet, or no body is watched"


MCM: Final = "MCM"
SCM: Final = "SCM"
ECM: Final = "ECM"
ACM: Final = "ACM"
NO_MICO: Final = "this window has no axes"
NO_ACM: Final = "procedures need axes, force and cameras, all in this program"
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
        logger.info("control mode %s (was %s)", MODE_WORDS[mode], MODE_WORDS[self._mode])
        self._mode = mode
        self._settings.setValue(_KEY, mode)
        self._bar.set_mode(mode)
        self.changed.emit(mode)
