"""The converters of Fig. 6.16: what the force does to the hand and to its speed."""

import math

import numpy as np
import pytest

from cosmic.autonomy import couplings
from cosmic.autonomy.couplings import TestAppDAQCoConverter, TestAppMiCoConverter
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.scale import Scale
from cosmic.mico.core.teleoperation.mapping import Converter
from cosmic.mico.core.teleoperation.settings import TeleoperationSettings
from cosmic.mico.hw.input_device import InputState

SETTINGS = TeleoperationSettings(
    force_channel="force",
    force_axis="y",
    feedback_un=100.0,
    soft_force_un=60.0,
    hard_force_un=140.0,
)


def chunk(force_un: float, name: str = "force", unit: str = "uN") -> DataChunk:
    volts = np.full((2, 5), force_un)
    same = Scale(name="same", unit=unit, coefficients=(0.0, 1.0))
    return DataChunk(0, 0.0, 1000.0, ("aux", name), volts, (same, same))


class Wall:
    rate = 1.0

    def __init__(self) -> None:
        self.time_s = 100.0

    def now_s(self) -> float:
        return self.time_s


@pytest.fixture
def wall(monkeypatch):
    clock = Wall()
    monkeypatch.setattr(couplings, "WALL", clock)
    return clock


class Felt:
    """The converter with what it hands on."""

    def __init__(self, settings: TeleoperationSettings = SETTINGS) -> None:
        self.forces: list[dict[str, float]] = []
        self.acquiring = True
        self.force = TestAppDAQCoConverter(settings, self.forces.append, lambda: self.acquiring)

    def under(self, force_un: float, **velocities: float) -> dict[str, float]:
        self.force.take(chunk(force_un))
        return self.force.slow_down(velocities)


def test_every_chunk_is_felt_in_proportion_and_within_what_the_device_can(wall):
    felt = Felt()
    for force_un in (0.0, 50.0, -100.0, 500.0):
        felt.force.take(chunk(force_un))
    assert felt.forces == [{"y": 0.0}, {"y": 0.5}, {"y": -1.0}, {"y": 1.0}]
    assert felt.force.chunks == 4
    turned = Felt(SETTINGS.model_copy(update={"force_direction": -1}))
    turned.force.take(chunk(50.0))
    assert turned.forces == [{"y": -0.5}]


def test_a_force_that_is_no_number_is_not_felt_and_lets_nothing_go_on(wall):
    felt = Felt()
    assert felt.under(math.nan, x=1.0) == {"x": 0.0}
    assert felt.forces == [{"y": 0.0}]


def test_a_force_in_another_unit_is_the_same_force(wall):
    felt = Felt()
    felt.force.take(chunk(0.1, unit="mN"))
    assert felt.force.force_un == pytest.approx(100.0)
    assert felt.forces == [{"y": pytest.approx(1.0)}]
    assert felt.force.slow_down({"y": 10.0}) == {"y": pytest.approx(5.0)}


def test_what_is_measured_as_no_force_is_not_felt_and_lets_nothing_go_on(wall):
    felt = Felt()
    felt.force.take(chunk(0.0, unit="V"))
    assert felt.forces == [{"y": 0.0}]
    assert felt.force.slow_down({"y": 10.0}) == {"y": 0.0}


def test_another_channel_is_not_felt(wall):
    felt = Felt()
    felt.force.take(chunk(50.0, "temperature"))
    assert felt.forces == []


@pytest.mark.parametrize(
    ("force_un", "share"),
    [(0.0, 1.0), (60.0, 1.0), (80.0, 0.75), (-100.0, 0.5), (140.0, 0.0), (900.0, 0.0)],
)
def test_the_speed_falls_in_proportion_between_the_soft_force_and_the_hard_one(
    wall, force_un, share
):
    felt = Felt()
    assert felt.under(force_un, y=-10.0) == {"y": pytest.approx(-10.0 * share)}


def test_the_retreat_is_free_at_once_and_other_directions_are_not(wall):
    felt = Felt()
    felt.under(50.0, y=-10.0)
    assert felt.under(140.0, y=-10.0, x=10.0) == {"y": 0.0, "x": 0.0}
    assert felt.under(142.0, y=10.0, x=0.0)["y"] == 10.0, "the force rises a moment longer"
    assert felt.under(120.0, y=10.0, x=10.0) == {"y": 10.0, "x": 2.5}
    assert felt.under(50.0, y=-10.0) == {"y": -10.0}


def test_a_retreat_that_raises_the_force_is_slowed_down_after_a_moment(wall):
    felt = Felt()
    felt.under(50.0, y=-10.0)
    felt.under(100.0, y=-10.0)
    felt.under(100.0, y=10.0)
    wall.time_s += 0.2
    assert felt.under(120.0, y=10.0) == {"y": 2.5}


def test_samples_that_stay_away_let_nothing_go_on_unless_none_are_expected(wall):
    felt = Felt()
    assert felt.under(0.0, y=1.0) == {"y": 1.0}
    wall.time_s += 0.2
    assert felt.force.slow_down({"y": 1.0}) == {"y": 0.0}
    felt.acquiring = False
    assert felt.force.slow_down({"y": 1.0}) == {"y": 1.0}
    felt.acquiring = True
    felt.force.restart()
    assert felt.force.slow_down({"y": 1.0}) == {"y": 1.0}, "the first chunk is awaited"


def test_without_a_channel_the_force_does_nothing(wall):
    felt = Felt(TeleoperationSettings())
    assert felt.under(900.0, y=1.0) == {"y": 1.0}


def test_inputs_become_movements_no_faster_than_the_force_allows(wall):
    felt = Felt()

    class Mapping(Converter):
        def convert(self, inputs: InputState, *, fine: bool) -> dict[str, float]:
            return {"probe.y": inputs.axes["y"] * (1.0 if fine else 100.0)}

    converter = TestAppMiCoConverter(Mapping(), felt.force)
    pushed = InputState({"y": -1.0}, {}, connected=True, time_s=0.0)
    felt.force.take(chunk(100.0))
    assert converter.convert(pushed, fine=False) == {"probe.y": -50.0}
    assert converter.convert(pushed, fine=True) == {"probe.y": -0.5}
