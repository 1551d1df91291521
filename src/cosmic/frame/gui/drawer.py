"""The line at the bottom of a window, and what opens over the picture when it is pressed."""

from typing import Final

from PySide6.QtCore import QEvent, QObject, QRect, Qt, Signal
from PySide6.QtWidgets import (
    QHBoxLayout,
    QMainWindow,
    QSizePolicy,
    QStackedWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from cosmic.frame.gui.build import named, styled, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.overrides import override

LINE_PX: Final = 26
_SHARE: Final = 0.4
_LEAST_PX: Final = 22 * STEP_PX


class Drawer(QWidget):
    """One line of buttons; each opens its page over the picture, and never pushes it. GUI thread.

    A page with a focus proxy is typed into there at once; else letters meant for it would be the
    keys that jog axes. When it closes, the window has the focus.

    Parameters
    ----------
    window : QMainWindow
        Over whose middle the pages open.

    Signals
    -------
    opened(str)
        Another page is open; empty when it was closed.
    """

    opened = Signal(str)

    def __init__(self, window: QMainWindow) -> None:
        super().__init__(window)
        self.setObjectName("drawerLine")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.setFixedHeight(LINE_PX)
        self._window = window
        self._buttons: dict[str, QToolButton] = {}
        self._pages: dict[str, QWidget] = {}
        self._open = ""
        self.line = named(ElidedLabel(), "drawerText")
        self.line.set_dim(True)
        self._row = QHBoxLayout(self)
        self._row.setContentsMargins(STEP_PX, 1, STEP_PX, 1)
        self._row.setSpacing(STEP_PX // 2)
        self._row.addWidget(self.line, 1)
        self._body = named(QWidget(window), "drawerBody")
        self._body.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._stack = QStackedWidget()
        self._stack.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Ignored)
        column = QVBoxLayout(self._body)
        column.setContentsMargins(STEP_PX // 2, STEP_PX // 2, STEP_PX // 2, 0)
        column.addWidget(self._stack)
        self._body.hide()

    def add_page(self, title: str, page: QWidget, tip: str) -> None:
        """Add a page with its button."""
        button = styled(named(QToolButton(), "drawerButton"), "tool")
        button.setText(title)
        button.setCheckable(True)
        button.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        tipped(button, tip)
        button.clicked.connect(self._on_clicked)
        self._row.insertWidget(len(self._buttons), button)
        self._buttons[title] = button
        self._pages[title] = page
        self._stack.addWidget(page)

    @property
    def titles(self) -> tuple[str, ...]:
        """The pages, in order."""
        return tuple(self._pages)

    @property
    def open_page(self) -> str:
        """Title of the page that is open; empty when none is."""
        return self._open

    def button(self, title: str) -> QToolButton:
        """Return the button of a page."""
        return self._buttons[title]

    def show_page(self, title: str) -> None:
        """Open a page over the picture; empty closes the drawer."""
        self._open = title
        for name, button in self._buttons.items():
            button.setChecked(name == title)
        if title:
            self._stack.setCurrentWidget(self._pages[title])
            self._lay_over()
            # Only while it is open: every event of the window comes by, and waits for Python.
            self._window.installEventFilter(self)
            self._body.show()
            self._body.raise_()
            entry = self._pages[title].focusProxy()
            if entry is not None:
                entry.setFocus()
        else:
            focused = self._window.focusWidget()
            if focused is not None and self._body.isAncestorOf(focused):
                self._window.setFocus()  # Qt would give it to the next widget: Space presses it
            self._window.removeEventFilter(self)
            self._body.hide()
        self.opened.emit(title)

    def close_page(self) -> bool:
        """Close what is open; False where nothing is."""
        was_open = bool(self._open)
        if was_open:
            self.show_page("")
        return was_open

    def _on_clicked(self) -> None:
        title = next(name for name, each in self._buttons.items() if each is self.sender())
        self.show_page("" if self._open == title else title)

    def _lay_over(self) -> None:
        window = self._window
        top = self.mapTo(window, self.rect().topLeft()).y()
        height = min(max(_LEAST_PX, round(_SHARE * window.height())), max(_LEAST_PX, top - 100))
        self._body.setGeometry(QRect(0, top - height, window.width(), height))

    @override
    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if watched is self._window and event.type() == QEvent.Type.Resize:
            self._lay_over()
        elif watched is self._window and event.type() == QEvent.Type.LayoutRequest:
            self._body.raise_()  # panels that come, as with another workspace, come above it
        return super().eventFilter(watched, event)
