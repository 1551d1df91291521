"""Limits, safe values and the stop of outputs, on simulated boards."""

import threading
from collections.abc import Callable, Iterator
from math import inf, nan

import numpy as np
import pytest
from pydantic import ValidationError

from cosmic.daqco.core.output_control import OutputControl, OutputState
from cosmic.daqco.core.settings import OutputSettings
from cosmic.daqco.hw.outputs import Waveform, open_outputs
from cosmic.daqco.hw.sim_library import SimulatedLibrary
from cosmic.frame.clock import WALL, ManualClock
from cosmic.frame.errors import (
    ArgumentError,
    ConfigError,
    CosmicError,
    LimitError,
    MoveRefused,
    NotAvailable,
    StoppedError,
)
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.dead_man import DeadMan, Pulse

PIEZO = OutputSettings(name="piezo", board="Dev1", output="ao0", low_v=0.0, high_v=5.0, safe_v=0.5)
HEATER = OutputSettings(
    name="heater", board="Dev1", output="ao1", low_v=-1.0, high_v=1.0, stops=False
)
VALVE = OutputSettings(name="valve", board="Dev2", output="port0/line3", safe_high=True)


class Site:
    def __init__(self, *outputs: OutputSettings) -> None:
        self.clock = ManualClock()
        self.library = SimulatedLibrary(self.clock)
        self.changes = 0
        self.control = OutputControl(
            outputs, lambda board: open_outputs(self.library, board), FailurePolicy(), self._changed
        )

    def _changed(self) -> None:
        self.changes += 1

    def volts(self, output: str, board: str = "Dev1") -> float:
        return self.library.output_level(board, output).at(self.clock.now_s())

    def state(self, name: str) -> OutputState:
        (found,) = (each for each in self.control.states if each.name == name)
        return found


@pytest.fixture
def site() -> Iterator[Site]:
    made = Site(PIEZO, HEATER, VALVE)
    made.control.begin()
    yield made
    made.control.close()


def wait_until(true: Callable[[], bool]) -> None:
    end_s = WALL.now_s() + 10.0
    while not true():
        assert WALL.now_s() < end_s
        threading.Event().wait(0.005)


# --- what may be configured -------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"low_v": None}, "give low_v and high_v"),
        ({"low_v": 5.0}, "low_v must lie below high_v"),
        ({"safe_v": 6.0}, "safe_v must lie within"),
        ({"low_v": 1.0, "safe_v": 0.0}, "safe_v must lie within"),
        ({"safe_high": True}, "safe_high is for digital lines"),
        ({"output": "port0/line0"}, "a digital line has no voltages"),
        ({"output": "ai0"}, "output"),
        ({"high_v": nan}, "high_v"),
    ],
)
def test_an_output_without_sensible_limits_is_no_configuration(
    changed: dict[str, object], why: str
) -> None:
    with pytest.raises(ValidationError, match=why):
        OutputSettings.model_validate(PIEZO.model_dump() | changed)


# --- values -----------------------------------------------------------------------------------


def test_every_output_is_at_its_safe_value_from_the_beginning(site: Site) -> None:
    assert site.volts("ao0") == 0.5 and site.volts("ao1") == 0.0
    assert site.library.line_is_high("Dev2", "port0/line3")
    assert [each.value for each in site.control.states] == [0.5, 0.0, 1.0]


def test_a_value_within_the_limits_is_given(site: Site) -> None:
    site.control.set_voltage("piezo", 5.0)
    site.control.set_line("valve", high=False)
    assert site.volts("ao0") == site.state("piezo").value == 5.0
    assert not site.library.line_is_high("Dev2", "port0/line3")


@pytest.mark.parametrize("volts", [5.001, -0.001, inf, -inf, nan])
def test_a_value_outside_the_limits_is_refused_and_never_clipped(site: Site, volts: float) -> None:
    site.control.set_voltage("piezo", 2.0)
    with pytest.raises(MoveRefused, match="piezo"):
        site.control.set_voltage("piezo", volts)
    assert site.volts("ao0") == site.state("piezo").value == 2.0


