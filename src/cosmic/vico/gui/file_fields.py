"""Where pictures go: base of the name, time stamp, directory."""

from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Final

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QFileDialog,
    QGridLayout,
    QLabel,
    QLineEdit,
    QMessageBox,
    QWidget,
)

from cosmic.frame.gui.build import push_button, tipped
from cosmic.frame.gui.theme import STEP_PX
from cosmic.vico.gui.amount_field import mark_refused

_FORBIDDEN: Final = '/\\:*?"<>|'


def name_problem(base: str) -> str:
    """Return why `base` cannot be the name of a file; empty when it can."""
    if not base.strip():
        return "type a name"
    bad = sorted({each for each in base if each in _FORBIDDEN or ord(each) < 32})
    if bad:
        return f"a file name cannot have {' '.join(bad)}"
    return "" if base.strip(". ") else "type a name with a letter or a figure in it"


def directory_problem(text: str) -> str:
    """Return why pictures cannot go there; empty when they can."""
    if not text.strip():
        return "type a directory"
    try:
        there = Path(text).expanduser().is_dir()
    except (OSError, RuntimeError, ValueError) as exc:
        return f"{text}: {exc}"
    return "" if there else f"there is no directory {text}"


class FileFields(QWidget):
    """Fields for name and directory; `problem` says why they cannot be used.

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
    ) -> None:
        super().__init__(parent)
        self._now = now
        self.base = tipped(QLineEdit(base), "Base of the file names")
        self.stamp = tipped(QCheckBox("append time"), "Append date and time to each name")
        self.stamp.setChecked(True)
        self.directory = tipped(QLineEdit(str(directory)), "Where files are stored")
        self.browse = push_button("Browse…", "Choose the directory")
        grid = QGridLayout(self)
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

    @property
    def folder(self) -> Path:
        """The directory as it stands in its field."""
        return Path(self.directory.text()).expanduser()

    @property
    def problem(self) -> str:
        """Why the entries cannot be used; empty when they can."""
        return name_problem(self.base.text()) or directory_problem(self.directory.text())

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
        mark_refused(self.base, name_problem(self.base.text()))
        mark_refused(self.directory, directory_problem(self.directory.text()))
        self.edited.emit()

    def _on_browse(self) -> None:
        dialog = QFileDialog(self, "Directory for pictures", self.directory.text())
        dialog.setFileMode(QFileDialog.FileMode.Directory)
        dialog.setOption(QFileDialog.Option.ShowDirsOnly)
        dialog.fileSelected.connect(self._on_chosen)
        dialog.finished.connect(dialog.deleteLater)
        dialog.open()

    def _on_chosen(self, folder: str) -> None:
        self.directory.setText(folder)
        self._on_edited()


def overwrite_question(parent: QWidget, path: Path, overwrite: Callable[[], object]) -> QMessageBox:
    """Return a dialog that calls `overwrite` when the operator says so; Escape is no."""
    box = QMessageBox(parent)
    box.setIcon(QMessageBox.Icon.Warning)
    box.setWindowTitle("Overwrite it?")
    box.setText(f"{path.name} exists already.")
    box.setInformativeText("What is in it will be lost.")
    agree = box.addButton("Overwrite", QMessageBox.ButtonRole.DestructiveRole)
    cancel = box.addButton(QMessageBox.StandardButton.Cancel)
    box.setDefaultButton(cancel)
    box.setEscapeButton(cancel)
    agree.clicked.connect(overwrite)
    box.finished.connect(box.deleteLater)
    return box
