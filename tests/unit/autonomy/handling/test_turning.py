"""About which point the plate turns: at which angles a fibre is looked at."""

import numpy as np
import pytest

from cosmic.autonomy.handling.plate import Candidate
from cosmic.autonomy.handling.turning import angles_about, to_follow


@pytest.mark.parametrize("begun", [-155.0, -120.0, -41.0, 0.0, 41.0, 82.0, 123.0, 155.0])
def test_a_fibre_is_followed_over_a_hundred_degrees_wherever_the_table_stands(begun: float) -> None:
    angles = angles_about(begun, 155.0)
    assert all(-155.0 <= each <= 155.0 for each in angles)
    assert np.diff(angles) == pytest.approx(20.0)
    assert len(angles) == 6
    assert min(abs(each - begun) for each in angles) <= 10.0


def test_certain_fibres_near_the_centre_are_followed_first() -> None:
    near, doubted, far, farther = (
        Candidate(np.array([[x, 0.0], [x, 900.0]]), 900.0, 30.0, 0.0, 60.0, doubted=x == 100.0)
        for x in (300.0, 100.0, 1500.0, 2500.0)
    )
    assert to_follow([farther, doubted, far, near]) == [near, far, farther]
    assert to_follow([far, doubted]) == [far, doubted]
