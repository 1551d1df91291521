"""The whole simulated platform seen by its cameras, checked against what the twin knows."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from shutil import copytree
from typing import Any
from unittest.mock import patch

import numpy as np
import numpy.typing as npt
import pytest

import cosmic
from cosmic.app.platform import build_platform
from cosmic.app.stations import hosting
from cosmic.autonomy.coordinate_transform import PlatformTransform
from cosmic.frame.config import shipped_config_dir
from cosmic.frame.errors import MoveCancelled
from cosmic.twin.scene import Scene
from cosmic.vico.api import find_fibres
from cosmic.vico.api.camera_shown import Seen
from cosmic.vico.core.camera_thread import CameraThread
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.recording.reading import open_image_recording
from cosmic.vico.hw.interface import CameraLibrary, Roi
from cosmic.vico.hw.sim_camera import SimulatedCameraLibrary
from unit.mico.rigs import wait_until

Floats = npt.NDArray[np.float64]

NEAR_UM = 5.0
HEIGHT_UM = 50.0
JAW_PX = 30.0
"""Narrower is a fibre, in these images."""


@dataclass
class Lab:
    """A rig, and what only its twin knows."""

    rig: cosmic.Rig
    scene: Scene
    cameras: SimulatedCameraLibrary

    @property
    def now_s(self) -> float:
        return self.scene.clock.now_s()

    def tip_px(self, what: str = "right", roi: Roi | None = None) -> Floats:
        """Where the tip truly lies in the image now."""
        optics = self.scene.optics
        assert optics is not None
        tip = self.scene.tips(self.now_s)[f"{what}.hold"]
        low = (tip[0], tip[1], tip[2] - 10.0)  # the fibre is held above the jaws' lower edges
        return optics.world_to_image_px(low, self.now_s, roi)

    def fibre_um(self, length_um: float) -> Floats:
        """The true line of the fibre of that length."""
        optics = self.scene.optics
        assert optics is not None
        return min(
            optics.centre_lines_um(self.now_s), key=lambda line: abs(length(line) - length_um)
        )


def length(line: Floats) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped platform, with a folder for what is calibrated."""
    folder = tmp_path_factory.mktemp("vision")
    copytree(shipped_config_dir(), folder, dirs_exist_ok=True)
    file = folder / "platform.toml"
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace('calibration = ""', 'calibration = "measured"'), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def lab(config: Path) -> Iterator[Lab]:
    scenes: list[Scene] = []
    libraries: list[CameraLibrary] = []
    real_scene, real_library = Scene.from_settings, hosting.make_camera_library

    def scene(*args: Any, **kwargs: Any) -> Scene:
        scenes.append(real_scene(*args, **kwargs))
        return scenes[-1]

    def library(*args: Any, **kwargs: Any) -> CameraLibrary:
        libraries.append(real_library(*args, **kwargs))
        return libraries[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Scene, "from_settings", scene)
        patch.setattr(hosting, "make_camera_library", library)
        with cosmic.connect(config, ("mico", "vico"), rate=6.0) as rig:
            zoom_to(rig, 2.0)
            rig.vico.snap()
            (cameras,) = libraries
            assert isinstance(cameras, SimulatedCameraLibrary)
            lab = Lab(rig, scenes[0], cameras)
            lower(lab)
            rig.vico.calibrate_stage("right").wait(30.0)
            patch.undo()
            yield lab


def zoom_to(rig: cosmic.Rig, zoom: float) -> None:
    assert rig.vico.lens is not None
    rig.vico.lens.zoom_to(zoom).wait(30.0)


def at_right(rig: cosmic.Rig) -> list[float]:
    return [rig.mico[f"right.{axis}"].position_um for axis in "xyz"]


def put_right(lab: Lab, x_um: float, y_um: float = 0.0) -> None:
    lab.rig.mico.move({"right.x": x_um, "right.y": y_um})


def lift(lab: Lab) -> None:
    """Lift the gripper and draw it out of the image, past the clip of the plate."""
    lab.rig.mico["right.z"].move_to(0.0)
    put_right(lab, 0.0)


