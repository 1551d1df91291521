"""What the window has to say loudly of the collision model: axes taken out, contacts allowed."""

from PySide6.QtCore import QObject, Signal

from cosmic.frame.gui.relay import Relay
from cosmic.mico.api.mico import Mico


class CollisionStatus(QObject):
    """Follows the collision model, whoever changes it; GUI thread.

    Signals
    -------
    changed()
        Axes were taken out or in, or contacts allowed or forbidden, here or elsewhere.
    """

    changed = Signal()

    def __init__(self, mico: Mico) -> None:
        super().__init__()
        self._mico = mico
        self._shown = self._now()
        self._relay = Relay(self._on_changed).follow(mico.on_change)

    def _now(self) -> tuple[object, ...]:
        return self.has_model, self.unwatched, self.contacts

    @property
    def has_model(self) -> bool:
        """Whether movements are checked for collisions at all."""
        return self._mico.checks_collisions

    @property
    def unwatched(self) -> tuple[str, ...]:
        """Axes that are taken out of collision detection, sorted."""
        return tuple(sorted(self._mico.taken_out))

    @property
    def contacts(self) -> tuple[str, ...]:
        """Contacts that are allowed at the moment, sorted."""
        return tuple(sorted(self._mico.allowed_contacts))

    def _on_changed(self) -> None:
        now = self._now()
        if now != self._shown:
            self._shown = now
            self.changed.emit()
