"""``cosmic correct``: the fibres found on an image, corrected by an operator."""

import argparse
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Final

from cosmic.frame.errors import NotAvailable, RecordingError, RecordingExistsError
from cosmic.frame.interruption import held_back
from cosmic.vico.api.measure import Corrections, measure_page, read_images, side_file

if TYPE_CHECKING:
    from PySide6.QtWidgets import QApplication, QWidget

_SIGNAL_POLL_MS: Final = 250


def run(chosen: argparse.Namespace) -> int:
    """Open the editor, or export what was corrected; raises `CosmicError`."""
    file: Path = chosen.image
    _check_screenshot(chosen.screenshot, file)
    pages = list(read_images(file))
    if len(pages) != 1:
        raise RecordingError(f"{file}: has {len(pages)} images; correct them one by one")
    pixels = pages[0].pixels
    if side_file(file).exists():
        corrections = Corrections.open(pixels, file)
    else:
        corrections = Corrections(pixels, measure_page(pages[0]).fibres, file.name)
    if chosen.export is not None:
        corrections.export(chosen.export, file.stem)
        sys.stdout.write(f"{chosen.export}\n")
        return 0
    if chosen.offscreen is not None:
        os.environ["QT_QPA_PLATFORM"] = "offscreen"  # Qt reads nothing else
    # Here: what exports needs no widgets.
    from cosmic.vico.gui.fibre_editor import FibreEditor

    def save() -> str:
        return f"Kept in {corrections.save(file)}."

    app = _application()
    editor = FibreEditor(pixels, corrections, save)
    editor.setWindowTitle(f"{file.name}: fibres")
    editor.resize(1100, 850)
    return _shown(app, editor, chosen)


def _check_screenshot(screenshot: Path | None, file: Path) -> None:
    """Refuse a screenshot in place of what the command is about."""
    if screenshot is not None and screenshot.resolve() in (
        file.resolve(),
        side_file(file).resolve(),
    ):
        raise RecordingExistsError(
            f"{screenshot}: is the image or its corrections; save the screenshot as another file"
        )


def _application() -> "QApplication":
    from PySide6.QtWidgets import QApplication

    from cosmic.frame.gui.theme import apply_theme

    there = QApplication.instance()
    if isinstance(there, QApplication):
        return there
    if sys.platform == "linux" and not any(
        os.environ.get(each) for each in ("QT_QPA_PLATFORM", "DISPLAY", "WAYLAND_DISPLAY")
    ):
        raise NotAvailable("there is no display; --export FOLDER needs none")
    app = QApplication(sys.argv[:1])
    apply_theme(app, "dark")
    return app


def _shown(app: "QApplication", editor: "QWidget", chosen: argparse.Namespace) -> int:
    from PySide6.QtCore import QTimer

    wake = QTimer(interval=_SIGNAL_POLL_MS)  # Python sees a signal only when it runs
    wake.timeout.connect(wake.interval)
    wake.start()
    asked: list[str] = []

    def end(name: str) -> None:
        """Close it, which asks where edits are not kept; the second signal does not ask."""
        if asked:
            app.exit(0)
        else:
            editor.close()  # ends `exec`, as the last window; one more quit would stay behind
        asked.append(name)

    editor.show()
    if chosen.offscreen is not None:
        QTimer.singleShot(round(1000 * chosen.offscreen), lambda: app.exit(0))
    with held_back(end):
        code = app.exec()
    if chosen.offscreen is None:
        return code
    if chosen.screenshot is not None and not editor.grab().save(str(chosen.screenshot)):
        raise RecordingError(f"{chosen.screenshot}: the image cannot be saved")
    editor.close()
    return code
