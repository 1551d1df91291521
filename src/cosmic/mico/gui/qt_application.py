"""The program's `QApplication`, for widgets that follow all of its windows."""

from PySide6.QtCore import QCoreApplication
from PySide6.QtWidgets import QApplication


def qt_application() -> QApplication:
    """Return the one there is; raises `TypeError` in a program without windows."""
    app = QCoreApplication.instance()
    if not isinstance(app, QApplication):
        raise TypeError("widgets need a QApplication")
    return app
