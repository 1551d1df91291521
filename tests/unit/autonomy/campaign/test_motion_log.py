"""What axes and force did is kept while a fibre is treated."""

from typing import Any

import numpy as np

from cosmic.autonomy.campaign.recorder import MotionLog
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.scale import Scale
from cosmic.frame.clock import ManualClock


class Daqco:
    """Hands chunks to one receiver."""

    def __init__(self) -> None:
        self.units = {"force": "uN"}
        self.receiver: Any = None

    def subscribe(self, receiver: Any) -> Any:
        self.receiver = receiver
        return lambda: setattr(self, "receiver", None)


def chunk(channel: str, time_s: float, force_un: float) -> DataChunk:
    scale = Scale("as it is", "uN", (0.0, 1.0))
    return DataChunk(0, time_s, 1000.0, (channel,), np.full((1, 10), force_un), (scale,))


def test_a_force_that_was_renamed_is_missing_and_fails_nothing() -> None:
    daqco = Daqco()
    nothing: Any = ()
    log = MotionLog(nothing, daqco, "force", ManualClock())  # type: ignore[arg-type]
    for number, name in enumerate(("force", "strain", "force")):
        daqco.receiver(chunk(name, float(number), 1.0 + number))
    (force,) = log.series()
    assert force.values.tolist() == [1.0, 3.0]
    log.close()
    assert daqco.receiver is None
