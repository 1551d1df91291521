"""The bytes on the lines of lens and light, as literal bytes, and what is done about broken ones.

Generation 1: examples of independent programs for the same controller.
"""

import pytest

from cosmic.frame.errors import (
    DeviceTimeout,
    NotAvailable,
    NotConnectedError,
    ProtocolError,
)
from cosmic.vico.hw.brightlight import BrightLight
from cosmic.vico.hw.navitar import NavitarLens
from cosmic.vico.hw.navitar_protocol import (
    AsciiRegisters,
    FrameRegisters,
    Product,
    find_answer,
    motor_status,
    probe,
    write_frame,
)
from cosmic.vico.hw.peripherals import LensAxis
from unit.vico.hw.byte_dialogue import hexed, port

ASK_ID = hexed("FF 01 00 00 00 00 00")
ID_MOTORS = hexed("FF 01 01 40 00 00 BF")
ID_LIGHT = hexed("FF 01 00 40 00 00 C0")
CTRL_C, PROMPT = b"\x03", b"\r\n$ "


def test_frames_are_those_that_other_programs_send() -> None:
    assert write_frame(0x10, 1000) == hexed("FF 90 E8 03 00 00 86")
    assert write_frame(0x11, -100) == hexed("FF 91 9C FF FF FF D7")


def test_the_product_is_asked_for_and_understood() -> None:
    line, serial_port = port((ASK_ID, ID_MOTORS))
    assert FrameRegisters(serial_port).read(0x01) == Product.MOTORS
    line.finish()


def test_a_negative_position_is_negative() -> None:
    ask = hexed("FF 12 00 00 00 00 EF")
    _, serial_port = port((ask, hexed("FF 12 9C FF FF FF 56")))
    assert FrameRegisters(serial_port).read(0x12) == -100


def test_a_seek_writes_the_target_and_reads_the_answer() -> None:
    line, serial_port = port(
        (hexed("FF 1C 00 00 00 00 E5"), hexed("FF 1C E0 2E 00 00 D7")),  # limit 12000
        (hexed("FF 90 E8 03 00 00 86"), hexed("FF 10 E8 03 00 00 06")),
    )
    NavitarLens(FrameRegisters(serial_port), name="lens", homed=True).seek(LensAxis.ZOOM, 1000)
    line.finish()


def test_the_second_axis_is_sixteen_registers_further_on() -> None:
    line, serial_port = port(
        (hexed("FF 24 00 00 00 00 DD"), hexed("FF 24 07 00 00 00 D6")),  # seeking in reverse
        (hexed("FF 22 00 00 00 00 DF"), hexed("FF 22 10 00 00 00 CF")),
        (hexed("FF 2C 00 00 00 00 D5"), hexed("FF 2C 64 00 00 00 71")),
    )
    state = NavitarLens(FrameRegisters(serial_port), name="lens").state(LensAxis.FOCUS)
    assert (state.position_counts, state.limit_counts, state.moving) == (16, 100, True)
    line.finish()


def test_home_and_abort_are_written_to_the_command_register() -> None:
    line, serial_port = port(
        (hexed("FF 93 00 00 00 00 6E"), hexed("FF 13 00 00 00 00 EE")),
        (hexed("FF 93 02 00 00 00 6C"), hexed("FF 13 02 00 00 00 EC")),
        (hexed("FF A3 02 00 00 00 5C"), hexed("FF 23 02 00 00 00 DC")),
    )
    lens = NavitarLens(FrameRegisters(serial_port), name="lens")
    lens.home(LensAxis.ZOOM)
    lens.abort()
    line.finish()


def test_the_light_counts_tenths_of_a_percent() -> None:
    line, serial_port = port(
        (hexed("FF C0 F4 01 00 00 4C"), hexed("FF 40 F4 01 00 00 CC")),
        (hexed("FF C0 43 01 00 00 FD"), hexed("FF 40 43 01 00 00 7D")),
        (hexed("FF 40 00 00 00 00 C1"), hexed("FF 40 E8 03 00 00 D6")),
    )
    light = BrightLight(FrameRegisters(serial_port))
    light.set_percent(50.0)
    light.set_percent(32.299999999999997)
    assert light.percent() == 100.0
    line.finish()


