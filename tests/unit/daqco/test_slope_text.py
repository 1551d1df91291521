"""A slope is written with as many figures as are known of it."""

import math

import pytest

from cosmic.daqco.core.curves import Slope


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
