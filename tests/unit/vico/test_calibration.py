"""Stage to pixel: what is measured is used, said with its uncertainty, or refused with a reason."""

import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.vico.core.calibration import Calibration, Plane, RotationCentre
from cosmic.vico.core.calibration_fit import (
    CalibrationRefused,
    MapFit,
    Sighting,
    fit_map,
    fit_rotation,
)
from cosmic.vico.core.calibration_store import (
    calibration_text,
    load_calibration,
    save_calibration,
)
from cosmic.vico.core.pixel_map import PixelMap

NOW = datetime(2026, 11, 21, 15, 0, tzinfo=UTC)
AXIS_UM = np.array([320.0, -150.0])  # seen at the optical axis whatever the zoom
AXIS_PX = np.array([812.0, 590.0])


def matrix(
    scale_um_px: float = 2.2, turn_deg: float = 3.0, *, mirrored: bool = False
) -> np.ndarray:
    turn = math.radians(turn_deg)
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    return rotation @ np.diag([1.0, 1.0 if mirrored else -1.0]) / scale_um_px


def look(places: np.ndarray, noise_px: float = 0.1, seed: int = 0, **view: float) -> list[Sighting]:
    rng = np.random.default_rng(seed)
    seen = (places - AXIS_UM) @ matrix(**view).T + AXIS_PX
    seen += rng.normal(0.0, noise_px, seen.shape) if noise_px else 0.0
    return [Sighting((*p,), (*s,)) for p, s in zip(places.tolist(), seen.tolist(), strict=True)]


def grid(step_um: float = 300.0, count: int = 3) -> np.ndarray:
    line = (np.arange(count) - (count - 1) / 2) * step_um
    x, y = np.meshgrid(line, line)
    return AXIS_UM + np.column_stack([x.ravel(), y.ravel()])


def plane(zoom: float, height_um: float, noise_px: float = 0.0, **view: float) -> Plane:
    return Plane(zoom, height_um, fit_map(look(grid(), noise_px, **view)), NOW)


# --- fit --------------------------------------------------------------------------------------


def test_a_grid_of_points_gives_scale_rotation_and_mirror() -> None:
    fit = fit_map(look(grid(), scale_um_px=2.2, turn_deg=3.0))
    assert fit.map.scale_um_px == pytest.approx(2.2, rel=1e-3)
    assert fit.map.rotation_rad == pytest.approx(math.radians(3.0), abs=1e-3)
    assert not fit.map.mirrored
    assert fit.map.anisotropy < 2e-3
    assert 0.0 < fit.rms_px <= fit.max_px < 0.5
    assert fit.outliers == ()
    assert fit_map(look(grid(), mirrored=True)).map.mirrored


def test_there_and_back_again_is_the_same_place() -> None:
    found = fit_map(look(grid())).map
    points_px = np.array([[[0.0, 0.0], [1599.0, 3.5]], [[800.0, 600.0], [12.0, 1190.0]]])
    assert found.to_px(found.to_um(points_px)) == pytest.approx(points_px)
    assert found.std_um(points_px).shape == (2, 2)


@pytest.mark.slow
def test_the_uncertainty_reported_is_the_error_made() -> None:
    """Over many calibrations the errors scatter as the map says, in the middle and outside."""
    points_px = np.array([AXIS_PX, AXIS_PX + np.array([900.0, 500.0])])
    truth_um = (points_px - AXIS_PX) @ np.linalg.inv(matrix()).T + AXIS_UM
    fits = [fit_map(look(grid(), noise_px=0.15, seed=seed)).map for seed in range(200)]
    errors = np.array([fit.to_um(points_px) - truth_um for fit in fits])
    stds_um = np.array([fit.std_um(points_px) for fit in fits]).mean(axis=0)
    assert errors.std(axis=(0, 2)) == pytest.approx(stds_um, rel=0.12)
    assert stds_um[1] > 3.0 * stds_um[0]


