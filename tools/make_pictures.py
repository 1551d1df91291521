"""Makes pictures of the docs anew from the running program.

`python tools/make_pictures.py FOLDER [NAME ...]` writes NAME.png into FOLDER. Under a display with
OpenGL (Xvfb will do) the scene is drawn as a body of light and shade, elsewhere as projections.
"""

import argparse
import sys
import tempfile
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLineEdit, QWidget

from benchmarks.full_platform import FullStand, full_platform
from benchmarks.stand import wait_until
from cosmic.app.panels.campaign.panel import CampaignPanel
from cosmic.app.panels.tool import ToolPanel
from cosmic.app.windows.tasks import CAMPAIGN, HANDLE, LOOK, MEASURE, SET_UP
from cosmic.frame.clock import WALL
from cosmic.mico.gui.trajectory_panel import TrajectoryPanel

SIZE: Final = (1366, 768)
LONG_S: Final = 300.0
SETTLED_S: Final = 2.0
FIND_S: Final = 20.0

MADE: Final[dict[str, Any]] = {}


class Hand(QObject):
    """Does things in the window's thread, for a thread that may wait."""

    _asked = Signal(object)

    def __init__(self, stand: FullStand, folder: Path) -> None:
        super().__init__()
        self.stand, self.rig, self.window, self.folder = stand, stand.rig, stand.window, folder
        self.moveToThread(stand.app.thread())
        self._asked.connect(self._do, Qt.ConnectionType.QueuedConnection)

    def do(self, action: Callable[[], Any]) -> Any:
        """Return what `action` returns there."""
        found: list[Any] = []
        done = threading.Event()

        def body() -> None:
            try:
                found.append(action())
            except Exception as exc:  # noqa: BLE001 - raised again below, by who asked
                found.append(exc)
            done.set()

        self._asked.emit(body)
        if not done.wait(LONG_S):
            raise TimeoutError("the window does not do what it is asked for")
        if isinstance(found[0], Exception):
            raise found[0]
        return found[0]

    def _do(self, body: Callable[[], None]) -> None:
        body()

    def choose(self, workspace: str) -> None:
        """Bring a workspace to the front."""
        self.do(lambda: self.window.workspaces.choose(workspace))

    def wait(self, condition: Callable[[], object], timeout_s: float = LONG_S) -> None:
        """Wait until something is so, as the window's thread sees it."""
        wait_until(lambda: self.do(condition) or WALL.sleep(0.05), timeout_s)

    def find(self, kind: type[Any], name: str = "") -> Any:
        """Return a widget of the window that is seen."""

        def seen() -> list[QWidget]:
            named = self.window.findChildren(kind, name or None)
            return [each for each in named if each.isVisible()]

        self.wait(seen, FIND_S)
        return self.do(seen)[0]

    def press(self, name: str) -> None:
        """Press the button of that name."""
        button = self.find(QWidget, name)
        self.do(lambda: QTest.mouseClick(button, Qt.MouseButton.LeftButton))

    def enter(self, field: QLineEdit, text: str) -> None:
        """Type into a field and press Enter."""

        def type_it() -> None:
            field.setFocus()
            field.selectAll()
            QTest.keyClicks(field, text)
            QTest.keyClick(field, Qt.Key.Key_Return)

        self.do(type_it)

    def keep(self, name: str) -> None:
        """Write the window as it is after a moment."""
        WALL.sleep(SETTLED_S)
        self.do(lambda: self.window.grab().save(str(self.folder / f"{name}.png")))


def picture(*names: str, **how: Any) -> Callable[[Any], Any]:
    """Have a function make pictures of the platform that `full_platform` sets up for `how`."""

    def register(make: Any) -> Any:
        for name in names:
            MADE[name] = make
        make.how = {"sample": "three-dry", "world": "plain", **how}
        return make

    return register


@picture("operator-window", "window-set-up", "window-measure")
def workspaces(hand: Hand) -> None:
    """The window as it opens, and two more of its workspaces."""
    hand.choose(HANDLE)
    WALL.sleep(10.0)  # a full curve
    hand.keep("operator-window")
    hand.choose(SET_UP)
    hand.keep("window-set-up")
    hand.choose(MEASURE)
    hand.keep("window-measure")


