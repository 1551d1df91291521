"""What `test_scene_gl.py` runs on a display of its own: one named check, or all in turn.

Anything that Qt says, and any warning, ends it with an error.
"""

import gc
import itertools
import sys
import warnings

import numpy as np
from PySide6.QtCore import QEvent, QPointF, qInstallMessageHandler, qWarning
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QApplication, QDockWidget, QMainWindow

warnings.simplefilter("error")
said: list[str] = []
qInstallMessageHandler(lambda _kind, _where, text: said.append(text))

from cosmic.frame.gui.theme import apply_theme  # noqa: E402
from cosmic.mico.core.collision.answer import Approach  # noqa: E402
from cosmic.mico.gui.scene.projection_view import ProjectionView  # noqa: E402
from cosmic.mico.gui.scene.scene_widget import SceneWidget  # noqa: E402
from gui.mico.scene_models import two_arms  # noqa: E402


def made(*, show=True):
    scene = SceneWidget()
    scene.set_model(two_arms())
    scene.resize(500, 400)
    if show:
        scene.show()
        QApplication.processEvents()
    return scene


def picture(scene):
    image = scene.view.grab().toImage()
    image = image.convertToFormat(image.Format.Format_RGBX8888)
    data = np.frombuffer(image.constBits(), np.uint8)
    return data.reshape(image.height(), image.width(), 4)[:, :, :3].astype(int)


def gone(*widgets):
    for widget in widgets:
        widget.close()
        widget.deleteLater()
    QApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)
    gc.collect()
    QApplication.processEvents()


def like(scene, colour, reach=90):
    wanted = np.array(QColor(colour).getRgb()[:3])
    return int((np.abs(picture(scene) - wanted).sum(axis=2) < reach).sum())


def draws_in_opengl():
    scene = made()
    assert type(scene.view).__name__ == "GLSceneView", type(scene.view)
    assert picture(scene).std() > 10.0
    gone(scene)


def lights_faces_that_look_upwards():
    scene = made()
    scene.look("top")
    x, y = scene.view._project(np.array([[-10.0, 0.0, 2.5]]))[0]
    assert picture(scene)[round(y), round(x)].min() > 110  # of 178, the grey of the jaw
    gone(scene)


def moves_and_paints_only_then():
    scene = made()
    before, painted = picture(scene), scene.view.frames
    scene.set_positions({"left.x": 0.0})
    assert (picture(scene) == before).all()
    assert scene.view.frames == painted
    scene.set_positions({"left.x": 3000.0})
    assert (picture(scene) != before).any()
    assert scene.view.frames == painted + 1
    gone(scene)


def shows_and_clears_a_ghost():
    scene = made()
    before = picture(scene)
    scene.show_refused(
        Approach(("left_jaw", "plate"), 0.0, ((0, 0, 0), (0, 0, 0)), pose={"left.y": 6000.0})
    )
    QApplication.processEvents()
    assert set(scene.content.ghosts) == {"left_z", "left_jaw"}
    assert (picture(scene) != before).any()
    scene.clear_refused()
    QApplication.processEvents()
    assert (picture(scene) == before).all()
    gone(scene)


def stripes_what_is_not_watched_and_hides_what_is_hidden():
    scene = made()
    before = like(scene, "#F0E442", 200)
    scene.set_unwatched(["left_z"])
    assert like(scene, "#F0E442", 200) > before + 100
    shown = picture(scene)
    scene.restore_state({"hidden": ["left_z"]})
    assert (picture(scene) != shown).any()
    gone(scene)


def names_the_body_that_is_drawn_under_the_cursor():
    scene = made()
    for place, body in (((-10.0, 0.0, 2.5), "left_jaw"), ((0.0, 7.0, 0.0), "plate")):
        x, y = scene.view._project(np.array([place]))[0]
        assert scene.view.body_at(QPointF(x, y)) == body
    gone(scene)


def turns_shifts_and_zooms():
    scene = made()
    pictures = [picture(scene)]
    scene.view.drag(QPointF(10, 10), QPointF(60, 30), turn=True)
    pictures.append(picture(scene))
    scene.view.drag(QPointF(10, 10), QPointF(60, 30), turn=False)
    pictures.append(picture(scene))
    for one, other in itertools.pairwise(pictures):
        assert (one != other).any()
    gone(scene)


def opens_and_closes_many_times():
    for _ in range(20):
        scene = made()
        assert picture(scene).std() > 10.0
        gone(scene)


def two_at_once_do_not_disturb_each_other():
    one, other = made(), made()
    alike = picture(one)
    assert (picture(other) == alike).all()
    gone(one)
    other.set_positions({"left.x": 1.0})
    assert picture(other).std() > 10.0
    gone(other)


def survives_its_dock_being_taken_out():
    window, dock = QMainWindow(), QDockWidget("Scene")
    scene = made(show=False)
    dock.setWidget(scene)
    window.addDockWidget(dock.allowedAreas().LeftDockWidgetArea, dock)
    window.show()
    for floating in (True, False, True):
        dock.setFloating(floating)
        QApplication.processEvents()
        scene.set_positions({"left.x": 100.0 * floating})
        assert picture(scene).std() > 10.0
    gone(window)


def can_be_closed_and_shown_again():
    scene = made()
    before = picture(scene)
    scene.close()
    scene.show()
    QApplication.processEvents()
    assert (picture(scene) == before).all()
    gone(scene)


def gives_way_to_projections_when_it_fails():
    scene = made()
    scene.view.failed.emit("the graphics card is gone")
    QApplication.processEvents()
    assert isinstance(scene.view, ProjectionView)
    assert "the graphics card is gone" in scene.view.reason
    assert picture(scene).std() > 5.0
    gone(scene)


def gives_way_when_the_light_does_not_compile():
    scene = made(show=False)
    for shader in scene.view._items_view.shader(stripes=False).shaders:
        shader.code = "nonsense"
    scene.show()
    for _ in range(3):
        QApplication.processEvents()
    assert isinstance(scene.view, ProjectionView)
    assert picture(scene).std() > 5.0
    gone(scene)


CHECKS = {
    name: check
    for name, check in list(globals().items())
    if callable(check) and getattr(check, "__module__", "") == "__main__" and name not in (
        "made", "picture", "gone", "like"
    )
}  # fmt: skip

if __name__ == "__main__":
    app = QApplication([])
    apply_theme(app, "dark")
    if sys.argv[1] == "without":
        scene = made()
        assert isinstance(scene.view, ProjectionView), type(scene.view)
        assert "no OpenGL" in scene.view.reason
        gone(scene)
    else:
        for check in CHECKS.values() if sys.argv[1] == "all" else [CHECKS[sys.argv[1]]]:
            check()
    assert not said, said
    qWarning("still heard")
    assert said == ["still heard"], "the message handler was not put back"
    sys.stdout.write("fine\n")
