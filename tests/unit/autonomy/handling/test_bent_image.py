"""Where images show a held fibre before and at the end of a push."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from cosmic.autonomy.bending.bent_shape import BentShape
from cosmic.autonomy.handling.bent_image import HeldLine
from cosmic.autonomy.handling.grasp import HeldShape

Floats = npt.NDArray[np.float64]
SCALE_UM_PX = 7.5
WIDTH_UM, SPAN_UM, PUSHED_UM = 30.0, 600.0, 38.0
TIP_UM = (-500.0, 200.0)


class Map:
    """Pixels grow along x, and against y."""

    def __init__(self, scale_um_px: float = SCALE_UM_PX) -> None:
        self.scale_um_px = scale_um_px

    def to_px(self, points_um: Floats) -> Floats:
        return np.column_stack(
            [
                100.0 + (points_um[:, 0] + 500.0) / self.scale_um_px,
                150.0 - (points_um[:, 1] - 200.0) / self.scale_um_px,
            ]
        )


def bow(x_um: Floats) -> Floats:
    return x_um**2 / 6000.0


def uniform(x_um: Floats) -> Floats:
    part = x_um / SPAN_UM
    return PUSHED_UM * part**2 * (1.5 - 0.5 * part)


def drawn(aside_um: Floats | float, *, seed: int, beside: Floats | None = None) -> Any:
    """An image with a fibre from the jaws on, `aside_um` beside where it runs unpushed."""
    rng = np.random.default_rng(seed)
    columns = np.arange(400.0)
    x_um = (columns - 100.0) * SCALE_UM_PX
    rows = np.arange(300.0)[:, None]
    greys = np.full((300, 400), 180.0)
    lines = [bow(x_um) + aside_um] if beside is None else [bow(x_um) + aside_um, beside]
    for line in lines:
        off = rows - (150.0 - line / SCALE_UM_PX)
        dark = np.exp(-((np.abs(off) / 2.4) ** 4)) * ((x_um > 0.0) & (x_um < 900.0))
        greys = greys * (1.0 - 0.5 * dark)
    return SimpleNamespace(data=np.clip(greys + rng.normal(0.0, 3.0, greys.shape), 0, 255))


def line_of(scale_um_px: float = SCALE_UM_PX) -> HeldLine:
    at = np.linspace(0.0, 900.0, 181)
    work = SimpleNamespace(
        hold_tip_um=700.0,
        gripper=None,
        jaws=SimpleNamespace(forward=1.0),
        tip_now=lambda _gripper: TIP_UM,
        mapped_near=lambda _image, _height: Map(scale_um_px),
    )
    shape = HeldShape(at, bow(at), at)
    return HeldLine(work, shape, SPAN_UM, WIDTH_UM, 1.0)  # type: ignore[arg-type]


def bent(before: Any, after: Any, pushed_um: float = PUSHED_UM) -> BentShape:
    line = line_of()
    seen = line.seen(before), line.seen(after, pushed_um)
    return line.bent(*seen, probe_um=100.0, force_un=20.0)


def columns_um() -> Floats:
    return (np.arange(400.0) - 100.0) * SCALE_UM_PX


def test_how_far_each_place_went_is_seen_to_a_tenth_of_a_pixel() -> None:
    x = columns_um()
    found = bent(drawn(0.0, seed=1), drawn(uniform(np.maximum(x, 0.0)), seed=2))
    assert len(found.ahead_um) > 25
    assert found.ahead_um[0] >= 70.0
    assert found.ahead_um[-1] <= SPAN_UM - 70.0
    off = found.aside_um - uniform(found.ahead_um)
    assert np.sqrt(np.mean(off**2)) < 0.8
    assert found.std_um == pytest.approx(0.6, abs=0.3)


def test_a_fibre_that_lies_beside_where_it_was_foreseen_is_found_all_the_same() -> None:
    x = columns_um()
    more = drawn(12.0 + 1.2 * uniform(np.maximum(x, 0.0)), seed=3)
    found = bent(drawn(12.0, seed=4), more)
    off = found.aside_um - 1.2 * uniform(found.ahead_um)
    assert np.sqrt(np.mean(off**2)) < 0.8


def test_where_another_fibre_crosses_nothing_is_said() -> None:
    x = columns_um()
    other = -250.0 + 0.8 * x
    before = drawn(0.0, seed=5, beside=other)
    found = bent(before, drawn(uniform(np.maximum(x, 0.0)), seed=6, beside=other))
    off = np.abs(found.aside_um - uniform(found.ahead_um))
    crossing = 250.0 / 0.8
    assert len(found.ahead_um) > 10
    assert not (np.abs(found.ahead_um - crossing) < 30.0).any()
    assert off.max() < 4.0


def test_what_jumps_away_from_the_fibre_is_left_out() -> None:
    x = columns_um()
    aside = uniform(np.maximum(x, 0.0))
    jumping = drawn(np.where(x > 450.0, aside - 20.0, aside), seed=7)
    found = bent(drawn(0.0, seed=8), jumping)
    assert found.ahead_um[-1] < 460.0
    assert np.abs(found.aside_um - uniform(found.ahead_um)).max() < 4.0


def test_what_draws_the_middle_aside_without_a_jump_is_left_out() -> None:
    x = columns_um()
    drawn_back = uniform(np.maximum(x, 0.0)) - 6.0 * np.exp(-(((x - 280.0) / 40.0) ** 2))
    found = bent(drawn(0.0, seed=10), drawn(drawn_back, seed=11))
    assert len(found.ahead_um) > 18
    assert np.abs(found.aside_um - uniform(found.ahead_um)).max() < 3.5


def test_a_fibre_that_is_bent_at_a_weak_place_is_seen_so() -> None:
    x = columns_um()
    weak = uniform(np.maximum(x, 0.0)) + 0.03 * np.maximum(x - 250.0, 0.0)
    found = bent(drawn(0.0, seed=12), drawn(weak, seed=13))
    assert len(found.ahead_um) > 25
    off = found.aside_um - uniform(found.ahead_um)
    assert off[-3:].mean() == pytest.approx(0.03 * (found.ahead_um[-3:].mean() - 250.0), abs=1.0)


def test_images_without_the_fibre_or_at_another_magnification_show_nothing() -> None:
    empty = SimpleNamespace(data=np.full((300, 400), 180.0))
    assert len(bent(empty, empty).ahead_um) == 0
    line = line_of()
    before, after = line.seen(drawn(0.0, seed=9)), line_of(3.0).seen(drawn(0.0, seed=9))
    found = line.bent(before, after, probe_um=100.0, force_un=20.0)
    assert len(found.ahead_um) == 0
    assert found.std_um == np.inf
