"""A touch is remembered although nothing is felt any more when the movement ends."""

import numpy as np
import pytest

import cosmic
from cosmic.daqco.core.chunk import DataChunk
from system.simulated_platform import wait_until


@pytest.mark.parametrize(
    ("touched", "force_un"), [("force", 40.0), ("force", -40.0), ("nothing", 10.0)]
)
def test_undo_asks_after_a_touch_that_ends_before_the_movement_does(
    touched: str, force_un: float
) -> None:
    with cosmic.connect(applications=("mico", "daqco")) as rig:
        axis, daqco = rig.mico["probe.y"], rig.daqco
        axis.move_to(100.0)
        wait_until(lambda: bool(rig.mico.undo_entries))
        scales = daqco.application.scales()
        row = daqco.channels.index("force")
        volts = np.full((len(daqco.channels), 20), 2.5)
        volts[row] = 2.5 + force_un / 100.0
        in_order = tuple(scales[name] for name in daqco.channels)
        rig.daqco.application.buffer.put(
            DataChunk(0, 0.0, 1000.0, tuple(daqco.channels), volts, in_order)
        )
        doubts = rig.mico.undo_doubts(rig.mico.undo_entries[0])
        assert [text for text in doubts if "felt more than" in text] == (
            ["since it began, force felt more than 15 uN"] if touched == "force" else []
        )
