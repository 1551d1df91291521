"""`UDaqMainWidget`: plotter and file widget under the menus of DAQCo (thesis, Appendix F)."""

from collections.abc import Callable
from pathlib import Path
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QAction, QResizeEvent
from PySide6.QtWidgets import (
    QDialog,
    QFileDialog,
    QHBoxLayout,
    QMenu,
    QMenuBar,
    QVBoxLayout,
    QWidget,
)

from cosmic.daqco.api.daqco import Daqco, daqco_of
from cosmic.daqco.gui.asking import Asking
from cosmic.daqco.gui.configure_dialog import UDaqConfigureDialog
from cosmic.daqco.gui.file_widget import UDaqFileWidget
from cosmic.daqco.gui.limit_dialog import LimitDialog
from cosmic.daqco.gui.outputs_panel import OutputsPanel
from cosmic.daqco.gui.plotter import UDaqPlotter
from cosmic.daqco.gui.station_export_dialog import StationExportDialog, export_kinds
from cosmic.frame.application import CosmicApplicationBase
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.beside import open_beside
from cosmic.frame.gui.chip import Chip
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.task_bar import TaskBar
from cosmic.frame.gui.theme import STEP_PX, number_font
from cosmic.frame.operation import Task
from cosmic.frame.overrides import override

RECORDINGS: Final = "Recordings (*.h5)"
LOW_PX: Final = 70 * STEP_PX
NARROW_PX: Final = 70 * STEP_PX


