"""The process that `benchmarks.start` starts: opens the window and tells when it was usable."""

# ruff: noqa: E402 - how long the imports take is measured
import json
import sys
import time

BEGAN_S = float(sys.argv[1]) if len(sys.argv) > 1 else time.monotonic()
times_s = {"python": time.monotonic() - BEGAN_S}

from PySide6.QtCore import QEvent, QObject, Qt, QTimer
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QApplication
from typing_extensions import override

from cosmic.app.cli import main
from cosmic.app.windows import run_window
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.mico.core.motion.positioner import Status


class Watch(QObject):
    """Waits for the table painted after every axis had its position, and closes the window."""

    def __init__(self, window: OperatorWindow) -> None:
        super().__init__(window)
        self._window = window
        self._pressed = False
        self._timer = QTimer(self, interval=2)
        self._timer.timeout.connect(self._look)
        self._timer.start()

    def _look(self) -> None:
        gui = self._window.mico_gui
        if gui is None or not gui.table.rows:
            return
        read = all(axis.details.position is not None for axis in gui.mico)
        # The feed shows a state at most 33 ms after it came.
        if read and all(row.position.text != "–" for row in gui.table.rows.values()):
            self._timer.stop()
            gui.table.installEventFilter(self)
            gui.table.update()

    @override
    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """See the paint."""
        if event.type() == QEvent.Type.Paint and "painted" not in times_s:
            QTimer.singleShot(0, self._finish)
            times_s["painted"] = 0.0
        return super().eventFilter(watched, event)

    def _finish(self) -> None:
        times_s["painted"] = time.monotonic() - BEGAN_S
        gui = self._window.mico_gui
        if gui is None:
            raise RuntimeError("the window has no MiCo panel")
        self._movement = gui.mico["left.x"].move_by(4000.0, wait=False)
        self._timer.timeout.disconnect(self._look)
        self._timer.timeout.connect(self._stop)
        self._timer.start()

    def _stop(self) -> None:
        """Press F12 as soon as the axis moves, and see it stop."""
        gui = self._window.mico_gui
        if gui is None or (gui.mico["left.x"].state is Status.OK and not self._pressed):
            return
        if not self._pressed:
            self._pressed = True
            press = QKeyEvent(QEvent.Type.KeyPress, Qt.Key.Key_F12, Qt.KeyboardModifier.NoModifier)
            QApplication.sendEvent(self._window, press)
        if self._movement.done:
            self._timer.stop()
            times_s["usable"] = time.monotonic() - BEGAN_S
            times_s["cpu"] = time.process_time()
            self._window.close_now()


def _watched(window: OperatorWindow) -> None:
    times_s["shown"] = time.monotonic() - BEGAN_S
    Watch(window)
    open_hardware(window)


if __name__ == "__main__":
    times_s["imported"] = time.monotonic() - BEGAN_S
    open_hardware = OperatorWindow.open_hardware
    run_window.OperatorWindow.open_hardware = _watched  # type: ignore[method-assign]
    code = main(["--offscreen", "60"])
    sys.stdout.write(json.dumps(times_s) + "\n")
    sys.exit(code or ("usable" not in times_s) or QApplication.instance() is None)
