"""STOP of a window stops outputs too, whether there are axes or not."""

import runpy
from pathlib import Path

import pytest
from pytestqt.qtbot import QtBot

from cosmic.daqco.api.application import DaqcoApplication
from gui.app.windows import Make

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize("applications", [("daqco",), ("mico", "daqco")])
def test_stop_of_the_window_makes_outputs_safe(
    make: Make, qtbot: QtBot, tmp_path: Path, applications: tuple[str, ...]
) -> None:
    write = runpy.run_path(str(ROOT / "examples" / "play_a_waveform.py"))["write_platform"]
    window = make(config=write(tmp_path), applications=applications)
    daqco = window._platform.daqco
    assert isinstance(daqco, DaqcoApplication)
    outputs = daqco.outputs
    qtbot.waitUntil(lambda: outputs.states[0].value == 0.0)
    outputs.set_voltage("piezo", 3.0)
    window.stop("STOP button")
    qtbot.waitUntil(lambda: outputs.states[0].value == 0.0)
    assert outputs.stopped == "STOP button"
