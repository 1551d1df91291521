"""Makes the images of the pages anew: ``python docs/make_images.py [NAME...]``, all without a name.

Each scene opens the window over a simulated platform, does what its page describes, and saves what
is seen into docs/images. Look at every image before you commit it.
"""

import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Final

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

from PySide6.QtCore import QCoreApplication, QEvent, QPointF, QSettings, Qt
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QLineEdit, QMenu, QPushButton, QWidget

from cosmic.app.panels.campaign.panel import CampaignPanel
from cosmic.app.platform import build_platform
from cosmic.app.rig import Rig
from cosmic.app.windows.fibre_menu import FibreOperations
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.app.windows.tasks import CAMPAIGN, HANDLE, LOOK, MEASURE, SET_UP, TaskLayout
from cosmic.daqco.gui.main_widget import make_daqco_gui
from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.theme import State
from cosmic.frame.log import RingBufferHandler, set_up_logging
from cosmic.frame.threads import declare_gui_thread
from cosmic.mico.gui.mico_widget import make_mico_gui
from cosmic.vico.gui.vico_gui import make_vico_gui

IMAGES: Final = Path(__file__).parent / "images"
SIZE: Final = (1366, 768)
LONGEST_S: Final = 900.0
FAST: Final = 8.0
"""Rate of the scene that takes minutes."""


class Scene:
    """A window over a simulated platform, and what a scene needs of it."""

    def __init__(
        self,
        app: QApplication,
        folder: Path,
        *,
        cold: bool = False,
        sample: str | None = None,
        rate: float = 1.0,
    ) -> None:
        self._app = app
        ring = RingBufferHandler()
        self._undo = set_up_logging(ring)
        platform = build_platform(
            None,
            applications=("mico", "daqco", "vico"),
            world="plain",
            cold=cold,
            sample=sample,
            rate=rate,
            mico_gui=make_mico_gui,
            daqco_gui=make_daqco_gui,
            vico_gui=make_vico_gui,
        )
        settings = QSettings(str(folder / "window.ini"), QSettings.Format.IniFormat)
        self.window = OperatorWindow(platform, settings, ring)
        self.rig = Rig(platform)
        self.folder = folder
        self.window.resize(*SIZE)
        self.window.show()
        self.window.resize(*SIZE)
        self.window.open_hardware()
        self.until(lambda: self.rig.mico.ready)
        self.wait(2.0)

    @property
    def tasks(self) -> TaskLayout:
        """What the workspaces are made of."""
        if self.window.tasks is None:
            raise RuntimeError("the window has no workspaces")
        return self.window.tasks

    def choose(self, workspace: str) -> None:
        """Show a workspace."""
        if self.window.workspaces is not None:
            self.window.workspaces.choose(workspace)
        self.wait(1.0)

    def wait(self, seconds: float) -> None:
        """Let the window live for a while."""
        ends = time.monotonic() + seconds
        while time.monotonic() < ends:
            self._app.processEvents()
            # Left to a loop that runs: what is deleted later, such as tabs of another workspace.
            QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)
            threading.Event().wait(0.005)

    def until(self, condition: Callable[[], bool]) -> None:
        """Let the window live until something is so."""
        ends = time.monotonic() + LONGEST_S
        while not condition():
            if time.monotonic() > ends:
                raise TimeoutError("what a scene waits for did not happen")
            self.wait(0.02)

    def behind(self, action: Callable[[], object]) -> None:
        """Do what a script does, which blocks, while the window lives."""
        thread = threading.Thread(target=action)
        thread.start()
        self.until(lambda: not thread.is_alive())

    def save(self, name: str, menu: QMenu | None = None) -> None:
        """Save what is seen; `menu` lies over it, with its corner where it was opened."""
        self.wait(0.5)
        book = self.tasks.book
        for number, each in enumerate(book.alarms):
            if each.source == "processor":  # of the computer that makes the images
                book.acknowledge(number)
        image = self.window.grab()
        if menu is not None:
            with painting(image) as painter:
                painter.drawPixmap(self.window.mapFromGlobal(menu.pos()), menu.grab())
        image.save(str(IMAGES / f"{name}.png"))

    def close(self) -> None:
        """Close the window."""
        self.window.close_now()
        self._undo()


