"""Reading and writing numbers with units."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosmic.frame.errors import QuantityError
from cosmic.frame.units import DISPLAY, format_quantity, parse_quantity, with_micro_signs

UNITS = ["um", "deg", "um/s", "deg/s", "V", "Hz", "steps"]
numbers = st.floats(min_value=-1e9, max_value=1e9)


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("120", "um", 120.0),
        (" -0.2 mm ", "um", -200.0),
        ("500nm", "um", 0.5),
        ("+1e3 um", "um", 1000.0),
        (".5 µm", "um", 0.5),
        ("5. μm", "um", 5.0),
        ("1 cm", "um", 1e4),
        ("0.01 m", "um", 1e4),
        ("1.5°", "deg", 1.5),
        ("250 mdeg", "deg", 0.25),
        ("3.141592653589793 rad", "deg", 180.0),
        ("1000 mrad", "deg", 180.0 / math.pi),
        ("0.1 kV", "V", 100.0),
        ("1 kHz", "Hz", 1000.0),
        ("-100 steps", "steps", -100.0),
        ("1 step", "steps", 1.0),
    ],
)
def test_a_number_is_read_in_the_unit_wanted(text: str, unit: str, value: float) -> None:
    assert parse_quantity(text, unit) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "  ",
        "x",
        "nan",
        "inf",
        "-inf",
        "1 2",
        "--5",
        "0x10",
        "1e",
        "1,234.5",
        "5 mm mm",
        "1e999",
    ],
)
def test_what_is_no_number_is_refused(text: str) -> None:
    with pytest.raises(QuantityError):
        parse_quantity(text, "um")


@pytest.mark.parametrize(("text", "unit"), [("5 V", "um"), ("5 um", "deg"), ("5 MM", "um")])
def test_a_unit_of_another_kind_is_refused_with_those_that_fit(text: str, unit: str) -> None:
    with pytest.raises(QuantityError, match="is not a unit that fits here; use one of .*" + unit):
        parse_quantity(text, unit)


def test_a_decimal_comma_is_refused_with_a_hint() -> None:
    with pytest.raises(QuantityError, match="as a point"):
        parse_quantity("1,5", "um")


def test_too_large_a_number_is_refused_after_conversion_too() -> None:
    with pytest.raises(QuantityError, match="too large"):
        parse_quantity("1e307 m", "um")


@given(numbers, st.sampled_from(UNITS))
def test_what_is_shown_can_be_typed_in_again(value: float, unit: str) -> None:
    shown = format_quantity(value, unit, decimals=3)
    assert parse_quantity(shown, unit) == pytest.approx(value, abs=0.5001e-3)


@given(numbers, st.sampled_from(UNITS))
def test_a_number_without_a_unit_has_the_unit_wanted(value: float, unit: str) -> None:
    assert parse_quantity(repr(value), unit) == value


@given(st.text(max_size=12), st.sampled_from(UNITS))
def test_any_text_gives_a_finite_number_or_a_quantity_error(text: str, unit: str) -> None:
    try:
        value = parse_quantity(text, unit)
    except QuantityError:
        return
    assert math.isfinite(value)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (12.34, "um", "12.3 µm"),
        (-0.04, "um", "0.0 µm"),
        (1.23456, "deg", "1.2346 °"),
        (99.96, "V", "100.0 V"),
        (1000.0, "Hz", "1000 Hz"),
        (3.0, "uN", "3 uN"),
    ],
)
def test_a_quantity_is_shown_with_the_digits_of_its_unit(
    value: float, unit: str, text: str
) -> None:
    assert format_quantity(value, unit) == text


def test_every_unit_that_is_read_is_shown() -> None:
    assert set(DISPLAY) == set(UNITS)


@pytest.mark.parametrize(
    ("written", "read"),
    [
        ("left X: jog right, 200 um/s, by key", "left X: jog right, 200 µm/s, by key"),
        ("-150 to 150 uN", "-150 to 150 µN"),
        ("(1500 um), 3uN/um at 2 uV", "(1500 µm), 3µN/µm at 2 µV"),
        ("position_um, 'um', sum, um_px", "position_um, 'um', sum, um_px"),
    ],
)
def test_a_sentence_for_the_operator_has_micro_signs(written: str, read: str) -> None:
    assert with_micro_signs(written) == read
