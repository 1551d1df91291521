"""Where images go: base of the name, time stamp, directory."""

from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QGridLayout,
    QLabel,
    QLineEdit,
    QWidget,
)

from cosmic.frame.file_names import directory_problem, name_problem
from cosmic.frame.gui.ask_directory import ask_directory
from cosmic.frame.gui.build import push_button, tipped
from cosmic.frame.gui.refusal import mark_refusal
from cosmic.frame.gui.theme import STEP_PX


class FileFields(QWidget):
    """Fields for name and directory; `problem` says why they cannot be used.

    Parameters
    ----------
    station : str
        Whose disk it is, where it is not this computer's: nobody can look at it from here.

    Signals
    -------
    edited()
        One of them is another now.
    """

    edited = Signal()

    def __init__(
        self,
        directory: Path,
        base: str,
        parent: QWidget | None = None,
        *,
        now: Callable[[], datetime] = datetime.now,
        station: str = "",
    ) -> None:
        super().__init__(parent)
        self._now, self._station = now, station
        self._kept: tuple[str, Callable[[], Path]] | None = None
        self.base = tipped(QLineEdit(base), "Base of the file names")
        self.stamp = tipped(QCheckBox("append time"), "Append date and time to each name")
        self.stamp.setChecked(True)
        self.directory = tipped(QLineEdit(str(directory)), station or "Where files are stored")
        self.browse = push_button("Browse…", station or "Choose the directory")
        self.browse.setEnabled(not station)
        self._grid = grid = QGridLayout(self)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(STEP_PX // 2)
        for row, (caption, field, beside) in enumerate(
            (("Name", self.base, self.stamp), ("Directory", self.directory, self.browse))
        ):
            label = QLabel(caption)
            label.setProperty("role", "dim")
            grid.addWidget(label, row, 0)
            grid.addWidget(field, row, 1)
            grid.addWidget(beside, row, 2)
        self.base.textEdited.connect(self._on_edited)
        self.directory.textEdited.connect(self._on_edited)
        self.stamp.toggled.connect(self._on_edited)
        self.browse.clicked.connect(self._on_browse)

    def stack(self) -> None:
        """Put what stands beside the fields below them, for a narrow column."""
        self.directory.setMinimumWidth(6 * STEP_PX)
        for row, (field, beside) in enumerate(
            ((self.base, self.stamp), (self.directory, self.browse))
        ):
            self._grid.addWidget(field, row, 1, 1, 2)
            self._grid.addWidget(beside, 2 + row, 1, 1, 2)

    @property
    def remote(self) -> bool:
        """Whether it is the disk of another computer."""
        return bool(self._station)

    def keep_in(self, directory: Path, make: Callable[[], Path]) -> None:
        """Name a directory that `make` makes when the first file is written there."""
        self._kept = str(directory), make
        self.directory.setText(str(directory))
        self._on_edited()

    @property
    def _makes_directory(self) -> bool:
        return self._kept is not None and self.directory.text() == self._kept[0]

    def make_directory(self) -> None:
        """Make the directory of `keep_in` where it is the one chosen; raises `OSError`."""
        if self._kept is not None and self._makes_directory:
            self._kept[1]()

    @property
    def existing(self) -> Path:
        """The directory, or what there is of the one that is made when the first file comes."""
        folder = self.folder
        if not self._makes_directory:
            return folder
        return next((each for each in (folder, *folder.parents) if each.exists()), folder)

    @property
    def folder(self) -> Path:
        """The directory as it stands in its field."""
        folder = Path(self.directory.text())
        return folder if self._station else folder.expanduser()

    @property
    def problem(self) -> str:
        """Why the entries cannot be used; empty when they can."""
        return name_problem(self.base.text()) or self._directory_problem

    @property
    def _directory_problem(self) -> str:
        if self._station:
            return ""
        made = self._makes_directory
        return directory_problem(str(self.existing) if made else self.directory.text())

    def path(self, suffix: str, *, exact: bool = False) -> Path:
        """Return the whole path for a file that begins now; `exact` names milliseconds too."""
        stamp = ""
        if self.stamp.isChecked():
            now = self._now()
            stamp = f"_{now:%Y-%m-%d_%H-%M-%S}"
            stamp += f"-{now.microsecond // 1000:03d}" if exact else ""
        base = self.base.text().strip().removesuffix(suffix)
        return self.folder / f"{base}{stamp}{suffix}"

    def _on_edited(self) -> None:
        mark_refusal(self.base, name_problem(self.base.text()))
        mark_refusal(self.directory, self._directory_problem)
        self.edited.emit()

    def _on_browse(self) -> None:
        title = "Directory for images"
        start = str(self.existing) if self._makes_directory else self.directory.text()
        ask_directory(self, title, start, self._on_chosen)

    def _on_chosen(self, folder: str) -> None:
        self.directory.setText(folder)
        self._on_edited()
