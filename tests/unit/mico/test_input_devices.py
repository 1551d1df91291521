"""What steers: gamepads through SDL itself, recordings, keys and the simulated haptic device."""

import os
import signal
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import ConfigError, NotConnectedError
from cosmic.mico.hw.input_device import Feedback, InputKind
from cosmic.mico.hw.input_sources import InputSources
from cosmic.mico.hw.keyboard_input import KeyboardSource
from cosmic.mico.hw.recorded_input import InputEvent, RecordedInput, read_events
from cosmic.mico.hw.sdl_input import PAD_AXES, SdlSource
from cosmic.mico.hw.sim_haptic import FORCE_N, SimHapticSource
from cosmic.testing.virtual_gamepad import VirtualGamepad


@pytest.fixture
def sdl():
    source = SdlSource()
    yield source
    source.close()


# Gamepads and joysticks


def test_a_gamepad_is_found_read_and_missed_when_it_is_unplugged(sdl):
    assert sdl.devices() == ()
    with VirtualGamepad() as pad:
        (info,) = sdl.devices()
        assert (info.key, info.kind) == (pad.key, InputKind.GAMEPAD)
        device = sdl.open(pad.key)
        pad.push("left_x", 0.5)
        pad.push("left_y", 1.0)
        pad.press("a")
        state = device.poll()
        assert state.axes["left_x"] == pytest.approx(0.5, abs=0.001)
        assert state.axes["left_y"] == pytest.approx(1.0, abs=0.001), "up is forwards"
        assert [name for name, down in state.buttons.items() if down] == ["a"]
        assert state.connected
        assert device.poll().time_s == state.time_s, "nothing new was reported"
        pad.push("left_x", -1.0)
        assert device.poll().time_s > state.time_s
        assert device.poll().axes["left_x"] == -1.0
        pad.unplug()
        assert not device.poll().connected
        assert sdl.devices() == ()
        device.close()
        assert not device.poll().connected
        with pytest.raises(NotConnectedError, match="plug it in"):
            sdl.open(pad.key)


def test_a_gamepad_plugged_in_while_the_program_runs_is_found(sdl):
    with VirtualGamepad(), VirtualGamepad() as second:
        assert [info.key for info in sdl.devices()][1] == second.key
        sdl.open(second.key).close()


def test_a_joystick_of_any_shape_has_numbered_axes(sdl):
    with VirtualGamepad(gamepad=False) as stick:
        (info,) = sdl.devices()
        assert info.kind is InputKind.JOYSTICK
        device = sdl.open(info.key)
        stick.push("right_x", -0.25)
        assert device.poll().axes["axis_2"] == pytest.approx(-0.25, abs=0.001)
        assert device.info.axes == tuple(f"axis_{number}" for number in range(len(PAD_AXES)))
        device.feel({"x": 1.0})  # it cannot, and says so
        assert device.info.feedback is Feedback.NONE
        device.close()
        device.close()


def test_sdl_leaves_environment_and_signals_alone(sdl):
    before, handler = dict(os.environ), signal.getsignal(signal.SIGINT)
    sdl.devices()
    assert dict(os.environ) == before
    assert signal.getsignal(signal.SIGINT) is handler


# Recordings


