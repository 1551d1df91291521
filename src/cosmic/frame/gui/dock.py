"""A panel of the main window: moves, floats, scrolls, and can be shown as failed."""

from PySide6.QtCore import QSize, Qt, QTimer, Signal
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import (
    QDockWidget,
    QHBoxLayout,
    QLabel,
    QScrollArea,
    QSizePolicy,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from cosmic.frame.gui.build import named, push_button, tipped
from cosmic.frame.gui.screen_fit import FittedPanel, fit_to_screen
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.stop_button import StopButton
from cosmic.frame.gui.theme import STEP_PX, State, ui_font
from cosmic.frame.overrides import override


class _TitleBar(QWidget):
    """Title, buttons, and STOP while the panel is a window of its own."""

    def __init__(self, dock: QDockWidget, stop: StopButton) -> None:
        super().__init__(dock)
        self.setObjectName("dockTitle")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self._title = title = QLabel(dock.windowTitle())
        title.setFont(ui_font(bold=True))
        self.show_whole(False)
        self._float = _tool_button("❐", "Undock this panel, or dock it again")
        self._float.clicked.connect(self._on_float)
        hide = _tool_button("✕", "Hide this panel; the View menu brings it back")
        hide.clicked.connect(dock.close)
        self._dock = dock
        row = QHBoxLayout(self)
        row.setContentsMargins(STEP_PX, STEP_PX // 4, STEP_PX // 2, STEP_PX // 4)
        row.setSpacing(STEP_PX // 2)
        row.addWidget(title, 1)
        for button in (self._float, hide):
            row.addWidget(button)
        row.addWidget(stop)

    def show_whole(self, whole: bool) -> None:
        """Have room for all of the title, or be as narrow as the column."""
        policy = QSizePolicy.Policy.Minimum if whole else QSizePolicy.Policy.Ignored
        self._title.setSizePolicy(policy, QSizePolicy.Policy.Preferred)

    def _on_float(self) -> None:
        self._dock.setFloating(not self._dock.isFloating())


def _tool_button(text: str, tip: str) -> QToolButton:
    button = QToolButton()
    button.setText(text)
    button.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    return tipped(button, tip)


class _FailedBanner(QWidget):
    """Says that an application failed, why, and offers a rescan."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("failedBanner")
        self.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        self.reason = QLabel()
        self.reason.setWordWrap(True)
        self.reason.setTextFormat(Qt.TextFormat.PlainText)
        self.rescan = push_button("Rescan", "Rescan the devices and restart this application")
        row = QHBoxLayout(self)
        row.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        row.addWidget(StateBadge(State.ERROR))
        row.addWidget(self.reason, 1)
        row.addWidget(self.rescan)
        self.hide()


class PanelDock(QDockWidget):
    """Holds one panel.

    Parameters
    ----------
    title : str
        Stands in the title bar and the View menu, and names the dock in the saved layout.
    panel : QWidget
        The content.
    scroll : bool
        Scroll downwards only, at the width that the panel wants. Without it the panel is given
        all the room there is, and scrolls where that is less than it needs at least.
    stop_key : str
        Written on the STOP button that the dock has while it floats.
    """

    stop_requested = Signal()
    rescan_requested = Signal(str)

    def __init__(
        self,
        title: str,
        panel: QWidget,
        *,
        scroll: bool = True,
        stop_key: str = "F12",
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(title, parent)
        self.setObjectName(f"dock {title}")
        self._panel = panel
        self._stop = StopButton(stop_key)
        self._stop.hide()
        self._bar = _TitleBar(self, self._stop)
        self.setTitleBarWidget(self._bar)
        self._banner = _FailedBanner()
        body = named(QWidget(), "dockBody")
        body.setAttribute(Qt.WidgetAttribute.WA_StyledBackground)
        body.setFocusPolicy(Qt.FocusPolicy.ClickFocus)  # a click beside a field ends typing
        column = QVBoxLayout(body)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(self._banner)
        column.addWidget(_scrolled(panel) if scroll else FittedPanel(panel), 1)
        self.setWidget(body)
        self._stop.stop_requested.connect(self.stop_requested)
        self._banner.rescan.clicked.connect(self._on_rescan)
        self.topLevelChanged.connect(self._on_top_level_changed)

    @property
    def panel(self) -> QWidget:
        """The content."""
        return self._panel

    @property
    def failure(self) -> str:
        """Why the panel is greyed; empty when it is not."""
        return self._banner.reason.text()

    def set_failed(self, reason: str, *, rescan: bool = True) -> None:
        """Grey the panel, say why, and offer a rescan where that may help."""
        self._banner.reason.setText(reason)
        self._banner.rescan.setVisible(rescan)
        self._banner.show()
        self._panel.setEnabled(False)

    def clear_failed(self) -> None:
        """Let the panel be used again."""
        self._banner.reason.setText("")
        self._banner.hide()
        self._panel.setEnabled(True)

    def _on_top_level_changed(self, floats: bool) -> None:
        self._stop.setVisible(floats)
        self._bar.show_whole(floats)
        if floats:
            QTimer.singleShot(0, self, self._fit)

    def _fit(self) -> None:
        if not self.isFloating():
            return
        self.resize(self.size().expandedTo(self.sizeHint()))
        fit_to_screen(self)

    @override
    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        if self.isFloating():
            QTimer.singleShot(0, self, self._fit)

    def _on_rescan(self) -> None:
        self.rescan_requested.emit(self.windowTitle())


class _PanelScroll(QScrollArea):
    """Scrolls downwards; as wide as its panel wants, so that the fixed widths in it fit."""

    @override
    def sizeHint(self) -> QSize:
        panel: QWidget | None = self.widget()
        hint = panel.sizeHint() if panel is not None else super().sizeHint()
        return QSize(hint.width() + 2 * STEP_PX, hint.height())


def _scrolled(panel: QWidget) -> QScrollArea:
    area = named(_PanelScroll(), "dockScroll")
    area.setWidgetResizable(True)
    area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    area.setMinimumSize(20 * STEP_PX, 10 * STEP_PX)
    area.setWidget(panel)
    return area
