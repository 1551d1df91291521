"""What a fibre forgets of the forces on it."""

import math

import numpy as np
import pytest

from cosmic.autonomy.bending.crept import NO_LOADS, Loads, lost


def test_a_step_loses_its_part_in_each_tenfold_time_from_one_second_on() -> None:
    load = Loads(np.array([10.0]), np.array([50.0]))
    found = load.lost_un(np.array([9.0, 10.1, 11.0, 20.0]))
    assert found == pytest.approx([0.0, -50.0, 0.0, 50.0])


def test_what_came_and_went_is_remembered_ever_less() -> None:
    pushed = Loads(np.array([0.0, 2.0]), np.array([40.0, -40.0]))
    left = pushed.lost_un(np.array([3.0, 5.0, 50.0]))
    assert (np.diff(left) < 0.0).all()
    assert left[0] == pytest.approx(40.0 * math.log10(3.0))
    assert left[2] < 1.0


def test_the_steps_lie_half_way_between_the_readings() -> None:
    load = Loads.of(np.array([0.0, 1.0, 2.0]), np.array([0.0, 10.0, 30.0]))
    assert load.time_s == pytest.approx([-0.5, 0.5, 1.5])
    assert load.step_un == pytest.approx([0.0, 10.0, 20.0])


def test_all_losses_at_once_are_those_of_the_steps() -> None:
    rng = np.random.default_rng(1)
    time_s = np.cumsum(rng.uniform(0.05, 0.3, 20))
    force_un = np.cumsum(rng.normal(size=20))
    at_once = lost(time_s) @ force_un
    assert at_once == pytest.approx(Loads.of(time_s, force_un).lost_un(time_s))


@pytest.mark.parametrize(("there_um", "here_um"), [(600.0, 200.0), (200.0, 600.0), (300.0, 300.0)])
def test_a_force_at_another_lever_counts_by_its_deflection_at_this_one(
    there_um: float, here_um: float
) -> None:
    # A cantilever of EI 1, cut into cells: each bends by its lever of the force.
    cells = (np.arange(20_000) + 0.5) * (600.0 / 20_000)
    bend = np.maximum(there_um - cells, 0.0)
    bent = float((bend * np.maximum(here_um - cells, 0.0)).sum()) * 600.0 / 20_000
    as_much = 3.0 * bent / here_um**3
    (step,) = Loads.of_others([(Loads(np.zeros(1), np.ones(1)), there_um)], here_um).step_un
    assert step == pytest.approx(as_much, rel=1e-4)


def test_without_loads_nothing_is_lost() -> None:
    assert Loads.of_others([], 300.0) is NO_LOADS
    assert NO_LOADS.lost_un(np.array([1.0, 2.0])) == pytest.approx([0.0, 0.0])


def test_after_the_last_reading_of_a_push_nothing_is_left_on_the_fibre() -> None:
    cut_off = Loads.of_push(np.array([0.0, 1.0, 2.0]), np.array([0.0, 30.0, 26.0]))
    assert cut_off.step_un.sum() == pytest.approx(0.0)
    late = cut_off.lost_un(np.array([100.0, 1000.0]))
    assert abs(late[1]) < abs(late[0]) < 1.0
