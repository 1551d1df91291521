"""What undo and initialisation hear of the forces that are felt."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from cosmic.autonomy.interlocks import join_force_cautions, join_positions
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.udaq_buffer import UDaqBuffer
from cosmic.frame.clock import WALL
from cosmic.mico.core.motion.cautions import Cautions
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.hw.interface import Channel, PositionerKind

RATE_HZ = 1000.0
CHUNK = 2
FORCE = Scale(name="same", unit="uN", coefficients=(0.0, 1.0))
VOLTS = Scale(name="volts", unit="V", coefficients=(0.0, 1.0))


class Rig:
    """A board with a sensor and a spare channel, joined to the cautions of a MiCo."""

    def __init__(self, spare: Scale = FORCE) -> None:
        self.buffer = UDaqBuffer()
        self.cautions = Cautions()
        self.touches: list[str] = []
        self.cautions.on_touch(self.touches.append)
        undo = SimpleNamespace(undo=SimpleNamespace(felt_un=15.0))
        mico = SimpleNamespace(cautions=self.cautions, manager=SimpleNamespace(settings=undo))
        join_force_cautions(SimpleNamespace(buffer=self.buffer), mico)
        self.scales = (FORCE, spare)
        self.start()

    def start(self) -> None:
        self.buffer.clear()
        self.samples = 0

    def put(self, force_un: float, spare: float = 0.0, *, chunks: int = 1) -> None:
        for _ in range(chunks):
            volts = np.repeat([[force_un], [spare]], CHUNK, axis=1)
            time_s = self.samples / RATE_HZ
            names = ("force", "spare")
            self.buffer.put(DataChunk(self.samples, time_s, RATE_HZ, names, volts, self.scales))
            self.samples += CHUNK


@pytest.fixture
def rig():
    return Rig()


def test_noise_that_reaches_beyond_the_limit_for_a_moment_makes_nothing_ask(rig):
    for _ in range(20):
        rig.put(0.0, 40.0)
        rig.put(0.0, -40.0)
    rig.put(0.0, 40.0)
    assert rig.cautions.reasons() == ()
    assert rig.touches == []


def test_a_force_that_lasts_20_ms_is_asked_about_until_it_is_gone_for_as_long(rig):
    rig.put(0.0, chunks=20)
    rig.put(-30.0, chunks=4)
    assert rig.cautions.reasons() == ()
    rig.put(-30.0, chunks=6)
    assert rig.cautions.reasons() == ("force feels -30.0 uN",)
    rig.put(0.0, chunks=10)
    assert rig.cautions.reasons() == ()
    assert rig.touches == ["force felt more than 15 uN"]


def test_a_force_is_asked_about_from_the_first_sample_of_an_acquisition_on(rig):
    rig.put(0.0, chunks=20)
    rig.start()
    assert rig.cautions.reasons() == ()
    rig.put(30.0)
    assert rig.cautions.reasons() == ("force feels 30.0 uN",)
    assert rig.touches == []
    rig.start()
    assert rig.cautions.reasons() == ()


def test_a_force_that_is_no_number_is_asked_about_and_is_no_touch(rig):
    rig.put(math.nan, chunks=20)
    assert rig.cautions.reasons() == ("force feels nan uN",)
    assert rig.touches == []


def test_a_channel_whose_unit_is_none_of_force_makes_nothing_ask():
    rig = Rig(spare=VOLTS)
    rig.put(0.0, 40.0, chunks=20)
    assert rig.cautions.reasons() == ()
    assert rig.touches == []


class Axes:
    """Two axes and a recorder that is told where they are, on a clock that stands at 500 s."""

    def __init__(self, kind: PositionerKind) -> None:
        self.state = PositionerState(
            name="left.gripper",
            address=Channel(0, 0),
            kind=kind,
            unit="um",
            position=30.0,
            confidence=Confidence.ESTIMATED,
        )
        self.recorder = SimpleNamespace(position_source=None)
        self.clock = SimpleNamespace(now_s=lambda: self.now_s, rate=1.0)
        self.now_s = 500.0
        mico = SimpleNamespace(states=lambda: {self.state.name: self.state})
        join_positions(self.recorder, mico, self.clock)

    def time_s(self, *, in_motion: bool, age_s: float) -> float:
        read_wall_s = WALL.now_s() - age_s
        self.state = replace(self.state, in_motion=in_motion, read_wall_s=read_wall_s)
        (found,) = self.recorder.position_source()
        return found.time_s


def test_a_counted_position_is_of_now_while_its_axis_moves():
    axes = Axes(PositionerKind.OPEN_LOOP)
    assert axes.time_s(in_motion=True, age_s=700.0) == 500.0


def test_a_measured_position_is_of_when_it_was_read_while_its_axis_moves():
    axes = Axes(PositionerKind.LINEAR)
    assert axes.time_s(in_motion=True, age_s=0.5) == pytest.approx(499.5, abs=0.1)


def test_an_axis_that_begins_to_move_does_not_go_back_in_time():
    axes = Axes(PositionerKind.LINEAR)
    assert axes.time_s(in_motion=False, age_s=60.0) == 500.0
    axes.now_s = 500.02
    assert axes.time_s(in_motion=True, age_s=60.02) == 500.0
