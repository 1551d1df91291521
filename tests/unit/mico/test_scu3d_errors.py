import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosmic.frame.errors import DeviceError, DeviceFault, DeviceTimeout, NotConnectedError
from cosmic.mico.hw import scu3d_ctypes as sa
from cosmic.mico.hw.scu3d_errors import STATUS, status_error

CODES = {*range(1, 11), *range(12, 20), *range(128, 139), 255}
CONSTANTS = {name: value for name, value in vars(sa).items() if name.endswith("_ERROR")}


def test_every_code_of_the_header_has_a_meaning_and_no_other() -> None:
    assert set(STATUS) == CODES == set(CONSTANTS.values())


def test_every_code_carries_the_name_of_the_header() -> None:
    assert {f"SA_{status.name}": code for code, status in STATUS.items()} == CONSTANTS


@pytest.mark.parametrize(
    ("code", "fault"),
    [
        (2, DeviceFault.STATE),
        (5, DeviceFault.NO_CHANNEL),
        (6, DeviceFault.NO_CHANNEL),
        (7, DeviceFault.COMMUNICATION),
        (9, DeviceFault.PARAMETER),
        (10, DeviceFault.COMMUNICATION),
        (13, DeviceFault.STATE),
        (15, DeviceFault.TIMEOUT),
        (129, DeviceFault.UNSUPPORTED),
        (130, DeviceFault.NO_SENSOR),
        (131, DeviceFault.WRONG_KIND),
        (132, DeviceFault.END_STOP),
        (133, DeviceFault.OVERRIDDEN),
        (134, DeviceFault.HIGH_VOLTAGE),
        (135, DeviceFault.OVERHEATED),
        (136, DeviceFault.CALIBRATION),
        (137, DeviceFault.REFERENCE),
        (138, DeviceFault.BUSY),
        (255, DeviceFault.OTHER),
    ],
)
def test_a_code_has_the_fault_that_other_controllers_share(code: int, fault: DeviceFault) -> None:
    error = status_error(code, "SA_Stop_A()", device=1, channel=2)
    assert (error.fault, error.code, error.device, error.channel) == (fault, code, 1, 2)


def test_a_controller_that_is_gone_and_a_late_answer_have_their_own_exceptions() -> None:
    kinds = {code: type(status_error(code, "x")) for code in CODES}
    assert {c for c, kind in kinds.items() if kind is NotConnectedError} == {3, 19}
    assert {c for c, kind in kinds.items() if kind is DeviceTimeout} == {15}


def test_the_text_says_where_what_was_asked_what_came_back_and_what_to_do() -> None:
    error = status_error(134, "SA_MoveStep_A(5, 1000, 100)", device=1, channel=2, serial=4711)
    text = str(error)
    assert text.startswith("device 1 (serial 4711), channel 2: SA_MoveStep_A(5, 1000, 100)")
    assert "134 (SA_HV_RANGE_ERROR)" in text
    assert "switch the controller off and on" in text


@given(st.integers(0, 2**32 - 1).filter(lambda code: code not in CODES))
def test_a_code_that_nobody_documented_is_still_an_error(code: int) -> None:
    error = status_error(code, "SA_Stop_A()", device=0)
    assert type(error) is DeviceError
    assert error.fault is DeviceFault.OTHER
    assert f"unknown status {code}" in str(error)
