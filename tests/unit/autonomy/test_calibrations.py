"""Which map is used where, what is kept in files, and where tools are expected."""

import gc
import weakref
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from cosmic.autonomy.calibrations import NEAR_UM, Calibrations
from cosmic.autonomy.stage_procedure import middle, uncovered
from cosmic.autonomy.tools import axis_targets, expected, tip_um
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.vico.core.calibration import Plane, RotationCentre
from cosmic.vico.core.calibration_fit import Sighting, fit_map, fit_rotation
from cosmic.vico.core.tool_settings import ToolSettings

NOW = datetime(2026, 11, 21, 15, 0, tzinfo=UTC)
TOOL = ToolSettings(
    name="left",
    x_axis="left.x",
    y_axis="left.y",
    z_axis="left.z",
    gap_axis="left.gripper",
    tip_um=(-4000.0, 10.0, 1500.0),
    forward=(2.0, 0.0),
    width_um=100.0,
)


def plane(zoom: float, height_um: float, scale_um_px: float = 2.0) -> Plane:
    places = [(x, y) for x in (-300.0, 0.0, 300.0) for y in (-300.0, 0.0, 300.0)]
    seen = [(800.0 + x / scale_um_px, 600.0 - y / scale_um_px) for x, y in places]
    sightings = [Sighting(um, px) for um, px in zip(places, seen, strict=True)]
    return Plane(zoom, height_um, fit_map(sightings), NOW)


@pytest.fixture
def known(tmp_path: Path) -> Calibrations:
    calibrations = Calibrations(["top"], ["left", "right"], tmp_path / "kept")
    calibrations.add_plane("top", "left", plane(5964.0, 700.0, 1.98))
    calibrations.add_plane("top", "right", plane(5964.0, 50.0))
    return calibrations


def test_the_map_measured_nearest_to_the_height_is_used(known: Calibrations) -> None:
    found = known.find("top", 5964.0, 0.0)
    assert (found.tool, found.off_um) == ("right", 50.0)
    assert found.map.scale_um_px == pytest.approx(2.0)
    assert known.find("top", 5964.0, 690.0).tool == "left"


def test_between_two_heights_of_one_tool_the_map_is_between(known: Calibrations) -> None:
    known.add_plane("top", "right", plane(5964.0, 650.0, 1.8))
    found = known.find("top", 5964.0, 350.0, "right")
    assert found.off_um == 0.0
    assert 1.85 < found.map.scale_um_px < 1.95


@pytest.mark.parametrize(
    ("zoom", "height_um", "tool", "reason"),
    [
        (5964.0, 50.0 + NEAR_UM + 1.0, "right", "height"),
        (5964.0, 0.0, "left", "height"),
        (2000.0, 50.0, None, "zoom"),
        (5964.0, 50.0, "probe", "not been calibrated with the tool 'probe'"),
    ],
)
def test_where_nothing_was_measured_no_map_is_guessed(
    known: Calibrations, zoom: float, height_um: float, tool: str | None, reason: str
) -> None:
    with pytest.raises(NotAvailable, match=reason):
        known.find("top", zoom, height_um, tool)


def test_all_of_it_is_found_again_in_the_folder(known: Calibrations, tmp_path: Path) -> None:
    angles = [0.0, 10.0, 20.0, 30.0, 40.0]
    ways = [(500.0 * np.cos(np.radians(a)), 500.0 * np.sin(np.radians(a))) for a in angles]
    centre = RotationCentre("table.rotation", fit_rotation(angles, ways), NOW)
    known.set_rotation("top", centre)
    again = Calibrations(["top"], ["left", "right"], tmp_path / "kept")
    for tool in ("left", "right", ""):
        assert again.get("top", tool) == known.get("top", tool)


def test_a_broken_file_is_reported_and_not_passed_over(known: Calibrations, tmp_path: Path) -> None:
    assert known.get("top", "left").planes
    (tmp_path / "kept" / "top-left.toml").write_text("planes = 3", encoding="utf-8")
    with pytest.raises(ConfigError, match="top-left"):
        Calibrations(["top"], ["left"], tmp_path / "kept")


def test_without_a_folder_nothing_is_written(tmp_path: Path) -> None:
    calibrations = Calibrations(["top"], ["left"], None)
    calibrations.add_plane("top", "left", plane(0.0, 0.0))
    assert calibrations.find("top", 0.0, 0.0).tool == "left"
    assert not list(tmp_path.iterdir())


def test_a_tip_is_where_its_axes_carry_it() -> None:
    positions = {"left.x": 100.0, "left.y": -20.0, "left.z": -1400.0}
    assert tip_um(TOOL, positions) == (-3900.0, -10.0, 100.0)
    assert axis_targets(TOOL, -3900.0, -10.0) == {"left.x": 100.0, "left.y": -20.0}
    assert tip_um(TOOL, {"left.x": 1.0, "left.y": 2.0}) is None


def test_a_tool_is_expected_in_the_size_and_direction_of_the_map() -> None:
    mapped = plane(0.0, 0.0).fit.map
    wanted = expected(TOOL, mapped, (100.0, 200.0), {"left.gripper": 60.0}, 40.0)
    assert wanted is not None
    assert wanted.tip_px == pytest.approx((850.0, 500.0))
    assert wanted.forward == pytest.approx((1.0, 0.0), abs=1e-9)
    assert (wanted.width_px, wanted.gap_px) == pytest.approx((50.0, 30.0))
    narrow = TOOL.model_copy(update={"width_um": 9.0})
    assert expected(narrow, mapped, (0.0, 0.0), {}, 40.0) is None, "too few pixels to be measured"


def test_what_a_tool_leaves_behind_is_found_without_fibre_and_noise() -> None:
    rng = np.random.default_rng(3)

    def image(tip: int) -> np.ndarray:
        image = np.full((400, 600), 150.0)
        image[100:145, :tip] = 40.0
        image[245:290, :tip] = 40.0
        image[188:200, : tip + 150] = 70.0  # a fibre between the jaws
        return (image + rng.normal(0.0, 2.5, image.shape)).astype(np.uint8)

    mask = uncovered(image(300), image(264), 45.0)
    found = middle(mask)
    assert found is not None
    assert found == pytest.approx((281.5, 194.5), abs=1.0)
    assert middle(uncovered(image(300), image(300), 45.0)) is None


@pytest.mark.parametrize("forward", [(0.0, 0.0), (float("nan"), 0.0)])
def test_a_tool_must_point_somewhere(forward: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="forward"):
        ToolSettings.model_validate(TOOL.model_dump() | {"forward": forward})


def test_a_tool_cannot_use_one_axis_twice() -> None:
    with pytest.raises(ValueError, match="two parts"):
        ToolSettings.model_validate(TOOL.model_dump() | {"y_axis": "left.x"})


class Kept:
    """Stands for an image."""


def test_whoever_finds_no_map_keeps_nothing_alive_until_a_collection(known: Calibrations) -> None:
    def look() -> "weakref.ref[Kept]":
        image = Kept()
        with suppress(NotAvailable):
            known.find("top", 1.0, 0.0)
        return weakref.ref(image)

    gc.disable()
    try:
        assert look()() is None
    finally:
        gc.enable()
