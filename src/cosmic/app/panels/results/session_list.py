"""The list of sessions: what was recorded in each, with thumbnails, and what is known of it."""

from collections.abc import Callable, Sequence
from datetime import date, datetime
from pathlib import Path
from typing import Final

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QIcon, QImage, QPixmap
from PySide6.QtWidgets import (
    QAbstractItemView,
    QHBoxLayout,
    QHeaderView,
    QLineEdit,
    QTreeWidget,
    QTreeWidgetItem,
    QVBoxLayout,
    QWidget,
)

from cosmic.app.results.sessions import About, Item, ItemKind, Session, sessions_in, write_about
from cosmic.frame.background import BackgroundJobs
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.amounts import size_text
from cosmic.frame.gui.build import named, push_button, styled, tipped
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.log_panel import SearchField
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.theme import STEP_PX

THUMBNAIL: Final = QSize(56, 32)
_ITEM: Final = Qt.ItemDataRole.UserRole
_GLYPHS: Final = {
    ItemKind.FORCE: "∿",
    ItemKind.IMAGES: "▦",
    ItemKind.IMAGE: "▣",
    ItemKind.CAMPAIGN: "☰",
}
Draw = Callable[[Item], QImage | None]


class SessionList(QWidget):
    """Lists sessions, newest first; several items can be chosen to compare them; GUI thread.

    Parameters
    ----------
    folders : callable
        Returns where is looked for them.
    jobs : BackgroundJobs
        Where folders are listed and thumbnails drawn.
    draw : callable
        Returns a thumbnail of an item; called in the thread of `jobs`.
    today : callable
        Returns the day, for "today" and "yesterday" in a search.

    Signals
    -------
    chosen(tuple)
        Other items are chosen: the first was chosen first.
    """

    chosen = Signal(object)

    def __init__(
        self,
        folders: Callable[[], Sequence[Path]],
        jobs: BackgroundJobs,
        draw: Draw,
        parent: QWidget | None = None,
        *,
        today: Callable[[], date] = date.today,
    ) -> None:
        super().__init__(parent)
        self._folders, self._jobs, self._draw, self._today = folders, jobs, draw, today
        self._sessions: list[Session] = []
        self._thumbnails: dict[tuple[Path, datetime], QIcon] = {}
        self._order: list[Item] = []
        self._wanted: Path | None = None
        self._listed = Relay(self._on_listed)
        self._drawn = Relay(self._on_drawn)
        self._make_widgets()
        self._arrange()

    def _make_widgets(self) -> None:
        self.search = named(SearchField(), "resultsSearch")
        self.search.setPlaceholderText("name, day, sample, yesterday")
        self.search.setToolTip(
            "Show the recordings to which all these words fit: name, day, today, yesterday, "
            "sample, operator, note"
        )
        self.search.textChanged.connect(self._show_sessions)
        self.again = styled(
            named(push_button("Look again", "Look for recordings again"), "resultsAgain"), "narrow"
        )
        self.again.clicked.connect(self.refresh)
        self.list = named(QTreeWidget(), "resultsList")
        self.list.setHeaderLabels(["Recording", "Size"])
        self.list.setIconSize(THUMBNAIL)
        # What tells two recordings of one name apart is their time, at the end.
        self.list.setTextElideMode(Qt.TextElideMode.ElideMiddle)
        self.list.setIndentation(STEP_PX)
        head = self.list.header()
        head.setStretchLastSection(False)
        head.setSectionResizeMode(0, QHeaderView.ResizeMode.Stretch)
        head.setSectionResizeMode(1, QHeaderView.ResizeMode.ResizeToContents)
        self.list.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        self.list.setToolTip("Ctrl and a click choose others to compare with the first")
        self.list.itemSelectionChanged.connect(self._on_selection)
        self.sample = self._field("sample", "Sample of this session")
        self.operator = self._field("operator", "Who worked in this session")
        self.note = self._field("note", "Note on this session")
        self.message = named(ElidedLabel(), "sessionMessage")

    def _field(self, name: str, tip: str) -> QLineEdit:
        field = named(tipped(QLineEdit(), tip), f"session_{name}")
        field.setPlaceholderText(name)
        field.setMinimumWidth(8 * STEP_PX)
        field.setEnabled(False)
        field.editingFinished.connect(self._on_about)
        return field

    def _arrange(self) -> None:
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(STEP_PX // 2)
        row = QHBoxLayout()
        row.setSpacing(STEP_PX // 2)
        row.addWidget(self.search, 1)
        row.addWidget(self.again)
        column.addLayout(row)
        column.addWidget(self.list, 1)
        row = QHBoxLayout()
        row.setSpacing(STEP_PX // 2)
        row.addWidget(self.sample)
        row.addWidget(self.operator)
        column.addLayout(row)
        column.addWidget(self.note)
        column.addWidget(self.message)

    # What there is

    @property
    def sessions(self) -> tuple[Session, ...]:
        """All that were found, newest first."""
        return tuple(self._sessions)

    @property
    def items(self) -> tuple[Item, ...]:
        """Those chosen, the first chosen first."""
        return tuple(self._order)

    def refresh(self) -> None:
        """Look for recordings again; returns at once."""
        folders = tuple(self._folders())
        self._jobs.do(lambda: sessions_in(folders), self._listed)

    def show_file(self, file: Path) -> None:
        """Choose a recording, as soon as it is listed."""
        self._wanted = file
        self.refresh()

    def _on_listed(self, found: list[Session] | None, error: CosmicError | None) -> None:
        if found is None:
            self.message.set_text(str(error))
            return
        if found != self._sessions or self._wanted is not None:
            self._sessions = found
            self._show_sessions()
        self.message.set_text("" if found else "No recordings yet")

    def _show_sessions(self) -> None:
        chosen = {each.path for each in self._order}
        if self._wanted is not None:
            chosen = {self._wanted}
        today, words = self._today(), self.search.text()
        self.list.blockSignals(True)
        self.list.clear()
        for session in self._sessions:
            items = session.matches(words, today)
            if not items:
                continue
            parent = QTreeWidgetItem([_heading(session, today), ""])
            parent.setToolTip(0, str(session.folder))
            parent.setFlags(parent.flags() & ~Qt.ItemFlag.ItemIsSelectable)
            self.list.addTopLevelItem(parent)
            parent.setExpanded(True)
            parent.setFirstColumnSpanned(True)
            for each in items:
                self._add(parent, each, chosen=each.path in chosen)
        self.list.blockSignals(False)
        if self._wanted is not None:
            self._wanted = None
            self._on_selection()

    def _add(self, parent: QTreeWidgetItem, each: Item, *, chosen: bool) -> None:
        size = "" if each.kind is ItemKind.CAMPAIGN else size_text(each.size_bytes)
        row = QTreeWidgetItem([f"{_GLYPHS[each.kind]} {each.name}", size])
        row.setData(0, _ITEM, each)
        row.setToolTip(0, f"{each.kind}, {each.changed:%Y-%m-%d %H:%M}\n{each.path}")
        parent.addChild(row)
        row.setSelected(chosen)
        key = (each.path, each.changed)
        if key in self._thumbnails:
            row.setIcon(0, self._thumbnails[key])
            return
        row.setIcon(0, self._blank())
        self._thumbnails[key] = self._blank()
        draw = self._draw
        self._jobs.do(lambda: (each, draw(each)), self._drawn)

    @staticmethod
    def _blank() -> QIcon:
        image = QPixmap(THUMBNAIL)
        image.fill(Qt.GlobalColor.transparent)
        return QIcon(image)

    def _on_drawn(
        self, found: tuple[Item, QImage | None] | None, _error: CosmicError | None
    ) -> None:
        item, image = found if found is not None else (None, None)
        if item is None or image is None:
            return
        icon = QIcon(QPixmap.fromImage(image))
        self._thumbnails[item.path, item.changed] = icon
        for row in self._rows():
            if row.data(0, _ITEM) == item:
                row.setIcon(0, icon)

    def _rows(self) -> list[QTreeWidgetItem]:
        tops = (self.list.topLevelItem(row) for row in range(self.list.topLevelItemCount()))
        inner = (top.child(row) for top in tops if top is not None for row in _children(top))
        return [each for each in inner if each is not None]

    def row_of(self, name: str) -> QTreeWidgetItem | None:
        """Return the first line whose recording is called so, or begins so."""
        return next((e for e in self._rows() if e.data(0, _ITEM).name.startswith(name)), None)

    # Choosing

    def _on_selection(self) -> None:
        chosen = [row.data(0, _ITEM) for row in self._rows() if row.isSelected()]
        kept = [each for each in self._order if each in chosen]
        self._order = kept + [each for each in chosen if each not in kept]
        self._show_about()
        self.chosen.emit(tuple(self._order))

    def _session(self) -> Session | None:
        folder = self._order[0].path.parent if self._order else None
        return next((each for each in self._sessions if each.folder == folder), None)

    def _show_about(self) -> None:
        session = self._session()
        about = session.about if session is not None else About()
        for field, text in (
            (self.sample, about.sample),
            (self.operator, about.operator),
            (self.note, about.note),
        ):
            field.setEnabled(session is not None)
            field.setText(text)

    def _on_about(self) -> None:
        session = self._session()
        about = About(self.sample.text(), self.operator.text(), self.note.text())
        if session is None or about == session.about:
            return
        try:
            write_about(session.folder, about)
        except OSError as exc:
            self.message.set_text(f"Not kept: {exc.strerror or exc}")
            return
        self.message.set_text("")
        self.refresh()


def _children(top: QTreeWidgetItem) -> range:
    return range(top.childCount())


def _heading(session: Session, today: date) -> str:
    """Return day, sample and operator of a session."""
    day = session.changed.date()
    past = (today - day).days
    when = {0: "today", 1: "yesterday"}.get(past, f"{day:%Y-%m-%d}")
    about = [each for each in (session.about.sample, session.about.operator) if each]
    return ", ".join([f"{when} {session.changed:%H:%M}", *about])
