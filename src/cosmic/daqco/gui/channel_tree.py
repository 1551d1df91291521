"""The table of channels by board (DAQSI.3)."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtWidgets import QHeaderView, QTreeWidget, QTreeWidgetItem, QWidget

from cosmic.daqco.core.settings import ChannelSettings
from cosmic.daqco.gui.colours import colour_name, readable, swatch
from cosmic.daqco.hw.interface import BoardInfo
from cosmic.frame.gui.theme import STEP_PX, ui_font
from cosmic.frame.overrides import override

COLUMNS: Final = ("Channel", "Name", "Min", "Max", "Active", "Scale", "Colour")
_ROW: Final = Qt.ItemDataRole.UserRole


class ChannelTree(QTreeWidget):
    """Boards, and below each its channels; a row is selected to edit its channel.

    Signals
    -------
    chosen(int)
        Number of the channel selected, as given.
    """

    chosen = Signal(int)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setColumnCount(len(COLUMNS))
        self.setHeaderLabels(list(COLUMNS))
        self.setUniformRowHeights(True)
        self.setAccessibleName("Channel settings")
        self._rows: list[QTreeWidgetItem] = []
        header = self.header()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setStretchLastSection(True)
        self.currentItemChanged.connect(self._on_current_changed)

    @property
    def row(self) -> int:
        """Number of the channel selected; -1 when none is."""
        item = self.currentItem()
        number = item.data(0, _ROW) if item is not None else None
        return -1 if number is None else int(number)

    def fill(
        self, boards: Sequence[BoardInfo], channels: Sequence[ChannelSettings], row: int
    ) -> None:
        """List everything anew, with one channel selected."""
        self.blockSignals(True)
        self.clear()
        tops = {info.name: self._top(info, channels) for info in boards}
        self._rows = []
        for number, channel in enumerate(channels):
            if channel.board not in tops:
                tops[channel.board] = self._missing(channel.board)
            item = QTreeWidgetItem(tops[channel.board])
            item.setData(0, _ROW, number)
            self._rows.append(item)
            self.show_channel(number, channel)
        self.expandAll()
        if 0 <= row < len(self._rows):
            self.setCurrentItem(self._rows[row])
        self.blockSignals(False)

    def show_channel(self, row: int, channel: ChannelSettings) -> None:
        """Show what a channel is now."""
        texts = (
            f"{channel.board}/{channel.input}",
            channel.name,
            f"{channel.low_v:g} V",
            f"{channel.high_v:g} V",
            "yes" if channel.active else "no",
            channel.scale,
            colour_name(channel.colour),
        )
        item = self._rows[row]
        for column, text in enumerate(texts):
            item.setText(column, text)
        item.setIcon(len(COLUMNS) - 1, swatch(readable(channel.colour)))

    def select(self, row: int) -> None:
        """Select a channel without telling of it."""
        self.blockSignals(True)
        if 0 <= row < len(self._rows):
            self.setCurrentItem(self._rows[row])
        else:
            self.clearSelection()
        self.blockSignals(False)

    def _top(self, info: BoardInfo, channels: Sequence[ChannelSettings]) -> QTreeWidgetItem:
        here = [each for each in channels if each.board == info.name]
        active = sum(each.active for each in here)
        kind = "simulated " if info.simulated else ""
        text = f"{info.name}, {kind}{info.product}: {active} of {len(info.inputs)} inputs active"
        return self._heading(text)

    def _missing(self, board: str) -> QTreeWidgetItem:
        return self._heading(f"{board}: ◆ this board is not connected")

    def _heading(self, text: str) -> QTreeWidgetItem:
        top = QTreeWidgetItem([text])
        top.setFlags(Qt.ItemFlag.ItemIsEnabled)
        top.setFont(0, ui_font(bold=True))
        self.addTopLevelItem(top)
        top.setFirstColumnSpanned(True)
        return top

    def _on_current_changed(self) -> None:
        self.chosen.emit(self.row)

    @override
    def sizeHint(self) -> QSize:
        return QSize(80 * STEP_PX, 28 * STEP_PX)
