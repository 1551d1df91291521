"""What lies along a line of an image."""

import cv2
import numpy as np
import pytest

from cosmic.autonomy.handling.sight import box_around, trace_along
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.hw.interface import Frame, FrameStatus, PixelFormat

LINE = np.array([[100.0, 120.0], [220.0, 150.0]])


def image(*lines: tuple[float, float, float, float], width_px: int = 4) -> CameraImage:
    image = np.full((300, 400), 160, np.uint8)
    for x0, y0, x1, y1 in lines:
        cv2.line(image, (round(x0), round(y0)), (round(x1), round(y1)), 90, width_px)
    noise = np.random.default_rng(1).normal(0.0, 3.0, image.shape)
    data = np.clip(image + noise, 0, 255).astype(np.uint8)
    frame = Frame(data, 1, 0.0, 0.0, None, FrameStatus.COMPLETE, PixelFormat.MONO8)
    return CameraImage("microscope", frame, Circumstances())


def test_a_dark_line_is_seen_where_it_is_looked_for():
    seen = trace_along(image((100, 120, 220, 150)), LINE, 8.0)
    assert seen.contrast > 40.0
    assert abs(seen.offset_px) <= 1.0


def test_one_beside_it_is_seen_with_its_distance():
    aside = np.array([0.0, 5.0])
    seen = trace_along(image((100, 120, 220, 150)), LINE + aside, 8.0)
    assert seen.contrast > 40.0
    assert seen.offset_px == pytest.approx(4.85, abs=1.0), "to the left on the screen is up"


@pytest.mark.parametrize("aside", [-6.0, 0.0, 4.0])
def test_a_wide_fibre_is_seen_where_its_middle_is(aside: float):
    by = np.array([0.0, aside])
    offsets = [
        trace_along(image((100, 120, 220, 150), width_px=15), LINE + by, reach).offset_px
        for reach in (10.0, 14.0)
    ]
    normal = 120.0 / np.hypot(120.0, 30.0)
    assert offsets == pytest.approx([aside * normal] * 2, abs=0.7)


@pytest.mark.parametrize(
    "lines",
    [(), ((100.0, 160.0, 220.0, 190.0),), ((160.0, 60.0, 160.0, 250.0),)],
    ids=["nothing", "far beside", "across"],
)
def test_nothing_is_seen_where_nothing_lies_along_it(lines: tuple[tuple[float, ...], ...]):
    seen = trace_along(image(*lines), LINE, 8.0)  # type: ignore[arg-type]
    assert seen.contrast < 10.0


def test_off_the_image_nothing_is_seen():
    assert trace_along(image(), LINE - 500.0, 8.0).contrast == 0.0


def test_a_box_stays_within_the_image():
    assert box_around(LINE, 10.0, image()) == (90, 110, 231, 161)
    assert box_around(LINE, 1000.0, image()) == (0, 0, 400, 300)