def recording(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "hand.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_recording_is_played_in_its_own_time_and_then_gone(tmp_path):
    clock = ManualClock()
    path = recording(
        tmp_path,
        "# a comment\ntime_s,what,name,value\n"
        "0.0,axis,left_x,0.0\n0.5,axis,left_x,-0.75\n0.5,button,a,1\n1.0,axis,left_x,0\n",
    )
    device = RecordedInput(read_events(path), clock=clock, linger_s=0.2)
    assert device.poll().axes == {"left_x": 0.0}
    clock.advance(0.6)
    assert device.poll().axes == {"left_x": -0.75}
    assert device.poll().buttons == {"a": True}
    clock.advance(0.5)
    assert device.poll().axes == {"left_x": 0.0}
    assert device.poll().connected
    clock.advance(0.2)
    assert not device.poll().connected


def test_a_recording_can_freeze_and_be_unplugged():
    clock = ManualClock()
    frozen = RecordedInput([InputEvent(0.0, "device", "frozen")], clock=clock)
    first = frozen.poll()
    clock.advance(10.0)
    assert frozen.poll() == first
    gone = RecordedInput([InputEvent(0.0, "device", "unplugged")], clock=clock)
    assert not gone.poll().connected


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("0.0,axis,x", "3 columns"),
        ("0.0,axis,x,1.5", "between -1 and 1"),
        ("0.0,axis,x,nan", "between -1 and 1"),
        ("nan,axis,x,0", "time_s"),
        ("-1,axis,x,0", "time_s"),
        ("0.0,button,a,2", "0 or 1"),
        ("0.0,device,fire,", "frozen or unplugged"),
        ("0.0,stick,x,0", "axis, button or device"),
        ("abc,axis,x,0", "could not convert"),
    ],
)
def test_a_wrong_line_is_refused_with_its_number(tmp_path, line, why):
    path = recording(tmp_path, f"time_s,what,name,value\n0.0,axis,x,0\n{line}\n")
    with pytest.raises(ConfigError, match=why) as caught:
        read_events(path)
    assert f"{path}:3: " in str(caught.value)


@pytest.mark.parametrize("text", ["", "x,y\n", "time_s,what,name,value\n1,axis,x,0\n0,axis,x,0\n"])
def test_a_foreign_or_unordered_file_is_refused(tmp_path, text):
    with pytest.raises(ConfigError):
        read_events(recording(tmp_path, text))


@given(st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(b"time_s,what,name,value\n" + data)
    with suppress(ConfigError):
        read_events(path)


# The haptic device and keys


def haptic():
    clock = ManualClock()
    source = SimHapticSource(clock)
    device = source.open("haptic:sim")
    return clock, source.haptic, device


def play(clock, device, duration_s):
    for _ in range(round(duration_s / 0.01)):
        clock.advance(0.01)
        device.poll()
    return device.poll()


def test_the_stylus_follows_the_hand_and_gives_way_to_a_force():
    clock, hand, device = haptic()
    hand.move_hand(x=0.5)
    assert play(clock, device, 0.5).axes["x"] == pytest.approx(0.5, abs=0.01)
    device.feel({"x": -0.5})
    assert hand.felt_n["x"] == pytest.approx(-0.5 * FORCE_N)
    pushed = play(clock, device, 0.5).axes["x"]
    assert pushed == pytest.approx(0.5 - 0.5 * FORCE_N / (150.0 * 0.08), abs=0.01)
    device.feel({})
    assert play(clock, device, 0.5).axes["x"] == pytest.approx(0.5, abs=0.01)


def test_a_force_that_is_none_is_not_felt():
    _, hand, device = haptic()
    device.feel({"x": float("nan"), "y": 3.0})
    assert hand.felt_n == {"x": 0.0, "y": 0.0, "z": 0.0}


def test_a_haptic_device_has_one_user_and_lets_go_of_the_hand():
    _, hand, device = haptic()
    with pytest.raises(NotConnectedError):
        hand.claim()
    device.feel({"x": 1.0})
    device.close()
    assert hand.felt_n["x"] == 0.0
    hand.claim()


def test_keys_are_an_input_while_a_window_has_plugged_them_in():
    source = KeyboardSource()
    assert source.devices() == ()
    with pytest.raises(NotConnectedError):
        source.open("keyboard:window")
    source.keyboard.plug(plugged=True)
    device = source.open(source.devices()[0].key)
    source.keyboard.hold(("6", "2", "8"))
    assert device.poll().axes == {"left_x": 1.0, "left_y": 0.0, "right_x": 0.0, "right_y": 0.0}
    source.keyboard.plug(plugged=False)
    state = device.poll()
    assert not state.connected
    assert not any(state.axes.values())


def test_a_real_platform_has_no_simulated_device(tmp_path):
    sources = InputSources(simulated=False)
    assert sources.devices() == ()
    for key in ("haptic:sim", "nothing", f"recorded:{tmp_path}/none.csv", "sdl:9"):
        with pytest.raises(NotConnectedError):
            sources.open(key)
    sources.close()
