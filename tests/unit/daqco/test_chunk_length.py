"""How much a simulation that runs faster hands on at once."""

from pathlib import Path

import pytest
from PySide6.QtWidgets import QApplication

from contract.daqco_rig import settings
from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.core.settings import DaqcoSettings
from cosmic.daqco.hw.sim_library import SimulatedLibrary
from cosmic.frame.clock import RatedClock
from cosmic.frame.failure import FailurePolicy
from unit.mico.rigs import wait_until


def chunk_samples(wanted: DaqcoSettings, rate: float) -> int:
    clock = RatedClock(rate)
    application = DaqcoApplication(
        SimulatedLibrary(clock, {}), wanted, clock=clock, policy=FailurePolicy()
    )
    application.initialize()
    try:
        wait_until(lambda: application.buffer.latest_chunk is not None)
        chunk = application.buffer.latest_chunk
        assert chunk is not None
        return chunk.samples
    finally:
        application.shut_down()


@pytest.mark.parametrize(("rate", "samples"), [(0.5, 2), (1.0, 2), (20.0, 40), (1000.0, 250)])
def test_a_faster_simulation_makes_longer_chunks_and_a_slower_one_those_asked_for(
    qapp: QApplication, tmp_path: Path, rate: float, samples: int
) -> None:
    assert chunk_samples(settings(tmp_path), rate) == samples
