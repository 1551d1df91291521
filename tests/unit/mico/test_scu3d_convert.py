import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.mico.hw import scu3d_convert as convert
from cosmic.mico.hw.interface import Channel


@given(st.integers(-(2**31) + 1, 2**31 - 1))
def test_counts_survive_the_way_through_micrometres_and_back(counts: int) -> None:
    assert convert.position_counts(convert.position_from_counts(counts, "um"), "um") == counts


@given(st.integers(-3_599_999, 3_599_999))
def test_counts_survive_the_way_through_degrees_and_back(counts: int) -> None:
    assert convert.position_counts(convert.angle_deg(counts & 0xFFFFFFFF), "deg") == counts


@pytest.mark.parametrize("value_deg", [360.0, -360.0, 370.0, 2.1e5])
def test_a_full_turn_and_more_is_refused(value_deg: float) -> None:
    with pytest.raises(DeviceError, match=r"within 359\.9999 deg") as caught:
        convert.position_counts(value_deg, "deg")
    assert caught.value.fault is DeviceFault.PARAMETER


@given(st.floats(-2e8, 2e8))
def test_a_length_is_kept_to_half_a_count(value_um: float) -> None:
    counts = convert.position_counts(value_um, "um")
    assert convert.position_from_counts(counts, "um") == pytest.approx(value_um, abs=0.0501)


@given(st.floats(-359.9999, 359.9999))
def test_an_angle_is_kept_to_half_a_count(value_deg: float) -> None:
    counts = convert.position_counts(value_deg, "deg")
    assert convert.angle_deg(counts & 0xFFFFFFFF) == pytest.approx(value_deg, abs=0.0000501)


def test_the_scales_are_those_of_the_vendor() -> None:
    assert convert.position_counts(1.0, "um") == 10
    assert convert.position_counts(-0.3, "um") == -3
    assert convert.position_counts(1.0, "deg") == 10_000
    assert convert.decivolts(100.0) == 1000
    assert convert.hold_ms(1.5) == 1500
    assert convert.version_text(0x01050010) == "1.5.16"
    assert convert.version_text(0xFFFEFFFF) == "255.254.65535"


@pytest.mark.parametrize(
    ("data1", "revolution", "angle_deg"),
    [
        (15_000, 0, 1.5),
        (0xFFFFFFFF, 0, -0.0001),
        (2**32 - 900_000, 0, -90.0),
        (7_200_000, 0, 720.0),
        (100_000, 2, 730.0),
        (100_000, -1, -350.0),
    ],
)
def test_the_angle_of_a_packet_has_a_sign_and_may_exceed_a_turn(
    data1: int, revolution: int, angle_deg: float
) -> None:
    assert convert.angle_deg(data1, revolution) == pytest.approx(angle_deg)


def test_holding_for_ever_is_only_said_on_purpose() -> None:
    assert convert.hold_ms(math.inf) == convert.HOLD_FOR_EVER_MS == 60_000
    assert convert.hold_ms(59.999) == 59_999


@given(st.floats(0.0, 59.999))
def test_a_finite_hold_time_never_becomes_endless(hold_s: float) -> None:
    assert 0 <= convert.hold_ms(hold_s) < convert.HOLD_FOR_EVER_MS


@given(st.integers(-29_999, 29_999))
def test_a_finite_number_of_steps_stays_as_it_is(steps: int) -> None:
    assert convert.step_count(steps) == convert.step_count(np.int64(steps)) == steps


@given(st.integers().filter(lambda steps: abs(steps) > 29_999))
def test_a_number_that_could_mean_endless_steps_is_refused(steps: int) -> None:
    with pytest.raises(DeviceError):
        convert.step_count(steps)


@given(st.floats(15.0, 100.0))
def test_an_amplitude_in_range_stays_in_range(amplitude_v: float) -> None:
    assert 150 <= convert.decivolts(amplitude_v) <= 1000


@pytest.mark.parametrize("amplitude_v", [14.999, 100.001])
def test_an_amplitude_just_outside_is_not_rounded_into_the_range(amplitude_v: float) -> None:
    with pytest.raises(DeviceError):
        convert.decivolts(amplitude_v)


@given(st.floats(0.0, 1000.0))
def test_a_wait_is_never_shorter_than_asked(timeout_s: float) -> None:
    assert timeout_s * 1000 <= convert.timeout_ms(timeout_s) <= timeout_s * 1000 + 1


REFUSING: list[Callable[[float], int]] = [
    lambda value: convert.position_counts(value, "um"),
    lambda value: convert.position_counts(value, "deg"),
    convert.decivolts,
    convert.hold_ms,
    convert.timeout_ms,
    lambda value: convert.step_count(value),
    lambda value: convert.frequency(value),
    lambda value: convert.index(value, "device"),
]


@pytest.mark.parametrize("convert_one", REFUSING)
@pytest.mark.parametrize("value", [math.nan, -math.inf, -1e12])
def test_what_is_no_number_or_far_outside_is_refused(
    convert_one: Callable[[float], int], value: float
) -> None:
    with pytest.raises(DeviceError) as caught:
        convert_one(value)
    assert caught.value.fault is DeviceFault.PARAMETER


def test_a_refusal_names_the_channel_and_the_value() -> None:
    with pytest.raises(DeviceError) as caught:
        convert.decivolts(140.0, Channel(2, 1))
    assert str(caught.value) == "device 2, channel 1: amplitude must be 15 to 100 V, got 140.0 V"
    assert (caught.value.device, caught.value.channel) == (2, 1)


def test_an_index_that_32_bit_would_wrap_is_refused() -> None:
    assert convert.index(2**32 - 1, "device") == 2**32 - 1
    for number in (-1, 2**32):
        with pytest.raises(DeviceError, match="device must be 0 to 4294967295"):
            convert.index(number, "device")
