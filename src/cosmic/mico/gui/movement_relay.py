"""Brings the end of a movement from the device's thread to the window's."""

from PySide6.QtCore import QObject, Signal

from cosmic.mico.core.movement import Movement


class MovementRelay(QObject):
    """Says in its receiver's thread that a movement has ended.

    It has no parent and is kept alive by the movements it follows, so that one which ends after
    its card was closed meets no deleted object.

    Signals
    -------
    ended(Movement)
        Connect it to a method of a QObject, which then runs in that object's thread.
    """

    ended = Signal(object)

    def follow(self, movement: Movement) -> None:
        """Tell of the end of `movement`; any thread."""
        movement.add_callback(self._tell)

    def _tell(self, movement: Movement) -> None:
        self.ended.emit(movement)
