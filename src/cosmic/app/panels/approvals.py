"""The panel of what programs want to move: a person says yes or no to each."""

from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QHBoxLayout, QTreeWidget, QTreeWidgetItem, QVBoxLayout, QWidget

from cosmic.app.gateways.approvals import Approvals, Asked
from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.build import named, push_button
from cosmic.frame.gui.relay import Relay

TITLE: Final = "Approvals"
HEADS: Final = ("Program", "Command", "Arguments")


@checked_class
class ApprovalsPanel(QWidget):
    """Lists what waits and approves or refuses the chosen one; GUI thread.

    Signals
    -------
    asked()
        A program asks, where nothing waited before.
    """

    asked = Signal()

    def __init__(self, approvals: Approvals, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._approvals = approvals
        self._asked: tuple[Asked, ...] = ()
        self._list = named(QTreeWidget(), "approvals")
        self._list.setHeaderLabels(HEADS)
        self._list.setRootIsDecorated(False)
        self._list.currentItemChanged.connect(self._on_chosen)
        self._approve = push_button("Approve", "Have the chosen command carried out")
        self._refuse = push_button("Refuse", "Refuse the chosen command")
        self._approve.clicked.connect(self._on_approve)
        self._refuse.clicked.connect(self._on_refuse)
        buttons = QHBoxLayout()
        buttons.addWidget(self._approve)
        buttons.addWidget(self._refuse)
        buttons.addStretch(1)
        column = QVBoxLayout(self)
        column.addWidget(self._list, 1)
        column.addLayout(buttons)
        self._relay = Relay(self._show)
        self._relay.keep(approvals.on_change(self._relay))
        self._show()

    @property
    def texts(self) -> tuple[str, ...]:
        """What is listed, a line each."""
        return tuple(f"{each.who}: {each.what} {each.details}" for each in self._asked)

    def choose(self, row: int) -> None:
        """Choose an entry, from 0."""
        item = self._list.topLevelItem(row)
        if item is not None:
            self._list.setCurrentItem(item)

    def end(self) -> None:
        """Listen no more; harmless the second time."""
        self._relay.end()

    def _show(self) -> None:
        chosen = self._number()
        before, self._asked = self._asked, self._approvals.waiting
        self._list.clear()
        for each in self._asked:
            item = QTreeWidgetItem([each.who, each.what, each.details])
            item.setToolTip(2, each.details)
            self._list.addTopLevelItem(item)
            if each.number == chosen:
                self._list.setCurrentItem(item)
        for column in range(len(HEADS) - 1):
            self._list.resizeColumnToContents(column)
        if self._asked and not before:
            self.choose(0)
            self.asked.emit()
        self._on_chosen()

    def _number(self) -> int | None:
        item = self._list.currentItem()
        row = -1 if item is None else self._list.indexOfTopLevelItem(item)
        return self._asked[row].number if 0 <= row < len(self._asked) else None

    def _on_chosen(self) -> None:
        there = self._number() is not None
        self._approve.setEnabled(there)
        self._refuse.setEnabled(there)

    def _on_approve(self) -> None:
        self._decide(approve=True)

    def _on_refuse(self) -> None:
        self._decide(approve=False)

    def _decide(self, *, approve: bool) -> None:
        number = self._number()
        if number is None:
            return
        try:
            if approve:
                self._approvals.approve(number)
            else:
                self._approvals.refuse(number)
        except CosmicError:
            self._show()  # it was taken back meanwhile