def test_a_position_that_was_tracked_wrongly_is_left_out_and_named() -> None:
    sightings = look(grid())
    x_px, y_px = sightings[4].image_px
    sightings[4] = replace(sightings[4], image_px=(x_px + 40.0, y_px), label="left.x 320 um")
    fit = fit_map(sightings)
    assert len(fit.outliers) == 1
    assert fit.outliers[0].startswith("left.x 320 um: 40")
    assert fit.map.points == 8
    assert fit.map.scale_um_px == pytest.approx(2.2, rel=1e-3)


def test_too_many_wrong_positions_are_refused() -> None:
    sightings = look(grid())
    for index in (0, 4, 7):
        x_px, y_px = sightings[index].image_px
        sightings[index] = replace(sightings[index], image_px=(x_px - 50.0, y_px + 9.0 * index))
    with pytest.raises(CalibrationRefused, match=r"3 of 9 points.*point 1: .*point 5: .*point 8"):
        fit_map(sightings)


def test_an_outlier_among_thirty_positions_is_found_without_trying_every_triple() -> None:
    sightings = look(grid(step_um=100.0, count=6))
    x_px, y_px = sightings[30].image_px
    sightings[30] = replace(sightings[30], image_px=(x_px, y_px - 6.0))
    assert [each.split(":")[0] for each in fit_map(sightings).outliers] == ["point 31"]


@pytest.mark.parametrize(
    ("places", "reason"),
    [
        (grid()[:3], "3 points, at least 4"),
        (AXIS_UM + np.outer(np.arange(9.0), [100.0, 50.0]), "along a line only"),
        (np.repeat(AXIS_UM[None], 9, axis=0), "along a line only"),
        (grid(step_um=10.0), "move further"),
    ],
)
def test_moves_that_say_too_little_are_refused(places: np.ndarray, reason: str) -> None:
    with pytest.raises(CalibrationRefused, match=reason):
        fit_map(look(places, noise_px=0.01))


def test_a_thing_that_did_not_move_with_the_stage_is_refused() -> None:
    still = [replace(each, image_px=(800.0, 600.0)) for each in look(grid())]
    with pytest.raises(CalibrationRefused, match="tracked object moves with the stage"):
        fit_map(still)


def test_a_poor_fit_is_refused_with_its_residual() -> None:
    with pytest.raises(CalibrationRefused, match=r"residual of 0\.\d+ px RMS, at most 0.5 px"):
        fit_map(look(grid(count=5, step_um=150.0), noise_px=0.55))


def test_a_tip_that_was_seen_unsurely_hardly_moves_the_map() -> None:
    sightings = look(grid(), noise_px=0.03)
    off = [(0, 1.4, 0.9), (4, -1.3, 0.6), (7, 1.2, 0.7)]  # fibres lie across the front there
    seen = list(sightings)
    for number, away_px, std_px in off:
        x, y = seen[number].image_px
        seen[number] = replace(seen[number], image_px=(x + away_px, y), std_px=std_px)
    with pytest.raises(CalibrationRefused, match="residual"):
        fit_map([replace(each, std_px=0.0) for each in seen])
    fit = fit_map(seen)
    assert fit.rms_px < 0.12
    true = fit_map(look(grid(), noise_px=0.0)).map
    corners = grid()
    assert np.abs(fit.map.to_px(corners) - true.to_px(corners)).max() < 0.15


SENSOR_MIDDLE = (799.5, 599.5)


def through_a_lens(sightings: list[Sighting], part: float) -> list[Sighting]:
    """Return them as a lens shows them that moves the corners out by a part of their distance."""
    found = []
    for each in sightings:
        away = np.array(each.image_px) - SENSOR_MIDDLE
        moved = away * (1.0 + part * (away @ away) / (SENSOR_MIDDLE @ np.array(SENSOR_MIDDLE)))
        x, y = (np.array(SENSOR_MIDDLE) + moved).tolist()
        found.append(replace(each, image_px=(x, y)))
    return found


