"""What the window has to say loudly of the collision model: axes taken out, contacts allowed."""

from PySide6.QtCore import QObject, Signal

from cosmic.frame.gui.relay import Relay
from cosmic.mico.api.ports import CollisionPort


class CollisionStatus(QObject):
    """Follows the collision model, whoever changes it; GUI thread.

    Signals
    -------
    changed()
        Axes were taken out or in, or contacts allowed or forbidden, here or elsewhere.
    """

    changed = Signal()

    def __init__(self, model: CollisionPort | None) -> None:
        super().__init__()
        self._model = model
        self._relay = Relay(self._on_changed)
        if model is not None:
            self._relay.follow(model.subscribe)

    @property
    def has_model(self) -> bool:
        """Whether movements are checked for collisions at all."""
        return self._model is not None and self._model.available

    @property
    def unwatched(self) -> tuple[str, ...]:
        """Axes that are taken out of collision detection, sorted."""
        return () if self._model is None else tuple(sorted(self._model.taken_out))

    @property
    def contacts(self) -> tuple[str, ...]:
        """Contacts that are allowed at the moment, sorted."""
        return () if self._model is None else tuple(sorted(self._model.allowed_contacts))

    def _on_changed(self) -> None:
        self.changed.emit()
