"""SCUs on serial lines: what becomes of noise, echoes, half lines, silence and a pulled cable."""

import math

import pytest

from contract.controller_rig import Rig
from contract.fake_scu_serial import FakeScuLines
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.mico.hw.interface import (
    Activity,
    ActivityRead,
    Channel,
    Completed,
    Failed,
    PositionRead,
    SensorPresentRead,
)
from cosmic.mico.hw.scu_serial import ScuSerialController
from cosmic.mico.hw.sim_scu_serial import SimulatedScus

AT, OTHER, ROTARY = Channel(0, 0), Channel(0, 1), Channel(3, 0)


def controller(lines, **options):
    return ScuSerialController("0123", lines.open_port, **{"answer_s": 0.05} | options)


@pytest.fixture
def lines():
    return FakeScuLines()


@pytest.fixture
def rig(lines):
    with Rig(controller(lines)) as opened:
        for unit in lines.units:
            unit.heard.clear()
        yield opened


def events(rig, device, timeout_s=0.02):
    found = []
    while (event := rig.controller.receive(device, timeout_s)) is not None:
        found.append(event)
    return found


def test_what_is_sent_is_in_the_units_of_the_protocol(rig, lines):
    rig.controller.move_to(AT, 12.34, "um", hold_s=0.5)
    events(rig, 0)
    rig.controller.move_by(ROTARY, -1.5, "deg", hold_s=math.inf)
    events(rig, 3)
    rig.controller.step(AT, -100, amplitude_v=50.0, frequency_hz=250)
    events(rig, 0)
    assert lines.units[0].heard == ["MPA0P12.3H500", "D0F250A500S100"]
    assert lines.units[3].heard == ["MAR0A-1500.0R0H60000"]


def test_an_angle_is_read_from_millidegrees_and_turns(rig, lines):
    rig.controller.ask_position(ROTARY, "deg")
    lines.units[3].answers.clear()
    lines.units[3].say("A0A-187.2R1")
    assert rig.event(PositionRead, ROTARY).value == pytest.approx(359.8128)


def test_one_line_is_unanswered_at_a_time_and_commands_come_before_questions(rig, lines):
    for _ in range(3):
        rig.controller.ask_position(AT, "um")
        rig.controller.ask_activity(AT)
    rig.controller.move_to(AT, 1.0, "um", hold_s=0.0)
    assert lines.units[0].heard == ["GP0"]
    events(rig, 0)
    assert lines.units[0].heard[:2] == ["GP0", "MPA0P1.0H0"]


def test_a_question_that_was_put_again_meanwhile_is_answered_without_asking_twice(rig, lines):
    for _ in range(5):
        rig.controller.ask_position(AT, "um")
    answers = [each for each in events(rig, 0) if isinstance(each, PositionRead)]
    assert len(answers) == 5
    assert lines.units[0].heard == ["GP0", "GP0"]


def test_what_a_channel_said_before_a_command_is_no_answer_after_it(rig, lines):
    rig.controller.ask_activity(OTHER)
    for _ in range(2):
        rig.controller.ask_activity(AT)
    rig.controller.move_to(AT, 5.0, "um", hold_s=math.inf)
    rig.controller.ask_activity(AT)
    said = [each.activity for each in events(rig, 0) if isinstance(each, ActivityRead)]
    assert said[-1] is Activity.HOLDING


def test_a_stop_overtakes_what_waits_and_what_was_to_move_its_channel_is_not_sent(rig, lines):
    for _ in range(20):
        rig.controller.ask_position(OTHER, "um")
    rig.controller.move_to(AT, 900.0, "um", hold_s=0.0)
    rig.controller.move_to(OTHER, 7.0, "um", hold_s=0.0)
    rig.controller.stop(AT)
    assert lines.units[0].heard == ["GP1", "S0"]
    events(rig, 0)
    assert "MPA0P900.0H0" not in lines.units[0].heard
    assert "MPA1P7.0H0" in lines.units[0].heard