@pytest.mark.parametrize("part", [-0.03, -0.004, 0.0, 0.004, 0.015, 0.03])
def test_what_a_lens_bends_is_measured_with_the_map(part: float) -> None:
    places = grid(step_um=800.0)
    seen = through_a_lens(look(places, noise_px=0.05, seed=4), part)
    fit = fit_map(seen, axis_px=SENSOR_MIDDLE)
    assert not fit.outliers
    assert fit.rms_px < 0.12
    corners = grid(step_um=1500.0, count=2)  # beyond what was measured
    true = np.array([e.image_px for e in through_a_lens(look(corners, noise_px=0.0), part)])
    assert np.abs(fit.map.to_px(corners) - true).max() < 0.5
    assert fit.map.to_um(fit.map.to_px(corners)) == pytest.approx(corners, abs=0.01)
    binned = fit.map.for_window(x_px=30, y_px=20, binning=2)
    assert binned.to_px(corners) == pytest.approx((true - 0.5) / 2.0 - (30, 20), abs=0.25)


def test_a_bent_lens_that_is_taken_for_straight_is_refused() -> None:
    seen = through_a_lens(look(grid(step_um=800.0), noise_px=0.05), 0.03)
    with pytest.raises(CalibrationRefused):
        fit_map(seen)


def test_a_wrong_sighting_is_no_bend_of_the_lens() -> None:
    seen = through_a_lens(look(grid(step_um=800.0), noise_px=0.05), 0.015)
    x, y = seen[2].image_px
    seen[2] = replace(seen[2], image_px=(x + 9.0, y - 6.0))
    fit = fit_map(seen, axis_px=SENSOR_MIDDLE)
    assert [each.split(":")[0] for each in fit.outliers] == ["point 3"]
    assert fit.map.bend_px2 * (SENSOR_MIDDLE @ np.array(SENSOR_MIDDLE)) == pytest.approx(
        0.015, abs=0.003
    )


def test_a_bent_map_is_kept_in_its_file(tmp_path: Path) -> None:
    seen = through_a_lens(look(grid(step_um=800.0), noise_px=0.05), 0.015)
    whole = Plane(120.0, 10.0, fit_map(seen, axis_px=SENSOR_MIDDLE), NOW)
    path = tmp_path / "lens.toml"
    save_calibration(path, Calibration("lens").with_plane(whole))
    assert load_calibration(path, "lens").planes[0].fit.map == whole.fit.map


def test_an_axis_that_did_not_travel_the_whole_distance_is_refused() -> None:
    short = [
        replace(each, platform_um=(each.platform_um[0], 1.2 * each.platform_um[1]))
        for each in look(grid())
    ]
    with pytest.raises(CalibrationRefused, match="20 % larger than the other"):
        fit_map(short)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_what_is_no_number_is_refused(bad: float) -> None:
    sightings = look(grid())
    sightings[2] = replace(sightings[2], image_px=(bad, 5.0))
    with pytest.raises(CalibrationRefused, match="not a number"):
        fit_map(sightings)


def test_a_binned_part_of_the_sensor_shows_the_same_place() -> None:
    whole = fit_map(look(grid())).map
    part = whole.for_window(x_px=100, y_px=40, binning=2)
    assert part.scale_um_px == pytest.approx(2.0 * whole.scale_um_px)
    # The binned pixel (0, 0) covers the sensor's pixels 200 and 201, 80 and 81.
    assert part.to_um((0.0, 0.0)) == pytest.approx(whole.to_um((200.5, 80.5)))
    assert part.std_um((300.0, 9.0)) == pytest.approx(whole.std_um((800.5, 98.5)))


# --- between what was measured ---------------------------------------------------------------


def test_between_zoom_steps_the_scale_goes_evenly_in_its_logarithm() -> None:
    one = plane(1000.0, 0.0, scale_um_px=4.4)
    # Measured beside the axis, as room for the tools has it.
    beside = look(grid() + np.array([250.0, -180.0]), 0.0, scale_um_px=1.1)
    other = Plane(3000.0, 0.0, fit_map(beside), NOW)
    calibration = Calibration("cam").with_plane(other).with_plane(one)
    assert calibration.scale_um_px(2000.0) == pytest.approx(2.2)
    assert calibration.scale_um_px(1000.4) == pytest.approx(4.4)
    found = calibration.map_at(2000.0)
    truth_px = (np.array([[800.0, -400.0], [0.0, 90.0]]) - AXIS_UM) @ matrix(2.2).T + AXIS_PX
    assert found.to_px([[800.0, -400.0], [0.0, 90.0]]) == pytest.approx(truth_px, abs=1e-6)