class UDaqMainWidget(QWidget):
    """Everything of DAQCo in one widget; content of a dock, or a window of its own.

    Signals
    -------
    close_requested()
        File > Stop DAQCo was chosen: acquisition was stopped, unless it runs at another station;
        whoever hosts the widget closes it.
    """

    close_requested = Signal()

    def __init__(self, daqco: Daqco, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle("DAQCo")
        self._daqco = daqco
        self.plotter = UDaqPlotter(daqco)
        self.outputs = OutputsPanel(daqco)
        self.files = UDaqFileWidget(daqco)
        tip = "Cancel the export and delete its file"
        self.export_bar = TaskBar(cancel_tip=tip, closable=True)
        self.export_bar.setContentsMargins(STEP_PX, 0, STEP_PX, 0)
        self.state = Chip("STOPPED", tip="Whether samples are acquired")
        self.rate_text, self.error = ElidedLabel(), ElidedLabel()
        self.rate_text.setFont(number_font())
        self.menu_bar = QMenuBar()
        self.menu_bar.setNativeMenuBar(False)
        self._build_menus()
        self._build()
        self.plotter.limit_requested.connect(self.edit_limit)
        self._asking = Asking(daqco, self)
        self._relay = Relay(self._on_changed).follow(daqco.on_change)
        self._on_changed()

    def _build(self) -> None:
        head = QHBoxLayout()
        head.setContentsMargins(STEP_PX, STEP_PX // 2, STEP_PX, 0)
        head.setSpacing(STEP_PX)
        head.addWidget(self.menu_bar)
        head.addWidget(self.state)
        head.addWidget(self.rate_text, 1)
        head.addWidget(self.error, 2)
        self.menu_bar.setSizePolicy(
            self.menu_bar.sizePolicy().Policy.Fixed, self.menu_bar.sizePolicy().Policy.Fixed
        )
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addLayout(head)
        column.addWidget(self.plotter, 1)
        column.addWidget(self.outputs)
        column.addWidget(self.export_bar)
        column.addWidget(self.files)

    def _build_menus(self) -> None:
        file = self._menu("&File")
        self.start_recording = self._action(file, "Start &recording", self.files.start.click)
        self.stop_recording = self._action(file, "Stop r&ecording", self.files.stop.click)
        file.addSeparator()
        self.export = self._action(file, "E&xport a recording…", self._on_export)
        file.addSeparator()
        self.quit = self._action(file, "&Stop DAQCo", self._on_quit)
        acquisition = self._menu("&Acquisition")
        self.start = self._action(acquisition, "&Start", self._on_start)
        self.stop = self._action(acquisition, "S&top", self._on_stop)
        acquisition.addSeparator()
        self.configure = self._action(acquisition, "&Configure…", self._on_configure)
        self.limits = self._action(acquisition, "&Limits…", self.edit_limit)
        view = self._menu("&View")
        self.show_files = self._action(view, "&File widget")
        self.show_channels = self._action(view, "&Channel list")
        for action, widget in (
            (self.show_files, self.files),
            (self.show_channels, self.plotter.channels),
        ):
            action.setCheckable(True)
            action.setChecked(True)
            action.toggled.connect(widget.setVisible)

    def _menu(self, title: str) -> QMenu:
        menu = self.menu_bar.addMenu(title)
        menu.setToolTipsVisible(True)
        return menu

    def _action(self, menu: QMenu, text: str, do: Callable[[], object] | None = None) -> QAction:
        action = menu.addAction(text)
        if do is not None:
            action.triggered.connect(lambda: do())
        return action

    @override
    def resizeEvent(self, event: QResizeEvent) -> None:
        super().resizeEvent(event)
        low, narrow = self.height() < LOW_PX, self.width() < NARROW_PX
        self.files.set_compact(low)
        self.plotter.set_compact(low or narrow, narrow=narrow)

    # Following the application

    def _on_changed(self) -> None:
        daqco = self._daqco
        running, recording, away = daqco.running, daqco.recording.active, daqco.away
        for widget in (self.plotter, self.files):
            widget.setEnabled(not away)
        for action in (self.configure, self.limits):
            action.setEnabled(not away)
            action.setToolTip(away)
        self.state.setText("AWAY" if away else "ACQUIRING" if running else "STOPPED")
        self.state.set_tone("quiet" if running else "warning")
        active = sum(each.active for each in daqco.settings.channel)
        self.rate_text.set_text(f"{active} × {daqco.rate_hz:g} Hz")
        self.start.setEnabled(not running and not away)
        self.stop.setEnabled(running)
        self.start_recording.setEnabled(running and not recording)
        self.stop_recording.setEnabled(recording and not away)
        self.export.setEnabled(not away)
        self.quit.setText("&Close this panel" if daqco.remote else "&Stop DAQCo")
        self._say(daqco.problem)

    def _say(self, text: str) -> None:
        self.error.set_text(f"■ {text}" if text else "")

    def _do(self, action: Callable[[], object]) -> None:
        self._asking.ask(action, self._on_done, slow=True)

    def _on_done(self, _result: object, error: CosmicError | None) -> None:
        if error is not None:
            self._say(str(error))
        else:
            self._on_changed()

    # Menus

    def _on_start(self) -> None:
        self._do(self._daqco.start)

    def _on_stop(self) -> None:
        self._do(self._daqco.stop)

    def _on_quit(self) -> None:
        if self._daqco.running and not self._daqco.remote:
            self._do(self._daqco.stop)
        self.close_requested.emit()
        if self.isWindow():
            self.close()

    def _on_configure(self) -> None:
        self._open(UDaqConfigureDialog(self._daqco, self))

    def edit_limit(self, channel: str = "") -> None:
        """Open the dialog for limits, at a channel."""
        self._open(LimitDialog(self._daqco, channel, self))

    def _open(self, dialog: QDialog) -> None:
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        open_beside(dialog)

    # Export

    def _on_export(self) -> None:
        if self._daqco.remote:
            folder = self.files.folder
            self._asking.ask(lambda: self._daqco.recordings(folder), self._on_listed)
            return
        dialog = QFileDialog(self, "Recording to export", str(self.files.folder), RECORDINGS)
        dialog.setFileMode(QFileDialog.FileMode.ExistingFile)
        dialog.fileSelected.connect(self._on_source_chosen)
        self._open(dialog)

    def _on_listed(self, found: tuple[Path, ...] | None, error: CosmicError | None) -> None:
        if found is None:
            self._say(str(error))
            return
        dialog = StationExportDialog(found, self._daqco.remote, self)
        dialog.chosen.connect(self.export_recording)
        self._open(dialog)

    def _on_source_chosen(self, source: str) -> None:
        kinds = export_kinds()
        target = str(Path(source).with_suffix(".csv"))
        dialog = QFileDialog(self, "Export to", target, ";;".join(kinds))
        dialog.setAcceptMode(QFileDialog.AcceptMode.AcceptSave)
        dialog.setDefaultSuffix("csv")
        dialog.selectFile(Path(source).with_suffix(".csv").name)
        dialog.filterSelected.connect(
            lambda chosen: dialog.setDefaultSuffix(kinds.get(chosen, "csv"))
        )
        dialog.fileSelected.connect(
            lambda target: self.export_recording(Path(source), Path(target))
        )
        self._open(dialog)

    def export_recording(self, source: Path, target: Path) -> None:
        """Export a recording to the format that `target` ends in, and show how far it is."""
        self._asking.ask(lambda: self._daqco.export(source, target), self._on_export_begun)

    def _on_export_begun(self, task: Task | None, error: CosmicError | None) -> None:
        if task is not None:
            self.export_bar.follow(task)
        else:
            self.export_bar.say(str(error), refused=True)


def make_daqco_gui(application: CosmicApplicationBase) -> UDaqMainWidget:
    """Return the GUI component of DAQCo, here or at another station; its `gui_factory`."""
    return UDaqMainWidget(daqco_of(application))