def operator_window(scene: Scene) -> None:
    """Handle, with the image and the force."""
    scene.choose(LOOK)
    scene.wait(2.0)
    scene.choose(HANDLE)
    scene.wait(2.0)
    scene.save("operator-window")


def window_set_up(scene: Scene) -> None:
    """All axes as a table."""
    scene.choose(SET_UP)
    scene.save("window-set-up")


def window_measure(scene: Scene) -> None:
    """Ten seconds of force."""
    scene.choose(LOOK)
    scene.wait(1.0)
    scene.choose(MEASURE)
    scene.wait(10.0)
    scene.save("window-measure")


def _before_the_probe(scene: Scene) -> None:
    """Bring the fibre of the left gripper in front of the probe."""

    def bring() -> None:
        scene.rig.mico.move({"left.z": -800.0, "left.x": 3600.0})
        scene.rig.mico["probe.y"].move_to(-4950.0)

    scene.behind(bring)


def window_results(scene: Scene) -> None:
    """Show a push that was recorded, with its images."""
    _before_the_probe(scene)
    scene.choose(MEASURE)
    home = scene.folder / "sessions"
    scene.tasks.folder.home = home
    folder = home / "2026-11-23_10-12"
    folder.mkdir(parents=True)
    (folder / "session.toml").write_text('sample = "pine kraft"\noperator = "A. Lab"\n')
    rig = scene.rig
    log = scene.tasks.folder.on_made
    if log is not None:
        log(folder)

    def push() -> None:
        camera = rig.vico.camera()
        camera.next_image(20.0)
        probe = rig.mico["probe.y"]
        probe.set_closed_loop_frequency(30)
        rig.daqco.start_recording(folder / "push.h5", before_s=1.0)
        camera.record(folder / "push-images")
        probe.move_to(-5050.0)
        rig.daqco.mark("turned")
        probe.move_to(-4950.0)
        camera.stop_recording(wait=True)
        rig.daqco.stop_recording()

    scene.behind(push)
    results = scene.tasks.results
    scene.choose("Results")
    results.sessions.show_file(folder / "push.h5")
    scene.until(lambda: bool(results.viewer.timelines))
    results.viewer.curves.cursors.setRegion((2.0, 3.0))
    results.viewer.show_moment(2.5)
    scene.wait(2.0)
    scene.save("window-results")


def initialise(scene: Scene) -> None:
    """Show the second step of the initialisation."""
    scene.choose(SET_UP)
    gui = scene.window.mico_gui
    if gui is None:
        raise RuntimeError("the window has no axes")
    running = scene.rig.mico.initialise(wait=False)
    scene.until(lambda: running.progress.fraction >= 0.1)
    scene.save("initialise")
    running.cancel()
    scene.wait(1.0)


def first_day(scene: Scene) -> None:
    """Show what a platform misses on its first day."""
    scene.choose(LOOK)
    scene.window.raise_panel("First day")
    scene.wait(2.0)
    scene.save("first-day")


def measure_a_force(scene: Scene) -> None:
    """Show how the limit stopped the probe."""
    _before_the_probe(scene)
    scene.choose(LOOK)
    scene.choose(MEASURE)
    scene.rig.daqco.arm_limit("force", high=140.0, hysteresis=10.0)
    scene.rig.mico["probe.y"].set_closed_loop_frequency(30)
    scene.rig.mico["probe.y"].move_to(-5200.0, wait=False)
    scene.until(lambda: scene.rig.daqco.limits[0].crossed)
    scene.wait(1.5)
    scene.save("measure-a-force")


def scene_refused(scene: Scene) -> None:
    """Show a refused move, and where it would have led."""
    scene.choose(HANDLE)
    scene.window.raise_panel("Scene")
    tool = scene.tasks.tool
    tool.step.setText("4000")
    scene.wait(1.0)
    tool.pad["z", -1].click()
    scene.until(tool.nearest.isVisible)
    scene.wait(1.0)
    scene.save("scene-refused")