def test_between_heights_the_map_is_interpolated() -> None:
    low, high = plane(1000.0, 0.0, scale_um_px=2.2), plane(1000.0, 200.0, scale_um_px=2.3)
    calibration = Calibration("cam").with_plane(low).with_plane(high)
    assert calibration.map_at(1000.0, 100.0).scale_um_px == pytest.approx(2.25, rel=1e-3)
    with pytest.raises(NotAvailable, match="several heights"):
        calibration.map_at(1000.0)
    assert calibration.scale_um_px(1000.0) == pytest.approx(2.3)


@pytest.mark.parametrize(
    ("zoom", "height_um", "text"),
    [
        (900.0, 0.0, r"zoom 900 counts lies outside what was measured \(1000, 3000 counts\)"),
        (3002.0, 0.0, "zoom 3002 counts"),
        (math.nan, 0.0, "zoom nan"),
        (2000.0, 60.0, "height 60 um"),
        (2000.0, math.nan, "height nan"),
    ],
)
def test_nothing_is_extrapolated(zoom: float, height_um: float, text: str) -> None:
    calibration = Calibration("cam")
    for each in (1000.0, 3000.0):
        calibration = calibration.with_plane(plane(each, 0.0)).with_plane(plane(each, 50.0))
    calibration.map_at(1500.0, 25.0)
    with pytest.raises(NotAvailable, match=text):
        calibration.map_at(zoom, height_um)


def test_an_empty_calibration_says_so() -> None:
    for ask in (lambda c: c.map_at(0.0), lambda c: c.scale_um_px(0.0), lambda c: c.age_s(NOW)):
        with pytest.raises(NotAvailable, match="nothing has been measured"):
            ask(Calibration("cam"))


def test_a_plane_measured_again_replaces_the_old_one_and_ages_anew() -> None:
    old = replace(plane(1000.0, 0.0, scale_um_px=4.4), measured=NOW - timedelta(days=1))
    calibration = Calibration("cam").with_plane(old)
    assert calibration.age_s(NOW) == 86400.0
    calibration = calibration.with_plane(plane(1000.3, 1.0, scale_um_px=4.3))
    assert len(calibration.planes) == 1
    assert calibration.age_s(NOW) == 0.0


def test_zooms_that_disagree_about_the_mirror_are_not_mixed() -> None:
    calibration = Calibration("cam").with_plane(plane(1000.0, 0.0))
    calibration = calibration.with_plane(plane(3000.0, 0.0, mirrored=True))
    with pytest.raises(NotAvailable, match="mirrored at one"):
        calibration.map_at(2000.0)


# --- the table --------------------------------------------------------------------------------


def turned(
    angles_deg: list[float], radius_um: float = 600.0, noise_um: float = 0.3, sense: int = 1
) -> list[tuple[float, float]]:
    rng = np.random.default_rng(1)
    angles = sense * np.radians(angles_deg) + 0.7
    places = np.array([40.0, -25.0]) + radius_um * np.column_stack([np.cos(angles), np.sin(angles)])
    return [(x, y) for x, y in (places + rng.normal(0.0, noise_um, places.shape)).tolist()]


ANGLES = [-60.0, -30.0, 0.0, 30.0, 60.0]


@pytest.mark.parametrize("sense", [1, -1])
def test_the_rotation_centre_is_found_with_its_sense(sense: int) -> None:
    fit = fit_rotation(ANGLES, turned(ANGLES, sense=sense))
    assert math.dist(fit.centre_um, (40.0, -25.0)) < 4.0 * fit.std_um < 2.0
    assert fit.radius_um == pytest.approx(600.0, abs=1.0)
    assert fit.sense == sense
    assert fit.rms_um < 0.6