def lower(lab: Lab) -> None:
    """Bring it to where it calibrated."""
    put_right(lab, -3000.0)
    lab.rig.mico["right.z"].move_to(HEIGHT_UM - 1500.0)


# ------------------------------------------------------------------ what the image says


def test_a_fibre_is_as_long_and_lies_where_the_twin_has_it(lab: Lab) -> None:
    lift(lab)
    true = lab.fibre_um(1200.0)
    fibres = lab.rig.vico.find_fibres()
    (found,) = [each for each in fibres if each.certain]
    assert found.length_um == pytest.approx(length(true), rel=0.005)
    assert found.width_um == pytest.approx(30.0, abs=2.0)
    assert found.ends_um is not None and found.centre_line_um is not None
    ends = found.ends_um if found.ends_um[0][0] < found.ends_um[1][0] else found.ends_um[::-1]
    assert np.linalg.norm(ends - true[[0, -1], :2], axis=1).max() < NEAR_UM
    finely = np.linspace(0.0, len(true) - 1.0, 2000)
    line = np.column_stack([np.interp(finely, range(len(true)), true[:, axis]) for axis in (0, 1)])
    off = [np.linalg.norm(line - place, axis=1).min() for place in found.centre_line_um]
    assert max(off) < NEAR_UM


def test_a_part_of_the_sensor_means_the_same_places(lab: Lab) -> None:
    camera = lab.rig.vico.camera()
    whole = camera.next_image()
    there = camera.platform_um((700.0, 500.0))
    settings = camera.settings
    assert settings is not None
    camera.configure(replace(settings, roi=Roi(200, 100, 800, 600))).wait(10.0)
    try:
        part = camera.next_image()
        assert part.data.shape == (600, 800) != whole.data.shape
        assert not camera.calibration_problem
        assert camera.platform_um((500.0, 400.0)) == pytest.approx(there)
    finally:
        camera.configure(settings).wait(10.0)
        camera.next_image()


def test_at_a_zoom_without_calibration_no_position_is_given(lab: Lab) -> None:
    zoom_to(lab.rig, 1.0)
    try:
        camera = lab.rig.vico.camera()
        camera.next_image()
        assert "zoom" in camera.calibration_problem
        assert camera.platform_um((700.0, 500.0)) is None
        stood = at_right(lab.rig)
        with pytest.raises(cosmic.NotAvailable, match="zoom"):
            camera.click_to_move((900.0, 600.0), "right")
        assert at_right(lab.rig) == stood
    finally:
        zoom_to(lab.rig, 2.0)
        lab.rig.vico.snap()


def analysed_with(lab: Lab, link: str) -> Seen:
    """Return what is found on an image that is taken once a link of the chain is on."""
    camera = lab.rig.vico.camera()
    camera.switch(link, on=True)
    try:
        since = camera.next_image().frame.frame_id
        wait_until(
            lambda: camera.analysis is not None and camera.analysis.image.frame.frame_id > since
        )
        assert camera.analysis is not None
        return camera.analysis
    finally:
        camera.switch(link, on=False)


def test_the_tips_are_seen_where_stages_and_calibration_expect_them(lab: Lab) -> None:
    lower(lab)
    (tip,) = analysed_with(lab, "tips").tips
    assert tip.name == "right"
    assert tip.certain
    assert tip.point_px == pytest.approx(lab.tip_px(), abs=1.5)


def test_jaws_are_no_fibres_where_the_calibration_has_them(lab: Lab) -> None:
    lower(lab)
    image = lab.rig.vico.camera().next_image()
    assert sum(each.width_px > JAW_PX for each in find_fibres(image.data)) == 2
    for found in (analysed_with(lab, "fibres").fibres, lab.rig.vico.find_fibres()):
        assert found
        assert max(each.width_px for each in found) < JAW_PX


