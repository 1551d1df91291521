"""Where the lens was when a frame was exposed, as far as anybody knows."""

import pytest

from cosmic.vico.core.lens_history import KEPT, LensHistory
from cosmic.vico.hw.peripherals import LensAxis, LensState

ZOOM, FOCUS = LensAxis.ZOOM, LensAxis.FOCUS


def state(counts: int, *, moving: bool = False, homed: bool = True) -> LensState:
    return LensState(counts, 12000, moving, homed)


def test_before_the_first_look_nobody_knows() -> None:
    history = LensHistory()
    assert history.counts_at(ZOOM, 1.0) is None and history.light_at(1.0) is None
    history.add_motor(ZOOM, 2.0, state(5))
    assert history.counts_at(ZOOM, 1.9) is None
    assert history.counts_at(ZOOM, 2.0) == 5.0
    assert history.counts_at(FOCUS, 2.0) is None


def test_what_rests_goes_on_resting() -> None:
    history = LensHistory()
    history.add_motor(ZOOM, 1.0, state(5))
    history.add_motor(ZOOM, 2.0, state(5))
    assert [history.counts_at(ZOOM, each) for each in (1.5, 2.0, 99.0)] == [5.0, 5.0, 5.0]


def test_a_movement_goes_straight_between_two_looks_from_the_moment_it_was_ordered() -> None:
    history = LensHistory()
    history.add_motor(ZOOM, 1.0, state(0))
    history.add_motor(ZOOM, 1.8, state(0), starts=True)
    history.add_motor(ZOOM, 2.0, state(100, moving=True))
    history.add_motor(ZOOM, 2.2, state(300))
    seen = [history.counts_at(ZOOM, each) for each in (1.7, 1.9, 2.1, 2.2, 5.0)]
    assert seen == pytest.approx([0.0, 50.0, 200.0, 300.0, 300.0])


def test_while_it_moves_nobody_knows_what_comes_after_the_last_look() -> None:
    history = LensHistory()
    history.add_motor(ZOOM, 1.0, state(0), starts=True)
    assert history.counts_at(ZOOM, 1.0) == 0.0
    assert history.counts_at(ZOOM, 1.1) is None
    history.add_motor(ZOOM, 2.0, state(100, moving=True))
    assert history.counts_at(ZOOM, 2.0) == 100.0
    assert history.counts_at(ZOOM, 2.01) is None


def test_a_movement_by_another_hand_began_nobody_knows_when() -> None:
    history = LensHistory()
    history.add_motor(ZOOM, 1.0, state(0))
    history.add_motor(ZOOM, 2.0, state(100))
    assert history.counts_at(ZOOM, 1.5) is None
    assert history.counts_at(ZOOM, 2.5) == 100.0


def test_counts_not_homed_and_lost_lines_mean_nothing() -> None:
    history = LensHistory()
    history.add_motor(ZOOM, 1.0, state(7, homed=False))
    history.add_motor(FOCUS, 1.0, state(7))
    history.add_motor(FOCUS, 2.0, None)
    assert history.counts_at(ZOOM, 1.5) is None
    assert history.counts_at(FOCUS, 1.5) is None and history.counts_at(FOCUS, 3.0) is None


def test_the_light_was_as_bright_as_last_heard_until_another_is_heard() -> None:
    history = LensHistory()
    history.add_light(1.0, 50.0)
    history.add_light(2.0, 50.0)
    history.add_light(3.0, None)
    assert [history.light_at(each) for each in (1.5, 2.0, 3.5)] == [50.0, 50.0, None]


def test_only_the_distant_past_is_forgotten() -> None:
    history = LensHistory()
    for number in range(KEPT + 10):
        history.add_light(float(number), 1.0)
    assert history.light_at(9.5) is None
    assert history.light_at(10.5) == 1.0