def steer_with_a_gamepad(scene: Scene) -> None:
    """Show what a hand feels of the fibre."""
    _before_the_probe(scene)
    scene.choose(HANDLE)
    scene.window.raise_panel("Teleoperation")
    steering = scene.rig.mico.teleoperation
    steering.start("haptic:sim", "probe, haptic")
    scene.wait(0.5)
    move_hand = getattr(steering.device, "move_hand", None)  # the simulated device has a hand
    if callable(move_hand):
        move_hand(y=-0.6)
    scene.wait(2.5)
    scene.save("steer-with-a-gamepad")
    steering.stop()


def look_at_a_fibre(scene: Scene) -> None:
    """Show the fibres measured."""
    scene.choose(LOOK)
    view = scene.tasks.central_view.camera
    view.camera.switch("fibres", on=True)
    scene.window.raise_panel("Camera")
    scene.until(lambda: view.camera.analysis is not None)
    scene.wait(2.0)
    scene.save("look-at-a-fibre")


def record_and_repeat(scene: Scene) -> None:
    """Show a trajectory at its third line."""
    scene.choose(HANDLE)
    scene.window.raise_panel("Trajectories")
    mico = scene.rig.mico
    mico["left.x"].set_closed_loop_frequency(100)

    def record() -> None:
        with mico.trajectories.record(scene.folder / "over.trajectory", timed=False):
            mico["left.z"].move_by(400.0)
            mico.move_by({"left.x": -300.0, "left.y": 150.0})
            mico["left.z"].move_by(-400.0)
        mico.move({"left.x": 0.0, "left.y": 0.0})

    scene.behind(record)
    panel = scene.window.motion_tabs
    if panel is None:
        raise RuntimeError("the window has no trajectories")
    panel.trajectories.open(scene.folder / "over.trajectory")
    scene.until(lambda: panel.trajectories.trajectory is not None)
    step = panel.trajectories.findChild(QPushButton, "step")
    if step is None:
        raise RuntimeError("the panel has no button Step")
    step.click()
    scene.wait(2.0)
    scene.save("record-and-repeat")


def path_preview(scene: Scene) -> None:
    """Show a detour that is offered."""
    mico, tool = scene.rig.mico, scene.tasks.tool

    def bring() -> None:
        mico["right.x"].move_to(-4500.0)
        mico["left.y"].move_to(-2000.0)
        mico["left.x"].move_to(4000.0)

    scene.behind(bring)
    scene.choose(HANDLE)
    scene.window.top_bar.mode_requested.emit("ECM")
    tool.choose("left")
    scene.wait(1.0)
    scene.window.raise_panel("Scene")
    (target,) = (
        each for each in _targets(tool) if each.accessibleName().startswith("Target of left.y")
    )
    target.setFocus()
    target.selectAll()
    QTest.keyClicks(target, "2000")
    QTest.keyClick(target, Qt.Key.Key_Return)
    scene.wait(8.0)
    scene.save("path-preview")


def _targets(tool: QWidget) -> list[QLineEdit]:
    return [each for each in tool.findChildren(QLineEdit, "toolTarget") if each.isVisible()]


def characterise_a_sample(scene: Scene) -> None:
    """Show the first fibre of a campaign, while the second is worked on."""
    scene.choose(CAMPAIGN)
    panel = scene.window.findChild(CampaignPanel)
    if panel is None:
        raise RuntimeError("the window has no campaigns")
    panel.use_recipe("quick")
    panel.folder.setText(str(scene.folder / "quick"))
    panel.procedure.start.click()
    scene.until(lambda: panel.campaign is not None and len(panel.campaign.fibres) > 0)
    scene.wait(3.0)
    panel.show_fibre(1)
    scene.wait(1.0)
    panel.folder.setText("campaigns/quick")
    scene.save("characterise-a-sample")
    if panel.campaign is not None:
        campaign = panel.campaign
        campaign.abort("the image is there")
        scene.until(lambda: campaign.over)


