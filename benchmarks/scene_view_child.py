"""The process that `benchmarks.scene_view` starts on a display: paints the scene and times it."""

import json
import sys
import time

import numpy as np
from PySide6.QtCore import QPointF
from PySide6.QtWidgets import QApplication

from cosmic.frame.gui.theme import apply_theme
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.model import Drive, Joint, JointKind, SceneModel, Shape
from cosmic.mico.gui.scene.scene_widget import SceneWidget

SIZE_PX = (500, 460)
LARGE_PX = (1000, 760)
ARMS, LINKS = 4, 7


def ball(name: str, body: str, triangles: int) -> Shape:
    """Return a closed mesh with about that many triangles: an ellipsoid along x."""
    rings = max(3, round((triangles / 4.0) ** 0.5))
    around = 2 * rings
    turn = np.arange(around) * 2.0 * np.pi / around
    tilt = np.linspace(0.0, np.pi, rings + 1)[1:-1]
    ring = np.stack(
        [np.ones((rings - 1, 1)) * np.cos(turn), np.ones((rings - 1, 1)) * np.sin(turn)]
    )
    inner = np.stack(
        [
            np.cos(tilt)[:, None] + 0 * ring[0],
            np.sin(tilt)[:, None] * ring[0],
            np.sin(tilt)[:, None] * ring[1],
        ],
        axis=-1,
    )
    vertices = np.concatenate([inner.reshape(-1, 3), [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]])
    count = len(vertices)
    faces = []
    for row in range(rings - 2):
        for each in range(around):
            a, b = row * around + each, row * around + (each + 1) % around
            faces += [(a, a + around, b), (b, a + around, b + around)]
    last = (rings - 2) * around
    for each in range(around):
        after = (each + 1) % around
        faces += [(count - 2, each, after), (count - 1, last + after, last + each)]
    sizes_um = np.array([8e3, 3e3, 3e3])
    return Shape(name, body, vertices * sizes_um, np.array(faces, dtype=np.int32))


def platform(triangles: int) -> SceneModel:
    """Return four arms of seven bodies around a plate of glass, with that many triangles in all."""
    each = triangles // (ARMS * LINKS + 1)
    bodies, joints, views, drives = ["frame"], [], [], []
    for arm in range(ARMS):
        parent = "frame"
        angle = arm * 2.0 * np.pi / ARMS
        for link in range(LINKS):
            name, place = f"arm{arm}_{link}", np.eye(4)
            if link == 0:
                place[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
                place[:2, 3] = -50e3 * np.cos(angle), -50e3 * np.sin(angle)
            else:
                place[0, 3] = 6e3
            way = np.eye(3)[link % 3]
            joints.append(Joint(name, JointKind.PRISMATIC, parent, name, place, way, -1e4, 1e4))
            drives.append(Drive(f"arm{arm}.{link}", name, 1.0, 0.0))
            views.append(ball(name, name, each))
            bodies.append(name)
            parent = name
    plate = ball("plate", "frame", each)
    views.append(Shape("plate", "frame", plate.vertices_um * 2, plate.faces, (0.7, 0.9, 0.9, 0.4)))
    return SceneModel(
        "generated", tuple(bodies), tuple(joints), (), tuple(views), tuple(drives), ()
    )


def frame_times_s(scene: SceneWidget, frames: int) -> list[float]:
    """Return how long each frame takes with every body moving and another nearest pair."""
    model = scene.content.model
    assert model is not None
    found = []
    for number in range(frames):
        began_s = time.perf_counter()
        scene.set_positions(dict.fromkeys(model.axes, 50.0 * number))
        x_um = 50.0 * number
        scene.set_nearest(Approach(("arm0_6", "frame"), x_um, ((x_um, 0.0, 1e3), (x_um, 0.0, 0.0))))
        scene.repaint()
        found.append(time.perf_counter() - began_s)
    return found


def hover_times_s(scene: SceneWidget, count: int) -> list[float]:
    """Return how long it takes to find the body under the cursor."""
    places = np.random.default_rng(0).random((count, 2)) * (scene.view.width(), scene.view.height())
    found = []
    for x, y in places:
        began_s = time.perf_counter()
        scene.view.body_at(QPointF(x, y))
        found.append(time.perf_counter() - began_s)
    return found


def measured(kind: str, size_px: tuple[int, int], triangles: int, frames: int) -> dict[str, object]:
    """Return the times of one kind of view."""
    scene = SceneWidget(prefer_gl=kind == "gl")
    scene.set_model(platform(triangles))
    scene.resize(*size_px)
    scene.show()
    QApplication.processEvents()
    frame_times_s(scene, 3)
    result: dict[str, object] = {
        "view": type(scene.view).__name__,
        "triangles": scene.content.triangles,
        "frames_s": frame_times_s(scene, frames),
        "hover_s": hover_times_s(scene, frames),
    }
    scene.close()
    scene.deleteLater()
    return result


if __name__ == "__main__":
    app = QApplication([])
    apply_theme(app, "dark")
    wanted = int(sys.argv[1])
    sys.stdout.write(
        json.dumps(
            {
                "gl small": measured("gl", SIZE_PX, 3_000, wanted),
                "gl": measured("gl", SIZE_PX, 30_000, wanted),
                "gl large": measured("gl", LARGE_PX, 30_000, wanted),
                "projections": measured("projections", SIZE_PX, 30_000, wanted),
            }
        )
        + "\n"
    )
