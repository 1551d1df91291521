"""What an operator waits for in the window while its platform carries out a campaign.

From an input in the queue of the window's thread until what it changes is painted: a pressed
button, another workspace, another theme. Besides: how many of the camera's images are shown, how
many times a second the force is, and how long the window takes to close.
"""

import statistics
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from PySide6.QtCore import QCoreApplication, QEvent, QObject, Qt, Signal
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QAbstractButton, QPushButton
from typing_extensions import override

from benchmarks.figures import Figure, main, percentile
from benchmarks.full_platform import RECIPE, FullStand, full_platform
from benchmarks.stand import wait_until
from benchmarks.web_clients import Looker, live_view
from cosmic.app.panels.force import ForcePanel
from cosmic.app.windows.tasks import HANDLE

NAME = "workplace"
CLICK_MS, WORKSPACE_MS, THEME_MS, CLOSE_MS = 100.0, 200.0, 300.0, 1000.0
PAUSE_S = 0.1
BEHIND_PAINTING = -100
"""Qt paints at the priority -1: what is posted with this one comes when that is done."""


class Painted(QObject):
    """Does something in the window's thread and notes when what came of it is painted."""

    _asked = Signal(object)

    def __init__(self, stand: FullStand) -> None:
        super().__init__()
        self._end_s = 0.0
        self._there = threading.Event()
        self.moveToThread(stand.app.thread())
        self._asked.connect(self._do, Qt.ConnectionType.QueuedConnection)

    def ms(self, action: Callable[[], object]) -> float:
        """Return how long `action` takes from here until it is painted; another thread."""
        self._there.clear()
        began_s = time.perf_counter()
        self._asked.emit(action)
        if not self._there.wait(30.0):
            raise TimeoutError("the window does not come to an end with it")
        time.sleep(PAUSE_S)
        return 1e3 * (self._end_s - began_s)

    def _do(self, action: Callable[[], object]) -> None:
        action()
        QCoreApplication.postEvent(self, QEvent(QEvent.Type.User), BEHIND_PAINTING)

    @override
    def event(self, event: QEvent) -> bool:
        if event.type() != QEvent.Type.User:
            return super().event(event)
        self._end_s = time.perf_counter()
        self._there.set()
        return True


def rows(what: str, taken: list[float], p99_ms: float) -> list[Figure]:
    """Return the rows of one kind of input."""
    return [
        Figure(NAME, f"{what}, p50", statistics.median(taken), "ms"),
        Figure(NAME, f"{what}, p99", percentile(taken, 99), "ms", p99_ms),
        Figure(NAME, f"{what}, slowest of {len(taken)}", max(taken), "ms"),
    ]


def click(button: QAbstractButton) -> None:
    """Click as a mouse does."""
    QTest.mouseClick(button, Qt.MouseButton.LeftButton)


def inputs(stand: FullStand, clicks: int, rounds: int) -> list[Figure]:
    """Press a button, go through all workspaces, change the theme."""
    painted, bar = Painted(stand), stand.window.top_bar
    if bar.workspaces is None:
        raise RuntimeError("the window has no workspaces")
    places = bar.workspaces.buttons
    here, theme = places[HANDLE], bar.findChild(QPushButton, "themeButton")
    if theme is None:
        raise RuntimeError("the window has no button for its theme")
    press: list[float] = []
    for _ in range(clicks):
        press.append(painted.ms(lambda: QTest.mousePress(here, Qt.MouseButton.LeftButton)))
        painted.ms(lambda: QTest.mouseRelease(here, Qt.MouseButton.LeftButton))
    changes, themes = [], []
    for turn in range(rounds + 1):
        for place in places.values():
            taken_ms = painted.ms(partial(click, place))
            if turn:  # the first time makes what the workspace shows
                changes.append(taken_ms)
                themes += [painted.ms(partial(click, theme)) for _ in range(2)]
    return [
        *rows("a button pressed", press, CLICK_MS),
        *rows("another workspace", changes, WORKSPACE_MS),
        *rows("another theme", themes, THEME_MS),
    ]


def live(stand: FullStand, looker: Looker, plot: ForcePanel, seconds: float) -> list[Figure]:
    """Count images shown of those that the camera gave, and refreshes of the force."""
    camera = stand.rig.vico.camera()
    feed, fed = plot.chart.feed, [0]

    def counted(*chunks: object) -> None:
        feed(*chunks)
        fed[0] += 1

    plot.chart.feed = counted  # type: ignore[method-assign]
    came = camera.latest
    wait_until(lambda: camera.latest is not came)
    given, fed[0] = camera.counters.completed, 0
    began_s = time.perf_counter()
    seen = looker.look(seconds)
    passed_s = time.perf_counter() - began_s
    given = camera.counters.completed - given
    return [
        Figure(NAME, "images given", given / passed_s, "Hz"),
        Figure(NAME, "images shown", seen.shown_hz, "Hz"),
        Figure(NAME, "force shown", fed[0] / passed_s, "Hz"),
    ]


def close_ms(stand: FullStand) -> float:
    """Close the window without parking."""
    return Painted(stand).ms(stand.window.close_now)


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    clicks, rounds, seconds = (3, 1, 1.0) if quick else (200, 10, 20.0)
    with TemporaryDirectory() as folder, full_platform(campaign=False, repainted=False) as stand:
        looker = Looker(live_view(stand))
        stand.window.workspaces.choose(HANDLE)
        plot = next(each for each in stand.window.findChildren(ForcePanel) if each.isVisible())
        stand.app.setQuitOnLastWindowClosed(False)
        campaign = stand.rig.campaign(RECIPE, Path(folder) / "campaign")

        def work() -> list[Figure]:
            campaign.start()
            figures = live(stand, looker, plot, seconds) + inputs(stand, clicks, rounds)
            if campaign.over:
                raise RuntimeError(f"the campaign ended: {campaign.end_reason}")
            return [*figures, Figure(NAME, "closing", close_ms(stand), "ms", CLOSE_MS)]

        try:
            return stand.beside(work)
        finally:
            campaign.abort()
            campaign.join()


if __name__ == "__main__":
    main(__doc__, measure)