def test_tools_are_expected_at_their_height_shut_or_by_the_map_of_another(lab: Lab) -> None:
    lower(lab)
    image = lab.rig.vico.camera().next_image()
    transform = lab.rig.vico.application.transform
    assert isinstance(transform, PlatformTransform)

    def at(**moved: float) -> CameraImage:
        axes = image.circumstances.positions | {
            name.replace("_", "."): to for name, to in moved.items()
        }
        return replace(image, circumstances=replace(image.circumstances, positions=axes))

    (wide,) = transform.expected_tools(image).values()
    (shown,) = lab.rig.vico.calibrated
    assert wide.scale_um_px == pytest.approx(shown.scale_um_px, rel=0.001)
    assert not wide.shut
    shut = transform.expected_tools(at(right_gripper=0.0))["right"]
    assert shut.shut
    assert shut.width_px == pytest.approx(2.0 * wide.width_px, rel=0.01)
    beside = at(left_x=3000.0, left_y=300.0, left_z=HEIGHT_UM - 1500.0)
    assert set(transform.expected_tools(beside)) == {"right"}
    assert set(transform.expected_bodies(beside)) == {"left", "right"}


# ------------------------------------------------------------------ calibrating


def test_a_calibration_is_reported_with_zoom_height_and_residual(lab: Lab) -> None:
    (shown,) = lab.rig.vico.calibrated
    assert (shown.camera, shown.tool) == ("microscope", "right")
    assert shown.scale_um_px == pytest.approx(2.2, rel=0.003)
    assert 0.0 < shown.residual_px < 0.5
    assert shown.zoom_counts == pytest.approx(5964.0)
    assert shown.height_um == pytest.approx(HEIGHT_UM, abs=1.0)


def test_a_calibration_is_found_again_at_the_next_start(lab: Lab, config: Path) -> None:
    assert (config.parent / "measured" / "microscope-right.toml").exists()
    again = build_platform(config).vico
    assert again is not None
    assert again.transform is not None
    assert again.transform.calibrated == lab.rig.vico.calibrated


def test_a_tool_that_is_not_on_the_image_calibrates_nothing_and_stands_where_it_was(
    lab: Lab,
) -> None:
    before, stood = lab.rig.vico.calibrated, lab.rig.mico["left.x"].position_um
    task = lab.rig.vico.calibrate_stage("left")
    with pytest.raises(cosmic.NotAvailable, match="Left gripper was not found"):
        task.wait(30.0)
    assert lab.rig.vico.calibrated == before
    assert lab.rig.mico["left.x"].position_um == pytest.approx(stood, abs=1.0)


