"""A slope is written with as many figures as are known of it."""

import math

import numpy as np
import pytest

from cosmic.daqco.core.curves import Slope, fit_slope
from cosmic.frame.errors import RecordingError


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (16.1604, 3.6543, "16.2 ± 3.7 µN/s"),
        (-0.00281, 0.00031, "-0.00281 ± 0.00031 µN/s"),
        (1234.4, 56.0, "1234 ± 56 µN/s"),
        (12.5, 0.0, "12.500 ± 0.000 µN/s"),
        (12.5, math.nan, "12.500 ± nan µN/s"),
    ],
)
def test_a_slope_has_two_figures_of_its_error(value: float, error: float, text: str) -> None:
    assert Slope(value, error, "µN/s", 0.0, 0.0, 100).text == text


@pytest.mark.parametrize("position", [388.6, 0.1, -4999.7])
def test_over_an_axis_that_stood_still_there_is_no_slope(position: float) -> None:
    forces = np.linspace(0.0, 50.0, 1338)
    with pytest.raises(RecordingError, match="travel"):
        fit_slope(np.full(forces.size, position), forces, "uN/um")
    moved = fit_slope(position + np.linspace(0.0, 0.01, forces.size), forces, "uN/um")
    assert moved.value == pytest.approx(5000.0)
