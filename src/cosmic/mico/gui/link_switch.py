"""The part of a card that links its axis with another one, and says so (MiCoCL.3, MiCoCL.12)."""

from collections.abc import Mapping, Sequence

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QHideEvent
from PySide6.QtWidgets import (
    QComboBox,
    QFormLayout,
    QHBoxLayout,
    QLabel,
    QLineEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from cosmic.frame.gui.build import named, push_button, styled, tipped
from cosmic.frame.gui.theme import STEP_PX, State, state_look
from cosmic.frame.overrides import override
from cosmic.mico.gui.overlay import Overlay

OFF_TIP = "moves on its own; press to link it with another axis"


class LinkSwitch(QPushButton):
    """Says "Link off" or "Link on"; asks with which axis and how far, and unlinks at once.

    Parameters
    ----------
    axis : str
        Name of the axis.

    Signals
    -------
    opened()
        The operator wants to link: `offer` says with what.
    link_wanted(str, float)
        Link it with that axis, which goes so far when this one goes 1.
    unlink_wanted()
        Link it with none.
    """

    opened = Signal()
    link_wanted = Signal(str, float)
    unlink_wanted = Signal()

    def __init__(self, axis: str, parent: QWidget | None = None) -> None:
        super().__init__("Link off", parent)
        self._axis = axis
        self._linked: dict[str, float] = {}
        styled(self, "narrow")
        self.setFixedWidth(self.fontMetrics().horizontalAdvance("Link off") + 2 * STEP_PX + 2)
        self.setFocusPolicy(Qt.FocusPolicy.TabFocus)
        self.indicator = QLabel("○")
        self.indicator.setFixedWidth(self.indicator.fontMetrics().horizontalAdvance("●") + 2)
        self.clicked.connect(self._on_clicked)
        self.show_links({})

    @property
    def form(self) -> "LinkForm | None":
        """The form that is open in this window, if it is about this axis."""
        found = self.window().findChild(LinkForm, options=Qt.FindChildOption.FindDirectChildrenOnly)
        return found if isinstance(found, LinkForm) and found.anchor is self else None

    def show_links(self, linked: Mapping[str, float]) -> None:
        """Show what the axis is linked with: how far each goes when it goes 1."""
        self._linked = dict(linked)
        on = bool(linked)
        others = ", ".join(f"{name} (× {ratio:g})" for name, ratio in linked.items())
        self.setText("Link on" if on else "Link off")
        self.setAccessibleName(f"{self._axis} link {'on' if on else 'off'}")
        with_what = f"{self._axis} moves with {others}"
        self.setToolTip(f"{with_what}; press to unlink" if on else f"{self._axis} {OFF_TIP}")
        self.indicator.setText("●" if on else "○")
        self.indicator.setAccessibleName(f"linked with {others}" if on else "not linked")
        tipped(self.indicator, with_what if on else f"{self._axis} is not linked with another axis")

    def _on_clicked(self) -> None:
        if self._linked:
            self.unlink_wanted.emit()
        elif self.form is not None:
            self.form.close()
        else:
            self.opened.emit()

    def offer(self, axes: Sequence[str]) -> None:
        """Ask with which of `axes` to link."""
        form = LinkForm(self._axis, axes, self)
        form.agreed.connect(self.link_wanted)
        form.open_below(form.other)

    @override
    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        if self.form is not None:
            self.form.close()


class LinkForm(Overlay):
    """Asks with which axis to link, and how far that goes.

    Signals
    -------
    agreed(str, float)
        Link.
    """

    agreed = Signal(str, float)

    def __init__(self, axis: str, others: Sequence[str], switch: LinkSwitch) -> None:
        super().__init__(switch)
        self.setObjectName("linkForm")
        self.other = named(QComboBox(), "linkOther")
        self.other.addItems(list(others))
        self.ratio = named(QLineEdit("1"), "linkRatio")
        self.ratio.setAccessibleName(f"How far the other axis goes when {axis} goes 1")
        tipped(
            self.ratio,
            f"Travel of the other axis when {axis} moves by 1; negative: reversed",
        )
        self._why = named(QLabel(""), "linkWhy")
        self._why.setWordWrap(True)
        self._why.hide()
        link = named(push_button("Link", "Move both together from now on"), "linkAgree")
        cancel = named(push_button("Cancel", "Leave it as it is"), "linkCancel")
        fields = QFormLayout()
        fields.setSpacing(STEP_PX)
        fields.addRow(f"Link {axis} with", self.other)
        fields.addRow("ratio", self.ratio)
        buttons = QHBoxLayout()
        buttons.addStretch(1)
        buttons.addWidget(link)
        buttons.addWidget(cancel)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        column.setSpacing(STEP_PX)
        column.addLayout(fields)
        column.addWidget(self._why)
        column.addLayout(buttons)
        link.clicked.connect(self._on_agree)
        self.ratio.returnPressed.connect(self._on_agree)
        cancel.clicked.connect(self.close)

    def _on_agree(self) -> None:
        try:
            ratio = float(self.ratio.text().replace(",", "."))
        except ValueError:
            self._refuse(f"{self.ratio.text()!r} is not a number")
            return
        self.agreed.emit(self.other.currentText(), ratio)
        self.close()

    def _refuse(self, why: str) -> None:
        self._why.setText(f"{state_look(State.REFUSED).glyph} {why}")
        self._why.show()
        self.adjustSize()