def test_a_stop_is_sent_though_another_thread_queues_a_movement_meanwhile(rig, lines):
    class InterruptedChannel(Channel):
        """While it is compared, another thread has its turn."""

        def __eq__(self, other):
            rig.controller.move_by(OTHER, 1.0, "um", hold_s=0.0)
            return super().__eq__(other)

        __hash__ = Channel.__hash__

    lines.units[0].deaf = {"MPR"}  # what is queued stays queued
    for at in (OTHER, InterruptedChannel(0, 1), OTHER):
        rig.controller.move_by(at, 1.0, "um", hold_s=0.0)
    rig.controller.stop(AT)
    assert lines.units[0].heard == ["MPR1P1.0H0", "S0"]


def test_an_opening_that_fails_half_way_leaves_no_port_taken(lines):
    lines.units[2].deaf = {"K"}
    opened = controller(lines)
    with pytest.raises(DeviceError):
        opened.open()
    assert not any(unit.taken for unit in lines.units)
    lines.units[2].deaf.clear()
    assert len(opened.open()) == 4
    opened.close()


@pytest.mark.parametrize("pieces", [1, 3])
def test_lines_that_come_in_pieces_are_put_together(rig, lines, pieces):
    lines.units[0].pieces = pieces
    lines.units[0].position[0] = -13.5
    assert rig.position(AT) == -13.5


@pytest.mark.parametrize(
    "noise", [b"\x00\xff\x80", b"P0P99", b":P0P9", b"\n\n:\n", b":E0\n", b":C"]
)
def test_garbage_before_an_answer_does_not_change_it(rig, lines, noise):
    lines.units[0].noise = noise
    lines.units[0].position[0] = 42.5
    assert rig.position(AT) == 42.5
    assert rig.activity(AT) is Activity.STOPPED


def test_an_answer_of_another_channel_or_kind_is_not_taken(rig, lines):
    lines.units[0].deaf = {"GP"}
    rig.controller.ask_position(AT, "um")
    for text in ("P1P7.0", "A0A7.0R0", "P0P7,0", "P0Pnan", "P0P", "M0S"):
        lines.units[0].say(text)
    assert not [each for each in events(rig, 0, 0.1) if isinstance(each, PositionRead)]


def test_a_line_that_echoes_is_noticed_and_works(lines):
    for unit in lines.units:
        unit.echo = True
    with Rig(controller(lines)) as rig:
        rig.controller.report_completion(AT)
        rig.controller.move_to(AT, 5.0, "um", hold_s=0.0)
        rig.event(Completed, AT)
        assert rig.position(AT) == 5.0
        rig.controller.stop(AT)
        assert rig.activity(AT) is Activity.STOPPED


def test_a_command_that_arrived_garbled_is_sent_again(rig, lines):
    lines.units[0].garbled = 2
    rig.controller.move_to(AT, 5.0, "um", hold_s=0.0)
    assert not events(rig, 0)
    assert lines.units[0].heard == ["MPA0P5.0H0"] * 3
    lines.units[0].garbled = 9
    rig.controller.move_to(AT, 6.0, "um", hold_s=0.0)
    assert rig.event(Failed, AT).error.fault is DeviceFault.COMMUNICATION
    assert lines.units[0].heard[3:] == ["MPA0P6.0H0"] * 3


def test_a_movement_that_arrived_garbled_is_not_sent_again_after_a_stop(rig, lines):
    lines.units[0].garbled = 1
    rig.controller.move_to(AT, 5.0, "um", hold_s=0.0)
    rig.controller.stop(AT)
    rig.controller.move_to(OTHER, 7.0, "um", hold_s=0.0)
    events(rig, 0)
    assert lines.units[0].heard == ["MPA0P5.0H0", "S0", "MPA1P7.0H0"]
    rig.controller.move_to(AT, 6.0, "um", hold_s=0.0)
    events(rig, 0)
    assert lines.units[0].heard[3:] == ["MPA0P6.0H0"]


def test_a_movement_that_is_not_acknowledged_has_failed_for_nobody_knows(rig, lines):
    lines.units[0].deaf = {"MPA"}
    rig.controller.move_to(AT, 5.0, "um", hold_s=0.0)
    assert rig.event(Failed, AT).error.fault is DeviceFault.TIMEOUT
    assert lines.units[0].heard.count("MPA0P5.0H0") == 1