def test_a_brightness_that_cannot_be_is_no_brightness() -> None:
    _, serial_port = port((hexed("FF 40 00 00 00 00 C1"), hexed("FF 40 E9 03 00 00 D5")))
    with pytest.raises(ProtocolError, match="1001"):
        BrightLight(FrameRegisters(serial_port)).percent()


@pytest.mark.parametrize("noise", ["00", "FF", "FF FF FF", "12 34 56", "FF 01 00 00 00 00", "01"])
def test_the_answer_is_found_behind_noise(noise: str) -> None:
    line, serial_port = port((ASK_ID, hexed(noise) + ID_MOTORS))
    assert FrameRegisters(serial_port).read(0x01) == 0x4001
    line.finish()


def test_bytes_that_came_unasked_are_thrown_away() -> None:
    line, serial_port = port((ASK_ID, ID_MOTORS))
    line.say(ID_LIGHT)
    assert FrameRegisters(serial_port).read(0x01) == 0x4001


@pytest.mark.parametrize(
    "broken", ["", "01 01 40 00 00 BF", "FF 01 01 40 00 00", "FF 01 01 40 00 00 BE"]
)
def test_a_broken_answer_is_asked_for_again(broken: str) -> None:
    line, serial_port = port((ASK_ID, hexed(broken)), (ASK_ID, ID_MOTORS))
    assert FrameRegisters(serial_port).read(0x01) == 0x4001
    line.finish()


def test_an_answer_about_another_register_is_none() -> None:
    assert find_answer(hexed("FF 12 00 00 00 00 EF"), 0x22) is None


def test_it_gives_up_after_three_times_with_the_bytes_in_the_text() -> None:
    line, serial_port = port(*[(ASK_ID, hexed("DE AD BE EF 00 00 00 01"))] * 3)
    with pytest.raises(ProtocolError, match=r"COM7.*3 times.*de ad be ef") as caught:
        FrameRegisters(serial_port).read(0x01)
    assert "ff 01 00" in str(caught.value)
    line.finish()


def test_a_status_that_is_not_known_is_an_error() -> None:
    assert motor_status(0x100).at_home and not motor_status(0x100).moving
    assert motor_status(0x200).at_limit
    with pytest.raises(ProtocolError, match="0xd"):
        motor_status(13)


# Generation 2


def said(command: str, value: str = "") -> tuple[bytes, bytes]:
    answer = f"{command}\r\n{value}" if value else command
    return f"{command}\r".encode(), answer.encode() + PROMPT


def test_text_is_begun_with_ctrl_c_and_values_are_asked_for_twice() -> None:
    line, serial_port = port((CTRL_C, PROMPT), said("read 18", "-42"), said("read 18", "-42"))
    assert AsciiRegisters(serial_port).read(0x12) == -42
    line.finish()


def test_of_three_different_values_the_middle_one_is_taken() -> None:
    line, serial_port = port(
        (CTRL_C, PROMPT), *(said("read 18", value) for value in ("1000", "101", "1020"))
    )
    assert AsciiRegisters(serial_port).read(0x12) == 1000
    line.finish()


@pytest.mark.parametrize(("text", "value"), [("4294967196", -100), ("0x5001", 0x5001)])
def test_values_may_be_unsigned_or_hexadecimal(text: str, value: int) -> None:
    _, serial_port = port((CTRL_C, PROMPT), *[said("read 1", text)] * 2)
    assert AsciiRegisters(serial_port).read(1) == value


def test_a_write_is_decimal() -> None:
    line, serial_port = port((CTRL_C, PROMPT), said("write 16 1000"))
    AsciiRegisters(serial_port).write(0x10, 1000)
    line.finish()


def test_a_command_that_came_over_broken_is_sent_again() -> None:
    line, serial_port = port(
        (CTRL_C, PROMPT),
        (b"write 16 1000\r", b"write 16 100" + PROMPT),  # a digit was lost: the echo tells
        (CTRL_C, PROMPT),
        said("write 16 1000"),
    )
    AsciiRegisters(serial_port).write(0x10, 1000)
    line.finish()