@picture("look-at-a-fibre", sample=None)
def look(hand: Hand) -> None:
    """A fibre measured beside a gripper of which the image knows the place."""
    hand.choose(LOOK)
    rig = hand.rig
    rig.vico.lens.zoom_to(2.0).wait()
    rig.vico.lens.autofocus().wait()
    rig.mico["right.x"].move_to(-3000.0)
    rig.mico["right.z"].move_to(-1450.0)
    rig.vico.calibrate_stage("right").wait()
    for algorithm in ("fibres", "tips"):
        rig.vico.camera().switch(algorithm, on=True)
    wait_until(lambda: rig.vico.camera().analysis is not None, 30.0)
    WALL.sleep(4.0)
    hand.keep("look-at-a-fibre")


@picture("record-and-repeat")
def repeat(hand: Hand) -> None:
    """A trajectory that runs, with its line."""
    hand.choose(HANDLE)
    mico, path = hand.rig.mico, Path(tempfile.mkdtemp()) / "over-the-fibre.trajectory"
    mico.poses.teach("fibre", "Left assembly")
    with mico.trajectories.record(path, relative_to="fibre"):
        mico["left.z"].move_by(400.0)
        mico.move_by({"left.x": -300.0, "left.y": 150.0})
        mico["left.gripper"].steps(80)
        mico["left.z"].move_by(-400.0)
    mico.move_by({"left.x": 300.0, "left.y": -150.0})
    hand.do(lambda: hand.window.raise_panel("Trajectories"))
    panel = hand.find(TrajectoryPanel)
    hand.do(lambda: panel.open(path))
    hand.wait(lambda: panel.trajectory is not None)
    for axis in ("left.x", "left.y", "left.z"):
        mico[axis].set_closed_loop_frequency(100)
    hand.press("runTrajectory")
    hand.wait(lambda: panel.player is not None and panel.player.line > 8)
    WALL.sleep(0.5)
    hand.do(lambda: hand.window.grab().save(str(hand.folder / "record-and-repeat.png")))


def targets_of(panel: ToolPanel) -> list[QLineEdit]:
    """Return the fields of the chosen tool's targets, from x on."""
    return [each for each in panel.findChildren(QLineEdit, "toolTarget") if each.isVisible()]


@picture("path-preview")
def detour(hand: Hand) -> None:
    """A detour that is offered."""
    hand.choose(HANDLE)
    hand.rig.mico["right.x"].move_to(-4500.0)
    hand.rig.mico["left.y"].move_to(-2000.0)
    hand.rig.mico["left.x"].move_to(4000.0)
    hand.do(lambda: hand.window.top_bar.mode_requested.emit("ECM"))
    panel = hand.find(ToolPanel)
    hand.do(lambda: panel.choose("left"))
    hand.enter(hand.do(lambda: targets_of(panel)[1]), "2000")
    WALL.sleep(8.0)
    hand.keep("path-preview")


@picture("characterise-a-sample", rate=3.0)
def characterise(hand: Hand) -> None:
    """The card of the first fibre of a campaign, while the second is worked on."""
    hand.choose(CAMPAIGN)
    panel = hand.find(CampaignPanel)
    folder = Path(tempfile.mkdtemp()) / "campaign"
    hand.do(lambda: panel.use_recipe("quick"))
    hand.do(lambda: panel.folder.setText(str(folder)))
    hand.press("procedureStart")
    hand.wait(lambda: panel.campaign is not None and len(panel.campaign.fibres) > 0)
    WALL.sleep(6.0)
    hand.do(lambda: panel.show_fibre(1))
    hand.keep("characterise-a-sample")
    hand.do(lambda: panel.campaign.abort("the picture is there"))
    hand.wait(lambda: panel.campaign.over)


def prepared(make: Callable[[Hand], None], hand: Hand) -> None:
    """Make a picture on a platform that records nothing of it."""
    hand.rig.daqco.stop_recording()
    make(hand)


def main() -> None:
    """Make the pictures that are asked for, or all."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(MADE))
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    wanted = {MADE[name] for name in asked.names} or set(MADE.values())
    for make in dict.fromkeys(each for each in MADE.values() if each in wanted):
        with full_platform(campaign=False, size=SIZE, **make.how) as stand:
            hand = Hand(stand, asked.folder)
            stand.app.setQuitOnLastWindowClosed(False)
            stand.beside(partial(prepared, make, hand))


if __name__ == "__main__":
    main()
