"""What a loop measures is told to be gone, by its name."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosmic.autonomy.control.sources import ChannelSource, PositionSource
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import DaqcoSettings
from cosmic.frame.clock import WALL
from cosmic.frame.errors import ConfigError, CosmicError, LimitError

SCALE = Scale("Probe", "uN", (0.0, 20.0))


def settings(name: str = "force", input_: str = "ai0", **changes: object) -> DaqcoSettings:
    channel = {"name": name, "board": "Dev1", "input": input_, "scale": "Probe"} | changes
    scales = (
        {"name": "Probe", "unit": "uN", "coefficients": (0.0, 20.0)},
        {"name": "Same", "unit": "uN", "coefficients": (0.0, 20.0)},
        {"name": "Fifth", "unit": "uN", "coefficients": (0.0, 4.0)},
    )
    return DaqcoSettings.model_validate({"channel": (channel,), "scale": scales})


class Daqco:
    """One channel, whose chunks a test hands on."""

    channels = ("force",)
    units = {"force": "uN"}  # noqa: RUF012 - nobody changes it
    running, problem, clock = True, "", WALL

    def __init__(self) -> None:
        self.settings = settings()

    def subscribe(self, receiver: Callable[[DataChunk], object]) -> Callable[[], None]:
        self.put = receiver
        return lambda: None


class Mico:
    """One axis, where a test has put it."""

    settings = SimpleNamespace(watch=SimpleNamespace(idle_poll_s=1.0))

    def __init__(self, axis: object) -> None:
        self._axis = axis

    def __getitem__(self, _name: str) -> object:
        return self._axis


def chunk(name: str) -> DataChunk:
    return DataChunk(0, 0.0, 1000.0, (name,), np.ones((1, 2)), (SCALE,))


def test_a_channel_that_was_renamed_ends_the_loop_with_its_name():
    daqco: Any = Daqco()
    errors: list[CosmicError] = []
    source = ChannelSource(daqco, "force", stale_s=1.0, pause_s=1.0)
    source.begin(errors.append)
    daqco.put(chunk("force"))
    assert not errors
    daqco.put(chunk("push"))
    (error,) = errors
    assert "no channel force any more: renamed, or switched off" in str(error)


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"scale": "Fifth"}, "the scale of force changed; begin the loop again"),
        ({"input_": "ai1"}, "the input of force changed"),
        ({"low_v": -5.0}, "the range of force changed"),
        ({"active": False}, "no channel force any more: renamed, or switched off"),
    ],
)
def test_another_quantity_under_the_same_name_ends_the_loop(changed: dict[str, Any], said: str):
    daqco: Any = Daqco()
    errors: list[CosmicError] = []
    source = ChannelSource(daqco, "force", stale_s=1.0, pause_s=1.0)
    source.begin(errors.append)
    daqco.settings = settings(scale="Same")
    daqco.put(chunk("force"))
    assert not errors
    daqco.settings = settings(**changed)
    daqco.put(chunk("force"))
    (error,) = errors
    assert said in str(error)


def test_a_position_beyond_the_limits_of_a_loop_ends_it_as_a_force_does():
    state = SimpleNamespace(position=0.0, read_wall_s=1.0)
    mico: Any = Mico(SimpleNamespace(key="left.x", unit="um", details=state))
    errors: list[CosmicError] = []
    source = PositionSource(mico, "left.x", stale_s=1.0, low=-5.0, high=5.0)
    source.begin(errors.append)
    assert source.newest() is not None
    assert not errors
    state.position = 5.5
    source.newest()
    (error,) = errors
    assert isinstance(error, LimitError)
    assert "left.x reached 5.5 um, the loop's limit is 5" in str(error)
    with pytest.raises(ConfigError, match="low limit"):
        PositionSource(mico, "left.x", stale_s=1.0, low=5.0, high=-5.0)
