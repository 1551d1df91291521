"""Brings what the collision model knows to the bar on top of the window."""

from typing import Final

from PySide6.QtCore import QObject

from cosmic.frame.gui.clearance_meter import Clearance
from cosmic.frame.gui.top_bar import TopBar
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.gui.mico_widget import MicoWidget

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
        manager = self._application.manager
        if not manager.ready:
            return "MiCo is not ready"
        if manager.positions() is None:
            return NOT_REFERENCED
        return "no answer yet, or nothing is watched"
