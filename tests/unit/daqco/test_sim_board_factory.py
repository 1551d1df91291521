"""The backend that is named is the one that is made, and the only one that is loaded."""

import subprocess
import sys

import numpy as np
import numpy.typing as npt
import pytest

from cosmic.daqco.hw.factory import make_library
from cosmic.daqco.hw.interface import InputMode, InputSettings
from cosmic.daqco.hw.nidaqmx_library import NidaqmxLibrary
from cosmic.frame.clock import ManualClock


class Level:
    def volts(self, times_s: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return np.full(times_s.shape, 2.5)


def test_the_simulated_boards_carry_what_the_scene_connects() -> None:
    clock = ManualClock(auto_advance=True)
    library = make_library("simulated", clock=clock, scene_sources={("Dev2", "ai4"): Level()})
    board = library.open("Dev2")
    assert board.info.simulated
    board.configure([InputSettings("ai4", InputMode.RSE, -5.0, 5.0)], 1000.0, 100)
    board.start()
    chunk = board.receive(1.0)
    assert chunk is not None and chunk.volts.mean() == pytest.approx(2.5, abs=1e-3)


def test_the_boards_of_national_instruments_are_never_replaced_by_simulated_ones() -> None:
    assert isinstance(make_library("nidaqmx"), NidaqmxLibrary)


@pytest.mark.parametrize(
    ("backend", "without"), [("simulated", "nidaqmx"), ("nidaqmx", "cosmic.daqco.hw.sim_board")]
)
def test_the_other_backend_is_not_loaded(backend: str, without: str) -> None:
    code = (
        "import sys; from cosmic.daqco.hw.factory import make_library; "
        f"make_library({backend!r}); sys.exit({without!r} in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=60).returncode == 0