def test_an_output_that_is_not_named_or_of_another_kind_is_refused(site: Site) -> None:
    with pytest.raises(ConfigError, match="'laser'; there are piezo, heater, valve"):
        site.control.set_voltage("laser", 1.0)
    with pytest.raises(ConfigError, match="'valve' is a digital line"):
        site.control.set_voltage("valve", 1.0)
    with pytest.raises(ConfigError, match="'piezo' is an analogue output"):
        site.control.set_line("piezo", high=True)


# --- waveforms --------------------------------------------------------------------------------


def test_one_value_of_a_waveform_outside_the_limits_refuses_all_of_it(site: Site) -> None:
    with pytest.raises(LimitError, match=r"5\.5 V asked; its limits are 0 to 5 V"):
        site.control.play("piezo", Waveform(np.array([1.0, 5.5, 1.0]), 100.0))
    with pytest.raises(MoveRefused, match="not a finite number"):
        site.control.play("piezo", Waveform(np.array([1.0, nan]), 100.0))
    assert site.volts("ao0") == 0.5


@pytest.mark.parametrize(
    ("volts", "rate_hz"),
    [([], 1.0), ([[1.0], [2.0]], 1.0), ("abc", 1.0), ([1.0], 0.0), ([1.0], nan), ([1.0], -5.0)],
)
def test_what_is_no_waveform_is_named(site: Site, volts: object, rate_hz: float) -> None:
    with pytest.raises(ArgumentError, match="piezo"):
        site.control.play("piezo", Waveform(volts, rate_hz))


def test_a_waveform_that_has_ended_is_no_longer_shown_as_played(site: Site) -> None:
    site.control.play("piezo", Waveform(np.array([1.0, 2.0]), 100.0))
    assert site.state("piezo").playing and site.state("piezo").value is None
    site.clock.advance(1.0)
    wait_until(lambda: not site.state("piezo").playing)
    assert site.volts("ao0") == 2.0


def test_whoever_gave_a_waveform_may_change_the_array_afterwards(site: Site) -> None:
    volts = np.array([1.0, 2.0])
    site.control.play("piezo", Waveform(volts, 100.0))
    volts[:] = 9.0
    site.clock.advance(1.0)
    assert site.volts("ao0") == 2.0


# --- the stop ---------------------------------------------------------------------------------


def test_a_stop_drives_marked_outputs_to_their_safe_values_and_leaves_the_others(
    site: Site,
) -> None:
    site.control.set_voltage("piezo", 4.0)
    site.control.set_voltage("heater", 0.8)
    site.control.set_line("valve", high=False)
    site.control.stop("STOP was pressed")
    wait_until(lambda: site.state("piezo").value == 0.5 and site.state("valve").value == 1.0)
    assert (site.volts("ao0"), site.volts("ao1")) == (0.5, 0.8)
    assert site.library.line_is_high("Dev2", "port0/line3")


def test_nothing_is_written_between_a_stop_and_its_reset(site: Site) -> None:
    site.control.stop("STOP was pressed")
    for attempt in (
        lambda: site.control.set_voltage("piezo", 1.0),
        lambda: site.control.set_voltage("heater", 0.1),
        lambda: site.control.set_line("valve", high=False),
        lambda: site.control.play("piezo", Waveform(np.ones(3), 100.0)),
    ):
        with pytest.raises(StoppedError, match="STOP was pressed"):
            attempt()
    assert site.control.stopped == "STOP was pressed"
    site.control.reset()
    assert site.volts("ao0") == 0.5, "what was stopped does not go on by itself"
    site.control.set_voltage("piezo", 1.0)
    assert site.volts("ao0") == 1.0


def test_a_stop_ends_a_waveform(site: Site) -> None:
    site.control.play("piezo", Waveform(np.array([1.0, 4.0]), 100.0, repeat=True))
    site.control.stop("STOP was pressed")
    wait_until(lambda: site.state("piezo").value == 0.5)
    site.clock.advance(1.0)
    assert site.volts("ao0") == 0.5 and not site.state("piezo").playing


