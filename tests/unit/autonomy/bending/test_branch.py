"""What is read off the points of a push before anything is fitted to them."""

import numpy as np
import pytest

from cosmic.autonomy.bending.branch import Points, lost_while_pushing

WAY_STD_UM = 0.05


def out(probe_um: list[float], force_un: list[float]) -> Points:
    """Return the points of a way out, with 0.06 uN noise."""
    there = np.ones(len(probe_um), dtype=bool)
    times_s = 0.1 * np.arange(len(probe_um))
    std_un = np.full(len(probe_um), 0.06)
    return Points(np.array(probe_um), np.array(force_un), std_un, times_s, there, there)


def touched_again(wait_um: float) -> Points:
    """A span of 33 uN/um, felt at 11.6 um, left, and touched again `wait_um` farther out."""
    free = [float(each) for each in range(11)]
    again = [11.6 + wait_um, 11.9 + wait_um, 12.4 + wait_um, 12.8 + wait_um, 13.0 + wait_um]
    return out(
        [*free, 11.6, 7.9, 10.4, *again],
        [0.0] * 11 + [1.018, 0.067, 0.01, 0.013, 6.7, 23.7, 36.5, 44.1],
    )


def test_a_contact_that_is_touched_again_where_the_position_is_known_to_is_not_lost() -> None:
    assert not lost_while_pushing(touched_again(0.0), WAY_STD_UM)
    assert not lost_while_pushing(touched_again(0.1), WAY_STD_UM)


def test_a_force_that_is_missing_farther_out_is_lost() -> None:
    assert lost_while_pushing(touched_again(0.5), WAY_STD_UM)


@pytest.mark.parametrize("left_un", [0.0, 5.0])
def test_a_fibre_that_breaks_or_is_passed_by_loses_its_force(left_un: float) -> None:
    probe_um = [float(each) for each in range(30)]
    force_un = [max(0.0, 2.0 * (each - 10.0)) if each < 25 else left_un for each in probe_um]
    assert lost_while_pushing(out(probe_um, force_un), WAY_STD_UM)
    force_un = [max(0.0, 2.0 * (each - 10.0)) for each in probe_um]
    assert not lost_while_pushing(out(probe_um, force_un), WAY_STD_UM)
