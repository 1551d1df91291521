"""What a controller can do is asked of it: channels, steps, frequencies, amplitudes."""

import pytest

import cosmic
from cosmic.mico.hw.interface import Capabilities
from unit.mico.rigs import mico
from unit.mico.scripted_controller import ScriptedController

ABLE = Capabilities(
    group_start=False,
    velocity=False,
    position_known=True,
    channels=6,
    most_steps=100_000,
    frequency_hz=(1, 20_000),
    amplitude_v=(1.0, 100.0),
)


def able(controller: ScriptedController) -> None:
    controller.capabilities = ABLE


def test_axes_are_found_on_every_channel_that_the_controller_has():
    with mico(("LLLLNR",), prepare=able) as (rig, _):
        assert rig.names == [f"d0.c{channel}" for channel in range(6)]
        assert rig["d0.c3"].move_to(5.0) == 5.0
        assert rig["d0.c5"].move_to(5.0) == 5.0


def test_a_channel_nobody_configured_is_found_beyond_the_third():
    with mico(("LLLLL",), configured=("LLL",), prepare=able) as (rig, _):
        assert "device0.channel4" in rig.names


def test_a_configured_channel_that_is_not_there_is_named():
    with mico(("LLL",), configured=("LLLL",)) as (rig, _):
        assert "finds no such channel" in rig["d0.c3"].error


def test_steps_are_refused_beyond_what_this_controller_takes():
    with mico(("LN",), prepare=able) as (rig, controller):
        rig["d0.c1"].steps(60_000, amplitude_v=2.0, frequency_hz=19_000)
        assert controller.of("step")[0][2:] == (60_000, 2.0, 19_000)
        for asked in ({"steps": 100_001}, {"amplitude_v": 0.5}, {"frequency_hz": 20_001}):
            with pytest.raises(cosmic.LimitError):
                rig["d0.c1"].steps(**{"steps": 1, **asked})


def test_what_a_trajectory_may_ask_for_is_what_the_controller_takes():
    with mico(("LN",), prepare=able) as (rig, _):
        facts = rig.facts().axes["d0.c1"]
        assert facts.most_steps == ABLE.most_steps
        assert facts.frequency_hz == ABLE.frequency_hz
        assert facts.amplitude_v == ABLE.amplitude_v


def test_an_axis_whose_controller_cannot_go_as_fast_as_configured_says_so_and_does_not_move():
    def slow(controller: ScriptedController) -> None:
        controller.capabilities = Capabilities(
            group_start=False, velocity=False, position_known=True, frequency_hz=(1, 2000)
        )

    with mico(("LN",), prepare=slow) as (rig, _):
        with pytest.raises(cosmic.MoveRefused, match=r"1 to 2000 Hz.*is 5000: change it"):
            rig["d0.c0"].move_to(1.0)
        rig["d0.c1"].steps(10, frequency_hz=1000)
