"""What undo and initialisation hear of the forces that are felt."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from cosmic.autonomy.interlocks import join_force_cautions
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.udaq_buffer import UDaqBuffer
from cosmic.mico.core.motion.undo import Cautions

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