def _done(scene: Scene, title: str) -> None:
    """Wait until an operation on a fibre has ended, well."""
    operations = scene.tasks.operations
    if operations is None:
        raise RuntimeError("the window has no operations on fibres")
    scene.until(lambda: not operations.running and title in operations.card.title.text())
    scene.wait(0.5)
    if operations.card.badge.state is not State.OK:
        raise RuntimeError(f"{title}: {operations.card.line.text()}")


def _take(scene: Scene, operations: FibreOperations) -> None:
    """Right-click the longest fibre, show what the menu offers, and take it."""
    view = scene.tasks.central_view.camera
    found = view.camera.analysis
    if found is None:
        raise RuntimeError("no fibre was found")
    fibre = max((e for e in found.fibres if e.certain), key=lambda each: each.length_px)
    x, y = fibre.centre_line_px[len(fibre.centre_line_px) // 2]
    menu = QMenu(view)
    operations.offer(view, menu, (float(x), float(y)))
    menu.popup(view.view.mapToGlobal(view.view.to_screen.map(QPointF(x, y)).toPoint()))
    take = next(each for each in menu.actions() if each.text() == "Take with left")
    menu.setActiveAction(take)
    take.hover()
    scene.save("tour-take", menu)
    menu.close()
    take.trigger()
    scene.wait(5.0)
    scene.save("tour-running")


def tour(scene: Scene) -> None:
    """Pick up a fibre, bend it to 50 uN, record that, read the slope: the README's pictures."""
    scene.choose(LOOK)
    scene.choose(HANDLE)
    tasks, operations = scene.tasks, scene.tasks.operations
    view = tasks.central_view.camera
    if operations is None or tasks.force is None:
        raise RuntimeError("the window has no operations on fibres")
    tasks.folder.home = scene.folder / "sessions"
    operations.find(view, on=True)
    scene.until(lambda: any(e.certain for e in getattr(view.camera.analysis, "fibres", ())))
    scene.wait(1.0)
    _take(scene, operations)
    _done(scene, "Take with left")
    scene.save("tour-held")
    operations.card.next.click()
    _done(scene, "Bring to the probe")
    scene.choose(MEASURE)
    tasks.force.record.click()
    scene.until(tasks.force.record.isChecked)
    operations.card.push.click()
    _done(scene, "Push to 50")
    scene.save("handle-a-fibre")
    recording = scene.rig.daqco.recording.path
    tasks.force.record.click()
    scene.until(lambda: not scene.rig.daqco.recording.active)
    scene.choose("Results")
    if recording is not None:
        tasks.results.sessions.show_file(recording)
    scene.until(lambda: bool(tasks.results.viewer.timelines))
    scene.wait(2.0)
    scene.save("tour-results")


SCENES: Final[dict[str, Callable[[Scene], None]]] = {
    "operator-window": operator_window,
    "window-set-up": window_set_up,
    "window-measure": window_measure,
    "window-results": window_results,
    "initialise": initialise,
    "first-day": first_day,
    "measure-a-force": measure_a_force,
    "scene-refused": scene_refused,
    "steer-with-a-gamepad": steer_with_a_gamepad,
    "look-at-a-fibre": look_at_a_fibre,
    "record-and-repeat": record_and_repeat,
    "path-preview": path_preview,
    "characterise-a-sample": characterise_a_sample,
    "tour": tour,
}


def main(names: list[str]) -> int:
    """Make the images of these scenes; all without a name."""
    unknown = [name for name in names if name not in SCENES]
    if unknown:
        sys.stderr.write(f"no scene {unknown[0]!r}; there are {', '.join(SCENES)}\n")
        return 2
    app = QApplication([])
    end = declare_gui_thread()
    for name in names or list(SCENES):
        with tempfile.TemporaryDirectory() as folder:
            on_the_plate = name in ("tour", "look-at-a-fibre", "characterise-a-sample")
            scene = Scene(
                app,
                Path(folder),
                cold=name in ("initialise", "first-day"),
                sample="three-dry" if on_the_plate else None,
                rate=FAST if name in ("tour", "characterise-a-sample") else 1.0,
            )
            try:
                SCENES[name](scene)
            finally:
                scene.close()
    end()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