def test_a_stop_that_is_not_acknowledged_is_sent_again(rig, lines):
    lines.units[0].deaf = {"S"}
    rig.controller.stop(AT)
    rig.controller.receive(0, 0.08)
    assert lines.units[0].heard.count("S0") >= 2


def test_a_lost_answer_is_survived_and_a_silent_unit_is_lost(rig, lines):
    lines.units[0].deaf = {"GP"}
    rig.controller.ask_position(AT, "um")
    rig.controller.ask_sensor_present(AT)
    assert rig.event(SensorPresentRead, AT).present
    lines.units[0].deaf = {"GP", "M", "GSP", "K"}
    with pytest.raises(DeviceError) as caught:
        for _ in range(20):
            rig.controller.ask_activity(AT)
            rig.controller.receive(0, 0.1)
    assert caught.value.fault is DeviceFault.TIMEOUT
    with pytest.raises(DeviceError):
        rig.controller.stop(AT)
    rig.controller.ask_activity(Channel(1, 0))
    rig.event(ActivityRead, Channel(1, 0))


def test_a_pulled_cable_is_reported_at_once_and_spares_the_others(rig, lines):
    lines.units[0].gone = True
    with pytest.raises(DeviceError) as caught:
        rig.controller.receive(0, 0.1)
    assert (caught.value.fault, caught.value.device) == (DeviceFault.COMMUNICATION, 0)
    with pytest.raises(DeviceError, match="check cable"):
        rig.controller.stop(AT)
    rig.controller.stop(Channel(1, 0))
    rig.controller.close()
    lines.units[0].gone = False
    assert len(rig.controller.open()) == 4


def test_a_port_without_a_unit_is_left_out_and_named_when_it_is_wanted(lines):
    lines.units[2].deaf = {"E"}
    made = controller(lines)
    assert made.find_devices() == (501, 502, 504)
    with pytest.raises(NotConnectedError, match="503"):
        made.open([501, 503])
    made.close()


def test_what_comes_unasked_is_reported_with_its_reason(rig, lines):
    lines.units[0].say("C1")
    lines.units[0].say("CE0E21")
    lines.units[0].say("CE255E23")
    completed, ended, whole = events(rig, 0)
    assert completed == Completed(OTHER)
    assert ended.error.fault is DeviceFault.END_STOP
    assert whole.channel is None
    assert whole.error.fault is DeviceFault.HIGH_VOLTAGE


@pytest.mark.parametrize("code", [5, 99, 27])
def test_every_error_code_fails_the_command_that_it_answers(rig, lines, code):
    lines.units[0].deaf = {"CS"}
    rig.controller.calibrate(AT)
    lines.units[0].say(f"E{code}")
    failed = rig.event(Failed, AT)
    assert failed.error.code == code
    assert "CS0" in str(failed.error)


def test_a_unit_is_reported_to_stop_by_itself_when_this_program_falls_silent(lines):
    with Rig(controller(lines, keep_alive_s=0.06)) as rig:
        assert "K60" in lines.units[0].heard
        lines.units[0].heard.clear()
        events(rig, 0, 0.1)
        assert "K" in lines.units[0].heard


def test_a_simulated_unit_that_is_unplugged_is_left_out_as_a_real_one():
    scus = SimulatedScus(clock=ManualClock(auto_advance=True))
    scus.faults.inject("unplugged", device=1)
    opened = ScuSerialController("0123", scus.open_port, keep_alive_s=0.0, simulated=True)
    assert [each.serial for each in opened.open()] == [scus.units[n].serial for n in (0, 2, 3)]
    opened.close()


def test_a_simulated_unit_stops_when_its_keep_alive_is_over_though_nobody_looks():
    clock = ManualClock()
    scus = SimulatedScus(clock=clock)
    unit, stage = scus.units[0], scus.scene.stages["0.0"]
    stage_um = stage.position(0.0)
    unit.hear(b":K1000\n:SRC0R1\n:U0F1000A1000S30000\n")
    clock.advance(10.0)
    unit.hear(b":M0\n")
    assert b":M0S" in (clock.advance(1.0), unit.say())[1]
    went_um = stage.position(clock.now_s()) - stage_um
    assert went_um == pytest.approx(1000 * stage.step_size(100.0, 1), rel=0.05)
