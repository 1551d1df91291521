"""What a loop measures is told to be gone, by its name."""

from collections.abc import Callable
from typing import Any

import numpy as np

from cosmic.autonomy.control.sources import ChannelSource
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.scale import Scale
from cosmic.frame.errors import CosmicError

SCALE = Scale("Probe", "uN", (0.0, 20.0))


class Daqco:
    """One channel, whose chunks a test hands on."""

    channels = ("force",)
    units = {"force": "uN"}  # noqa: RUF012 - nobody changes it
    running, problem = True, ""

    def subscribe(self, receiver: Callable[[DataChunk], object]) -> Callable[[], None]:
        self.put = receiver
        return lambda: None


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
