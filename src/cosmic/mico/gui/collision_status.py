"""What the window has to say loudly of the collision model: axes taken out, contacts allowed."""

from PySide6.QtCore import QObject, Signal

from cosmic.mico.api.ports import CollisionPort


class CollisionStatus(QObject):
    """Follows the collision model, whoever changes it; GUI thread.

    It has no parent: the subscription keeps it alive, so that a change made in another thread
    while the window closes meets no deleted object.

    Signals
    -------
    changed()
        Axes were taken out or in, or contacts allowed or forbidden, here or elsewhere.
    """

    changed = Signal()
    _told = Signal()

    def __init__(self, model: CollisionPort | None) -> None:
        super().__init__()
        self._model = model
        self._told.connect(self._on_told)
        if model is not None:
            model.subscribe(self._tell)

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

    def _tell(self) -> None:
        self._told.emit()  # in the thread of the change; Qt takes it to this object's own

    def _on_told(self) -> None:
        self.changed.emit()