def test_a_stop_returns_at_once_while_a_board_does_not_answer() -> None:
    site = Site(PIEZO)
    answers = threading.Event()
    outputs = open_outputs(site.library, "Dev1")
    write = outputs.write

    def slow(output, volts):
        answers.wait(20.0)
        write(output, volts)

    outputs.write = slow
    site.control = OutputControl((PIEZO,), lambda _board: outputs, FailurePolicy(), lambda: None)
    answers.set()
    site.control.begin()
    answers.clear()
    hung = threading.Thread(target=site.control.set_voltage, args=("piezo", 3.0))
    hung.start()
    started_s = WALL.now_s()
    site.control.stop("STOP was pressed")
    assert WALL.now_s() - started_s < 1.0
    answers.set()
    hung.join(10.0)
    wait_until(lambda: site.state("piezo").value == 0.5)
    assert site.volts("ao0") == 0.5, "the value that was under way is followed by the safe one"
    site.control.close()


def test_a_board_that_hangs_keeps_no_other_from_its_safe_value(site: Site) -> None:
    site.control.set_line("valve", high=False)
    answers, hangs = threading.Event(), threading.Event()
    outputs = site.control._boards["Dev1"]
    write = outputs.write

    def slow(output, volts):
        hangs.set()
        answers.wait(20.0)
        write(output, volts)

    outputs.write = slow
    hung = threading.Thread(target=site.control.set_voltage, args=("piezo", 3.0))
    hung.start()
    assert hangs.wait(5.0)
    site.control.stop("STOP was pressed")
    wait_until(lambda: site.state("valve").value == 1.0)
    assert site.library.line_is_high("Dev2", "port0/line3")
    assert hung.is_alive()
    answers.set()
    hung.join(10.0)
    wait_until(lambda: site.state("piezo").value == 0.5)
    assert site.volts("ao0") == 0.5


def test_another_waveform_that_keeps_the_board_is_ended_for_a_safe_value(site: Site) -> None:
    site.control.set_voltage("piezo", 3.0)
    site.control.play("heater", Waveform(np.array([0.1, 0.2]), 100.0, repeat=True))
    outputs = site.control._boards["Dev1"]
    write = outputs.write

    def reserved(output, volts):
        if outputs.playing:
            raise NotAvailable("the board is taken by the waveform")
        write(output, volts)

    outputs.write = reserved
    site.control.stop("STOP was pressed")
    wait_until(lambda: site.state("piezo").value == 0.5)
    assert site.volts("ao0") == 0.5


# --- loss -------------------------------------------------------------------------------------


def test_what_another_station_set_goes_safe_when_that_station_falls_silent(site: Site) -> None:
    pulse = Pulse("the other", limit_s=1.0, clock=site.clock)
    site.control.set_voltage("piezo", 4.0, DeadMan(pulse, 1.0))
    site.control.set_voltage("heater", 0.8)
    assert site.volts("ao0") == 4.0
    site.clock.advance(1.5)
    wait_until(lambda: site.state("piezo").value == 0.5)
    assert site.volts("ao0") == 0.5
    assert site.volts("ao1") == 0.8, "this was set from here"
    site.control.set_voltage("piezo", 1.0)


def test_a_board_that_is_lost_is_reported_in_the_state(site: Site) -> None:
    site.library.faults.inject("unplugged", board="Dev1")
    with pytest.raises(CosmicError, match="Dev1"):
        site.control.set_voltage("piezo", 1.0)
    site.control.stop("STOP was pressed")
    wait_until(lambda: "Dev1" in site.state("piezo").problem)
    assert site.state("valve").value == 1.0, "the other board is driven all the same"
    site.library.faults.clear()


def test_at_the_end_every_output_is_at_its_safe_value() -> None:
    site = Site(PIEZO, HEATER)
    site.control.begin()
    site.control.set_voltage("piezo", 4.0)
    site.control.set_voltage("heater", 0.8)
    site.control.close()
    assert (site.volts("ao0"), site.volts("ao1")) == (0.5, 0.0)


def test_without_outputs_in_the_configuration_no_board_is_opened() -> None:
    def forbidden(_board):
        raise AssertionError("a board was opened")

    control = OutputControl((), forbidden, FailurePolicy(), lambda: None)
    control.begin()
    control.stop("STOP was pressed")
    control.close()
    with pytest.raises(ConfigError, match=r"daqco\.output"):
        control.set_voltage("piezo", 1.0)
