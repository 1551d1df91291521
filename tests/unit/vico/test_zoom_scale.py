"""What a pixel is at each position of the zoom, and what the settings of lens and light accept."""

import math

import pytest
from pydantic import ValidationError

from cosmic.frame.errors import ConfigError
from cosmic.vico.core.settings import LampSettings, MotorLensSettings
from cosmic.vico.core.zoom_scale import ZoomPoint, ZoomScale, zoom_text
from cosmic.vico.hw.peripherals import LensAxis

TABLE = ZoomScale(
    [
        ZoomPoint(12000, 8.0, 0.5, "8x"),
        ZoomPoint(0, 0.5, 8.0, "0.5x"),
        ZoomPoint(6000, 2.0, 2.0),
    ]
)


def test_at_a_point_the_table_holds_and_between_two_it_changes_by_equal_factors() -> None:
    assert [TABLE.scale_um_px(each) for each in (0, 6000, 12000)] == [8.0, 2.0, 0.5]
    assert TABLE.scale_um_px(3000) == pytest.approx(4.0)
    assert TABLE.zoom(9000) == pytest.approx(4.0)
    assert TABLE.scale_um_px(3000, binning=2) == pytest.approx(8.0)


@pytest.mark.parametrize("counts", [-1, -0.01, 12000.01, math.nan, math.inf])
def test_beyond_the_table_nothing_is_known(counts: float) -> None:
    assert TABLE.scale_um_px(counts) is None
    assert TABLE.zoom(counts) is None
    assert TABLE.label(counts) == ""


def test_an_empty_table_knows_nothing() -> None:
    empty = ZoomScale([])
    assert empty.scale_um_px(0) is None
    with pytest.raises(ConfigError, match="settings"):
        empty.counts(1.0)


def test_a_magnification_has_a_position_and_back() -> None:
    assert TABLE.counts(4.0) == 9000
    assert [TABLE.counts(each) for each in TABLE.zoom_range] == [0, 12000]
    for zoom in (0.5, 0.77, 2.0, 3.3, 8.0):
        assert TABLE.zoom(TABLE.counts(zoom)) == pytest.approx(zoom, rel=1e-3)
    for wrong in (0.49, 8.01, math.nan):
        with pytest.raises(ConfigError, match=r"0\.50x to 8\.0x"):
            TABLE.counts(wrong)


def test_magnifications_are_written_for_people() -> None:
    assert [zoom_text(each) for each in (0.58, 2.0, 12.0)] == ["0.58x", "2.0x", "12x"]
    assert TABLE.label(6000) == "2.0x"


def test_steps_are_the_points_with_names_in_order() -> None:
    assert [each.name for each in TABLE.steps] == ["0.5x", "8x"]


@pytest.mark.parametrize(
    "points",
    [
        [ZoomPoint(0, 1.0, 4.0), ZoomPoint(0, 2.0, 2.0)],
        [ZoomPoint(0, 2.0, 4.0), ZoomPoint(10, 1.0, 2.0)],
        [ZoomPoint(0, 1.0, 2.0), ZoomPoint(10, 2.0, 4.0)],
        [ZoomPoint(0, math.nan, 2.0)],
        [ZoomPoint(0, 1.0, 0.0)],
    ],
)
def test_a_table_that_cannot_be_is_refused(points: list[ZoomPoint]) -> None:
    with pytest.raises(ConfigError, match="zoom position"):
        ZoomScale(points)


def test_without_anything_said_lens_and_light_are_simulated() -> None:
    assert (MotorLensSettings().backend, LampSettings().backend) == ("simulated", "simulated")


def test_settings_hand_on_limits_and_table() -> None:
    settings = MotorLensSettings.model_validate(
        {
            "backend": "navitar",
            "port": "COM3",
            "focus_limit_counts": 700,
            "step": [
                {"name": "low", "counts": 0, "zoom": 0.58, "scale_um_px": 7.6},
                {"name": "high", "counts": 9000, "zoom": 7.0, "scale_um_px": 0.63},
            ],
        }
    )
    assert settings.limits_counts == {LensAxis.FOCUS: 700}
    assert [each.name for each in settings.zoom_scale().steps] == ["low", "high"]


@pytest.mark.parametrize(
    ("model", "given", "said"),
    [
        (MotorLensSettings, {"backend": "navitar"}, "needs a port"),
        (LampSettings, {"backend": "brightlight"}, "needs a port"),
        (
            MotorLensSettings,
            {"step": [{"counts": 5, "zoom": 1.0, "scale_um_px": 1.0}] * 2},
            "zoom positions 5 and 5",
        ),
        (
            MotorLensSettings,
            {
                "step": [
                    {"name": "a", "counts": 0, "zoom": 1.0, "scale_um_px": 4.0},
                    {"name": "a", "counts": 5, "zoom": 2.0, "scale_um_px": 2.0},
                ]
            },
            "two steps are named 'a'",
        ),
    ],
)
def test_settings_that_do_not_fit_are_refused(
    model: type[MotorLensSettings] | type[LampSettings], given: dict[str, object], said: str
) -> None:
    with pytest.raises(ValidationError, match=said):
        model.model_validate(given)