@pytest.mark.parametrize(
    ("angles", "radius_um", "noise_um", "reason"),
    [
        (ANGLES[:4], 600.0, 0.3, "4 angles, at least 5"),
        ([0.0, 0.1, 0.2, 0.3, 60.0], 600.0, 0.3, "2 angles"),
        ([0.0, 2.0, 4.0, 6.0, 8.0], 600.0, 0.3, "a turn of 8 degrees"),
        (ANGLES, 0.0, 0.3, "check that it turns with the table"),
        (ANGLES, 600.0, 8.0, "residual of"),
        ([0.0, 8.0, 16.0, 24.0, 32.0], 600.0, 2.5, "known to"),
        ([0.0, 30.0, 60.0, 90.0, math.nan], 600.0, 0.3, "not a number"),
    ],
)
def test_a_poor_rotation_centre_is_refused(
    angles: list[float], radius_um: float, noise_um: float, reason: str
) -> None:
    with pytest.raises(CalibrationRefused, match=reason):
        fit_rotation(angles, turned(angles, radius_um, noise_um))


# --- the file ---------------------------------------------------------------------------------


def measured() -> Calibration:
    fit = fit_map(look(grid()))
    odd = Plane(1000.0, 0.0, replace(fit, outliers=('point "3": \\ 9.0 px off\n',)), NOW)
    rotation = RotationCentre("table.rotation", fit_rotation(ANGLES, turned(ANGLES)), NOW)
    calibration = Calibration("sim: 0").with_plane(odd).with_plane(plane(3000.0, 0.0, 0.1))
    return calibration.with_rotation(rotation)


def test_what_is_saved_is_what_is_read(tmp_path: Path) -> None:
    path = tmp_path / "new" / "camera.toml"
    save_calibration(path, measured())
    assert load_calibration(path, "sim: 0") == measured()
    assert [each.name for each in path.parent.iterdir()] == ["camera.toml"]
    save_calibration(path, Calibration("sim: 0"))
    assert load_calibration(path, "sim: 0") == Calibration("sim: 0")


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("format = 1", "format = 2", "format"),
        ("zoom_counts = 1000.0\n", "", r"planes\[0\]\.zoom_counts: key is missing"),
        ("zoom_counts", "zoom_count", "unknown key"),
        ("points = 9", "points = 2", r"planes\[0\]\.points"),
        ("residual_rms_px = 0.", "residual_rms_px = 7.", "residual_rms_px"),
        ("noise_px = 0.", "noise_px = nan # ", "noise_px"),
        ("2026-11-21T15:00:00Z", "2026-11-21T15:00:00", "measured"),
        ("matrix_px_um = [[0.", "matrix_px_um = [[0.0, 0.0], [0.0, 0.0]] # ", "maps no platform"),
        ("leverage_um2 = [[", "leverage_um2 = [[-", "leverage_um2"),
        ("zoom_counts = 3000.0", "zoom_counts = 1000.0", "same zoom and height"),
        ("sense = 1", "sense = 0", "rotation.sense"),
        ("\n[[planes]]", "\n[[planes", "not valid TOML"),
    ],
)
def test_a_broken_file_is_refused_with_its_key(
    tmp_path: Path, old: str, new: str, reason: str
) -> None:
    path = tmp_path / "camera.toml"
    text = calibration_text(measured())
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ConfigError, match=reason) as refused:
        load_calibration(path, "sim: 0")
    assert str(path) in str(refused.value)


def test_another_camera_s_file_and_a_missing_one_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "camera.toml"
    save_calibration(path, measured())
    with pytest.raises(ConfigError, match="belongs to 'sim: 0', not to 'other'"):
        load_calibration(path, "other")
    with pytest.raises(ConfigError, match="no such file"):
        load_calibration(tmp_path / "none.toml", "other")


def test_what_cannot_be_written_is_said_and_the_old_file_stays(tmp_path: Path) -> None:
    path = tmp_path / "camera.toml"
    save_calibration(path, measured())
    before = path.read_text(encoding="utf-8")
    flat = PixelMap(
        ((1.0, 0.0), (0.0, 1.0)), (0.0, 0.0), (math.nan, 0.0), 0.1, ((1.0, 0.0),) * 2, 9
    )
    broken = Calibration("sim: 0").with_plane(Plane(1.0, 0.0, MapFit(flat, 0.1, 0.2), NOW))
    with pytest.raises(ConfigError, match="not a number"):
        save_calibration(path, broken)
    assert path.read_text(encoding="utf-8") == before
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(ConfigError, match="cannot be written"):
        save_calibration(tmp_path / "file" / "camera.toml", measured())