def test_a_complaint_is_an_error_with_its_bytes() -> None:
    complaint = (b"read 18\r", b"read 18\r\nunknown command" + PROMPT)
    line, serial_port = port(*[(CTRL_C, PROMPT), complaint] * 3)
    with pytest.raises(ProtocolError, match=r"3 times.*" + b"unknown".hex(" ")):
        AsciiRegisters(serial_port).read(0x12)
    line.finish()


def test_nobody_there_is_asked_three_times_only() -> None:
    line, serial_port = port(*[(CTRL_C, b"")] * 3)
    with pytest.raises(DeviceTimeout, match="no answer"):
        AsciiRegisters(serial_port).read(0x12)
    line.finish()


# Finding out


def test_frames_are_tried_before_text() -> None:
    line, serial_port = port((ASK_ID, ID_LIGHT))
    found = probe(serial_port)
    assert (found.product, found.generation) == (Product.BRIGHTLIGHT, 1)
    line.finish()


def test_who_understands_no_frames_is_spoken_to_in_text() -> None:
    line, serial_port = port(
        (ASK_ID, b""), (CTRL_C, PROMPT), said("read 1", "20481"), said("read 1", "20481")
    )
    found = probe(serial_port)
    assert (found.product, found.generation) == (Product.MOTORS_2, 2)
    line.finish()


def test_nobody_known_is_said_and_the_port_given_back() -> None:
    strange = hexed("FF 01 34 12 00 00 BA")
    line, serial_port = port((ASK_ID, strange), *[(CTRL_C, b"")] * 2, (ASK_ID, strange))
    with pytest.raises(NotConnectedError, match="0x1234, which is not known"):
        probe(serial_port)
    line.finish()
    assert line.closed


# What the controller does not tell


def counts(register: int, value: int) -> tuple[bytes, bytes]:
    """Return question and answer about a register, made here by hand."""
    ask = bytes([0xFF, register, 0, 0, 0, 0])
    answer = bytes([0xFF, register]) + value.to_bytes(4, "little", signed=True)
    return ask + bytes([-sum(ask) % 256]), answer + bytes([-sum(answer) % 256])


def test_a_controller_that_counts_from_zero_again_was_switched_off() -> None:
    _, serial_port = port(
        counts(0x1C, 12000),
        (write_frame(0x10, 1000), counts(0x10, 1000)[1]),
        *(counts(0x14, 0), counts(0x12, 1000)),
        *(counts(0x14, 0), counts(0x12, 0)),
    )
    lens = NavitarLens(FrameRegisters(serial_port), name="lens", homed=True)
    lens.seek(LensAxis.ZOOM, 1000)
    assert lens.state(LensAxis.ZOOM).homed
    assert not lens.state(LensAxis.ZOOM).homed
    with pytest.raises(NotAvailable, match="home it first"):
        lens.seek(LensAxis.ZOOM, 500)


def test_homing_that_ends_far_from_zero_is_none() -> None:
    home = hexed("FF 93 00 00 00 00 6E"), hexed("FF 13 00 00 00 00 EE")
    _, serial_port = port(
        home,
        *(counts(0x14, 1), counts(0x12, 900), counts(0x1C, 12000)),
        *(counts(0x14, 0), counts(0x12, 700)),
    )
    lens = NavitarLens(FrameRegisters(serial_port), name="lens")
    lens.home(LensAxis.ZOOM)
    assert lens.state(LensAxis.ZOOM).moving
    assert not lens.state(LensAxis.ZOOM).homed


def test_limits_that_are_given_are_not_asked_for() -> None:
    line, serial_port = port((write_frame(0x10, 500), counts(0x10, 500)[1]))
    lens = NavitarLens(
        FrameRegisters(serial_port),
        name="lens",
        homed=True,
        limits_counts={LensAxis.ZOOM: 500},
    )
    lens.seek(LensAxis.ZOOM, 500)
    line.finish()