def test_a_refused_move_ends_a_calibration_and_the_gripper_goes_back(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    lower(lab)
    stood, before = at_right(lab.rig), lab.rig.vico.calibrated
    refused = cosmic.LimitError(lab.rig.mico["right.x"].check(9999.0))
    manager = lab.rig.mico.application.manager
    real, moves = manager.groups.order_together, iter(range(100))

    def refuse_the_sixth(motions: Any, **kwargs: Any) -> Any:
        if next(moves) == 5:
            raise refused
        return real(motions, **kwargs)

    monkeypatch.setattr(manager.groups, "order_together", refuse_the_sixth)
    with pytest.raises(cosmic.LimitError):
        lab.rig.vico.calibrate_stage("right").wait(30.0)
    assert at_right(lab.rig) == pytest.approx(stood, abs=1.0)
    assert lab.rig.vico.calibrated == before


def test_a_cancelled_calibration_ends_at_once_and_keeps_what_was_known(lab: Lab) -> None:
    lower(lab)
    before = lab.rig.vico.calibrated
    task = lab.rig.vico.calibrate_stage("right")
    with pytest.raises(cosmic.NotAvailable, match="is running"):
        lab.rig.vico.camera().click_to_move((900.0, 600.0), "right")
    wait_until(lambda: "point" in task.progress.text or "position" in task.progress.text)
    task.cancel()
    with pytest.raises(MoveCancelled):
        task.wait(10.0)
    assert lab.rig.vico.calibrated == before


def test_the_table_turns_about_the_centre_the_twin_has(lab: Lab) -> None:
    lift(lab)
    lab.rig.vico.find_rotation_centre().wait(30.0)
    found = lab.rig.vico.rotation_centre()
    assert found is not None
    assert found.axis == "table.rotation"
    assert np.linalg.norm(found.centre_um) < NEAR_UM
    assert found.std_um < 2.0
    assert lab.rig.mico["table.rotation"].angle_deg == pytest.approx(0.0, abs=0.01)


# ------------------------------------------------------------------ click to move


def test_a_click_brings_the_tip_to_the_pixel_and_keeps_its_height(lab: Lab) -> None:
    lower(lab)
    height = lab.rig.mico["right.z"].position_um
    pixel = (1210.0, 520.0)
    camera = lab.rig.vico.camera()
    camera.next_image()
    said = camera.click_to_move(pixel, "right")
    assert said.startswith("Right gripper moves to x")
    wait_until(lambda: 2.2 * float(np.linalg.norm(lab.tip_px() - pixel)) < NEAR_UM)
    wait_until(lambda: all(axis.state == "OK" for axis in lab.rig.mico))
    assert 2.2 * float(np.linalg.norm(lab.tip_px() - pixel)) < NEAR_UM
    assert lab.rig.mico["right.z"].position_um == height


def test_a_click_that_the_gate_refuses_moves_nothing(lab: Lab) -> None:
    lower(lab)
    stood = at_right(lab.rig)
    camera = lab.rig.vico.camera()
    camera.next_image()
    lab.rig.stop("a test")
    try:
        with pytest.raises(cosmic.StoppedError) as refused:
            camera.click_to_move((1000.0, 500.0), "right")
        assert refused.value.verdict.reason == "STOPPED"
    finally:
        lab.rig.reset_stop()
    with pytest.raises(cosmic.NotAvailable):
        camera.click_to_move((1000.0, 500.0), "left")
    with (
        patch.object(lab.rig.mico.application, "busy", lambda: "a campaign moves the axes"),
        pytest.raises(cosmic.NotAvailable, match="a campaign moves the axes"),
    ):
        camera.click_to_move((1000.0, 500.0), "right")
    with pytest.raises(cosmic.ConfigError, match="there is no tool"):
        camera.click_to_move((1000.0, 500.0), "nobody")
    assert at_right(lab.rig) == pytest.approx(stood, abs=0.5)


# ------------------------------------------------------------------ trouble


def test_autofocus_looks_at_no_image_exposed_before_its_movement(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    lift(lab)
    lens = lab.rig.vico.lens
    assert lens is not None
    twin_lens = lab.scene.lens
    assert twin_lens is not None
    asked: list[float] = []
    moved: list[float] = []
    real = CameraThread.next_image

    def watched(self: CameraThread, since_s: float, timeout_s: float) -> CameraImage:
        image = real(self, since_s, timeout_s)
        exposed_s = image.frame.exposed_s
        asked.append(exposed_s)
        places = [twin_lens.position_counts("focus", exposed_s + part) for part in (0.0, 0.02)]
        if abs(places[1] - places[0]) > 0.5:
            moved.append(exposed_s)
        return image

    monkeypatch.setattr(CameraThread, "next_image", watched)
    lens.seek_focus(4300).wait(10.0)
    lens.autofocus().wait(60.0)
    assert len(asked) > 20
    assert not moved, "the lens moved while these were exposed"
    optics = lab.scene.optics
    assert optics is not None
    height_um = optics.projection(lab.now_s).focus_um
    assert abs(height_um) < 60.0, "the plate lies at 0"


def test_two_images_focus_where_a_sweep_taught_how_fast_they_blur(lab: Lab) -> None:
    lift(lab)
    lens, optics = lab.rig.vico.lens, lab.scene.optics
    assert lens is not None and optics is not None
    lens.seek_focus(4100).wait(10.0)
    lens.autofocus().wait(150.0)  # the first one sweeps, where none did before
    texts = []
    for start in (4500, 3500):
        lens.seek_focus(start).wait(10.0)
        task = lens.autofocus()
        task.wait(150.0)
        texts.append(task.progress.text)
        assert abs(optics.projection(lab.now_s).focus_um) < 60.0, "the plate lies at 0"
    # The third shows that it is sharp; where it does not, it sweeps.
    assert any(each.endswith("; 3 images") for each in texts), texts


def test_a_camera_that_comes_back_has_the_settings_that_were_in_force(lab: Lab) -> None:
    camera = lab.rig.vico.camera()
    before = camera.settings
    assert before is not None
    changed = replace(before, exposure_s=0.011, rate_hz=9.0, roi=Roi(400, 300, 800, 600))
    camera.configure(changed).wait(10.0)
    try:
        lab.cameras.faults.inject("unplugged", camera="Sim1")
        try:
            wait_until(lambda: bool(camera.problem))
            assert camera.settings is None
        finally:
            lab.cameras.faults.clear()
        wait_until(lambda: camera.info is not None and camera.running)
        assert camera.settings == changed
        assert camera.next_image(10.0).data.shape == (600, 800)
    finally:
        camera.configure(before).wait(10.0)


def test_a_camera_unplugged_while_it_records_leaves_a_file_that_can_be_read(
    lab: Lab, tmp_path: Path
) -> None:
    camera = lab.rig.vico.camera()
    file = tmp_path / "lost.mkv"
    camera.record(file)
    wait_until(lambda: camera.recording.written >= 3)
    lab.cameras.faults.inject("unplugged", camera="Sim1")
    try:
        wait_until(lambda: bool(camera.problem))
        assert camera.info is None
    finally:
        lab.cameras.faults.clear()
    wait_until(lambda: camera.info is not None and camera.running)
    camera.next_image()
    camera.stop_recording(wait=True)
    with open_image_recording(file) as recording:
        assert recording.complete
        assert len(recording) >= 3
        row = recording[0].row
        assert row is not None
        assert row.circumstances.scale_um_px == pytest.approx(2.2, rel=0.003)
        assert set(row.circumstances.positions) == set(lab.rig.mico.names)


def test_a_lens_that_was_not_homed_says_so_and_nothing_is_given_in_um() -> None:
    with cosmic.connect(None, ("mico", "vico"), rate=6.0, cold=True) as rig:
        camera, lens = rig.vico.camera(), rig.vico.lens
        assert lens is not None
        assert camera.next_image(10.0).circumstances.scale_um_px is None
        assert "home the lens" in camera.calibration_problem
        for task in (lens.autofocus(), lens.zoom_to(2.0)):
            with pytest.raises(cosmic.CosmicError, match="home"):
                task.wait(10.0)
        with pytest.raises(cosmic.CosmicError):
            rig.vico.calibrate_stage("left").wait(10.0)


def test_a_gripper_out_of_focus_across_the_image_does_not_end_the_finding_of_fibres() -> None:
    with cosmic.connect(rate=20.0, applications=("mico", "vico")) as rig:
        rig.mico["left.x"].move_to(3600.0)
        rig.mico["left.z"].move_to(-800.0)
        assert rig.vico.lens is not None
        rig.vico.lens.zoom_to(1.0)
        assert rig.vico.find_fibres()
        camera = rig.vico.camera()
        camera.switch("fibres", on=True)
        wait_until(lambda: camera.analysis is not None and camera.analysis.fibres)
        (link,) = [each for each in camera.algorithms if each.name == "fibres"]
        assert (link.on, link.failing) == (True, False)


@pytest.mark.slow
def test_the_camera_says_how_well_the_axes_of_a_tool_repeat(lab: Lab) -> None:
    lower(lab)
    begun = at_right(lab.rig)
    transform = lab.rig.vico.application.transform
    assert isinstance(transform, PlatformTransform)
    task, found = transform.check_stage("right", lab.rig.vico.cameras[0])
    task.wait(120.0)
    report = found.result
    for each, towards in zip(report.axes, (0.0, 90.0), strict=True):
        assert abs(each.direction_deg - towards) < 3.0
        assert each.pixel_um == pytest.approx(2.2, rel=0.02)
        assert each.repeatability_um < 0.5
        assert abs(each.backlash_um) < 0.5
    assert at_right(lab.rig) == pytest.approx(begun, abs=1.0)
