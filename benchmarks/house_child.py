"""The program whose window `benchmarks.house` clicks in, with every call of it noted.

    python -m benchmarks.house_child SRC FILE     # the sources, and where the result goes

It knows the program by what an operator sees: a button "Go to" with a number field left of it.
"""

import json
import re
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from types import CodeType, FrameType
from typing import Final

from PySide6.QtCore import QPoint, Qt, QTimer
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QApplication, QLineEdit

BUTTON: Final = "Go to"
AWAY_UM: Final = 5.0
LONGEST_S: Final = 300.0
SETTLED_MS: Final = 3000
REST_MS: Final = 3000
"""How long is looked at rest, and from the click on: a movement of 5 um is over long before."""
PAINTING: Final = ("paintEvent", "paint", "paintGL")
LIBRARY: Final = re.compile(r"/hw/sim")
"""What a movement calls there first, and nothing at rest does, is the call that starts it."""
BELOW: Final = re.compile(r"/twin/|/sim_[^/]*$|/sim/|/frame/time_scale\.py$")
"""The simulated controller and its world: below the library that the program calls."""


class Calls:
    """Notes which functions of some sources run; in all threads that Python or ours start."""

    def __init__(self, source: str) -> None:
        self._source = source
        self.noted: set[CodeType] | None = None
        self.known: set[CodeType] = set()
        self.until_library: set[CodeType] | None = None

    def on_call(self, frame: FrameType, event: str, _argument: object) -> None:
        """Note one call; a trace function, which wants no more of it."""
        noted = self.noted
        code = frame.f_code
        if noted is None or event != "call" or code in noted or _paints(frame):
            return
        noted.add(code)
        new = self.until_library is None and self.known and code not in self.known
        if new and LIBRARY.search(code.co_filename):
            self.until_library = set(noted)

    def of_sources(self, codes: set[CodeType]) -> set[tuple[str, str]]:
        """Return file and name of the functions of the sources above the library."""
        found = {(code.co_filename, code.co_qualname) for code in codes}
        return {
            (file.removeprefix(self._source).lstrip("/"), name)
            for file, name in found
            if file.startswith(self._source) and not BELOW.search(file)
        }


def _paints(frame: FrameType | None) -> bool:
    """Return True for a call that only draws what is shown anyway."""
    while frame is not None:
        if frame.f_code.co_name in PAINTING:
            return True
        frame = frame.f_back
    return False


class Click:
    """Waits for the window, looks at rest, clicks, looks again; GUI thread."""

    def __init__(self, calls: Calls) -> None:
        self._calls = calls
        self._waited_ms = 0
        self.at_rest: set[CodeType] = set()
        self.clicked: set[CodeType] = set()

    def look_for_button(self) -> None:
        """Go on once an axis can be moved."""
        if self._button() is not None:
            QTimer.singleShot(SETTLED_MS, self._rest)
        elif self._waited_ms > 1000 * LONGEST_S:
            QApplication.exit(3)
        else:
            self._waited_ms += 200
            QTimer.singleShot(200, self.look_for_button)

    @staticmethod
    def _button() -> QAbstractButton | None:
        buttons = (each for each in QApplication.allWidgets() if isinstance(each, QAbstractButton))
        there = (each for each in buttons if each.isVisible() and each.isEnabled())
        ours = [each for each in there if each.text().replace("&", "") == BUTTON]
        return min(ours, key=_height, default=None)

    @staticmethod
    def _field(button: QAbstractButton) -> QLineEdit:
        left_of = [
            (button.mapToGlobal(QPoint()).x() - each.mapToGlobal(QPoint()).x(), each)
            for each in button.window().findChildren(QLineEdit)
            if each.isVisible() and abs(_height(each) - _height(button)) < button.height()
        ]
        return min((each for each in left_of if each[0] > 0), key=lambda each: each[0])[1]

    def _rest(self) -> None:
        button = self._button()
        if button is None:
            QApplication.exit(3)
            return
        field = self._field(button)
        number = re.search(r"[-−]?[\d.]+", field.text().replace(",", ""))
        stands = float(number.group().replace("−", "-")) if number else 0.0
        field.selectAll()
        QTest.keyClicks(field, f"{stands + AWAY_UM:g}")
        QTimer.singleShot(SETTLED_MS, self._look_at_rest)

    def _look_at_rest(self) -> None:
        self._calls.noted = self.at_rest
        QTimer.singleShot(REST_MS, self._press)

    def _press(self) -> None:
        button = self._button()
        self._calls.known = self.at_rest
        self._calls.noted = self.clicked
        if button is not None:
            QTest.mouseClick(button, Qt.MouseButton.LeftButton)
        QTimer.singleShot(REST_MS, self._end)

    def _end(self) -> None:
        self._calls.noted = None
        QApplication.closeAllWindows()
        QApplication.quit()


def _height(widget: QAbstractButton | QLineEdit) -> int:
    return widget.mapToGlobal(widget.rect().center()).y()


def _run(click: Click) -> int:
    """Open the window of MiCo as the command does, and click once Qt runs."""
    from cosmic.app.cli import main as cosmic_main

    real: Callable[[], int] = QApplication.exec

    def exec_and_click(*_self: object) -> int:
        QTimer.singleShot(0, click.look_for_button)
        return real()

    QApplication.exec = staticmethod(exec_and_click)  # type: ignore[method-assign]
    return cosmic_main(["mico", "--offscreen", f"{LONGEST_S:g}"])


def main() -> int:
    """Run, and write what was called."""
    source, kept = sys.argv[1], Path(sys.argv[2])
    calls = Calls(source)
    threading.settrace(calls.on_call)
    sys.settrace(calls.on_call)
    click = Click(calls)
    code = _run(click)
    sys.settrace(None)
    every, resting = calls.of_sources(click.clicked), calls.of_sources(click.at_rest)
    own, there = every - resting, calls.until_library
    if there is None:
        sys.stderr.write('"Go to" reached no library\n')
        return 1
    way_there = calls.of_sources(there) - resting
    figures = {
        'files that run from "Go to" to its end': sorted({file for file, _ in every}),
        "of these, not at rest as well": sorted({file for file, _ in own}),
        "of those, until the library is called": sorted({file for file, _ in way_there}),
        "functions that do not run at rest as well": sorted(f"{f}: {name}" for f, name in own),
    }
    table = [{"name": name, "names": names} for name, names in figures.items()]
    kept.write_text(json.dumps(table), encoding="utf-8")
    return code


if __name__ == "__main__":
    sys.exit(main())
