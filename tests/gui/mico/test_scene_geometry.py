"""Camera, picking, tips and outlines of the scene, without a widget."""

from dataclasses import replace

import numpy as np
import pytest

from cosmic.mico.gui.scene.arms import moving_ends, presets, tips_mm
from cosmic.mico.gui.scene.camera import Camera, Sight
from cosmic.mico.gui.scene.content import SceneContent
from cosmic.mico.gui.scene.meshes import body_meshes, poses_mm
from cosmic.mico.gui.scene.outlines import TOP, Outlines, hull
from cosmic.mico.gui.scene.picking import Ray, pick
from gui.mico.scene_models import box, two_arms


def test_a_point_that_is_projected_lies_on_the_ray_through_its_pixel():
    camera = Camera(Sight((1.0, -2.0, 3.0), 10.0, -62.0, 30.0))
    point = np.array([[4.0, 1.0, 2.0]])
    (right, down), depth = camera.project(point, 640, 480)[0][0], camera.project(point, 640, 480)[1]
    origin, way = camera.ray(right, down, 640, 480)
    along = (point[0] - origin) @ way
    assert depth[0] > 0.0
    assert np.allclose(origin + along * way, point[0], atol=1e-9)


@pytest.mark.parametrize("azimuth", [-90.0, 0.0, 45.0])
def test_the_matrices_of_the_camera_agree_with_where_it_says_points_are_seen(azimuth):
    camera = Camera(Sight((1.0, -2.0, 3.0), 10.0, azimuth, 20.0))
    point = np.array([4.0, 1.0, 2.0])
    clip = camera.projection(640, 480) @ camera.view() @ np.append(point, 1.0)
    seen = camera.project(point[None], 640, 480)[0][0]
    assert np.allclose(((clip[0] / clip[3] + 1) * 320, (1 - clip[1] / clip[3]) * 240), seen)


def test_a_ball_of_the_radius_of_the_sight_fits_into_the_view():
    camera = Camera(Sight((0.0, 0.0, 0.0), 10.0, -90.0, 0.0))
    at_edge = camera.project(np.array([[0.0, 0.0, 9.5], [9.5, 0.0, 0.0]]), 640, 480)[0]
    assert 0.0 < at_edge[0, 1] < 20.0
    assert at_edge[1, 0] < 640.0


def test_what_stands_far_before_the_centre_is_cut_away():
    sight = Sight((0.0, 0.0, 0.0), 10.0, -90.0, 0.0)
    origin, _ = Camera(sight).ray(320, 240, 640, 480)
    assert np.allclose(origin, (0.0, -sight.cut_mm, 0.0))


def test_turning_never_goes_over_the_top():
    camera = Camera().orbit(0.0, 500.0)
    assert camera.sight.elevation_deg == 90.0


def test_the_ends_of_the_arms_are_their_jaws_and_the_plate():
    ends = {end.body: (end.arm, end.travels) for end in moving_ends(two_arms())}
    assert ends == {
        "plate": ("table", False),
        "left_jaw": ("left", True),
        "right_jaw": ("right", True),
    }


def test_the_tip_of_a_jaw_is_its_end_away_from_its_carriage():
    model = two_arms()
    tips = tips_mm(model, body_meshes(model), model.bodies)
    world = dict(zip(model.bodies, poses_mm(model, {}), strict=True))
    place = world["left_jaw"][:3, 3] + tips["left_jaw"]
    assert np.allclose(place, (-4.0, 0.0, 2.25))


def test_home_shows_the_tips_and_not_the_whole_frame():
    content = SceneContent()
    content.set_model(two_arms())
    home = content.sight(content.presets[0])
    assert np.allclose(home.centre_mm, (0.0, 0.0, 2.25))
    assert 4.0 < home.radius_mm < 50.0


def test_every_arm_has_a_close_up():
    names = [preset.name for preset in presets(two_arms())]
    assert names == ["home", "top", "front", "side", "left", "right"]


def test_the_nearest_body_on_the_line_of_sight_is_picked():
    model = two_arms()
    meshes = body_meshes(model)
    poses = dict(zip(model.bodies, poses_mm(model, {}), strict=True))
    down = Ray(np.array([-6.0, 0.0, 40.0]), np.array([0.0, 0.0, -1.0]))
    assert pick(meshes, poses, down) == "left_jaw"
    assert pick(meshes, poses, down, {"left_jaw"}) == "plate"
    assert pick(meshes, poses, Ray(np.array([0.0, 0.0, 40.0]), np.array([0.0, 0.0, 1.0]))) == ""


def test_a_body_whose_box_only_is_met_hides_nothing():
    model = two_arms()
    views = (
        box("floor", "frame", (-5e3, -5e3, -1e3), (5e3, 5e3, 0.0)),
        box("tower", "frame", (4e3, 4e3, 0.0), (5e3, 5e3, 30e3)),
        box("foot", "plate", (-5e3, -5e3, 1e3), (-4e3, 5e3, 2e3)),
        box("shelf", "plate", (-5e3, 4e3, 1e3), (5e3, 5e3, 20e3)),
    )
    meshes = body_meshes(replace(model, views=views))
    poses = dict(zip(model.bodies, poses_mm(model, {}), strict=True))
    ray = Ray(np.array([0.0, 0.0, 40.0]), np.array([0.0, 0.0, -1.0]))
    assert pick(meshes, poses, ray) == "frame"


def test_an_outline_follows_its_body_when_it_slides_and_when_it_turns():
    mesh = body_meshes(two_arms())["plate"]
    outlines, pose = Outlines(), np.eye(4)

    def box() -> tuple[float, float, float, float]:
        seen = outlines.of(mesh, pose, TOP)[0]
        return seen.shape_mm.translated(*seen.shift_mm).boundingRect().getCoords()

    assert box() == pytest.approx((-12.0, -8.0, 12.0, 8.0))
    pose[:3, 3] = 5.0, 0.0, 1.0
    assert box() == pytest.approx((-7.0, -8.0, 17.0, 8.0))
    assert outlines.of(mesh, pose, TOP)[0].nearest_mm == pytest.approx(1.0)
    pose[:2, :2] = (0.0, -1.0), (1.0, 0.0)
    assert box() == pytest.approx((-3.0, -12.0, 13.0, 12.0))


@pytest.mark.parametrize("points", [[(1.0, 2.0)], [(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)]])
def test_a_hull_of_a_flat_cloud_is_no_error(points):
    assert set(map(tuple, hull(np.array(points)))) <= set(points)


def test_a_body_without_view_shapes_is_drawn_by_its_collision_pieces():
    model = two_arms()
    piece = box("hidden wall", "left_x", (0.0, 0.0, 0.0), (1e3, 1e3, 1e3))
    seen = body_meshes(replace(model, pieces=(piece,)))
    assert "left_x" in seen


def test_normals_are_sharp_at_the_edges_of_a_box():
    normals = body_meshes(two_arms())["plate"].normals
    assert np.allclose(np.abs(normals).max(axis=2), 1.0)
