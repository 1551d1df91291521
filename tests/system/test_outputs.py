"""Outputs on a whole platform: STOP, a force limit and the end drive them to their safe values."""

import runpy
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import cosmic
from contract.station_rig import wait_until
from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.hw.sim_library import SimulatedLibrary

ROOT = Path(__file__).parents[2]


@pytest.fixture
def platform(tmp_path: Path) -> Path:
    made: Path = runpy.run_path(str(ROOT / "examples" / "play_a_waveform.py"))["write_platform"](
        tmp_path
    )
    return made


@pytest.fixture
def rig(platform: Path) -> Iterator[cosmic.Rig]:
    with cosmic.connect(platform, applications=("mico", "daqco")) as opened:
        yield opened


def library_of(rig: cosmic.Rig) -> SimulatedLibrary:
    application = rig.daqco.application
    assert isinstance(application, DaqcoApplication)
    assert isinstance(application.library, SimulatedLibrary)
    return application.library


def volts(rig: cosmic.Rig) -> float:
    return library_of(rig).output_level("Dev1", "ao0").at(rig.daqco.clock.now_s())


def test_stop_of_the_platform_makes_outputs_safe_until_its_reset(rig: cosmic.Rig) -> None:
    rig.daqco.play("piezo", np.array([3.0, 4.0]), 100.0, repeat=True)
    rig.stop()
    assert wait_until(lambda: volts(rig) == 0.0, 5.0)
    with pytest.raises(cosmic.StoppedError):
        rig.daqco.set_output("piezo", 1.0)
    with pytest.raises(cosmic.NotAvailable, match="reset that stop"):
        rig.daqco.reset_outputs()
    rig.reset_stop()
    assert volts(rig) == 0.0
    rig.daqco.set_output("piezo", 1.0)
    assert volts(rig) == 1.0


def test_a_force_limit_that_is_crossed_makes_outputs_safe(rig: cosmic.Rig) -> None:
    rig.daqco.set_output("piezo", 3.0)
    rig.daqco.arm_limit("monitor", high=3.5)
    rig.daqco.set_output("piezo", 4.0)
    assert wait_until(lambda: volts(rig) == 0.0, 5.0)
    assert "monitor" in (rig.stopped or "")


def test_the_end_of_the_program_makes_outputs_safe(platform: Path) -> None:
    with cosmic.connect(platform, applications=("daqco",)) as rig:
        library = library_of(rig)
        clock = rig.daqco.clock
        rig.daqco.set_output("piezo", 3.0)
        rig.daqco.set_line("lamp", high=True)
    assert library.output_level("Dev1", "ao0").at(clock.now_s()) == 0.0
    assert not library.line_is_high("Dev1", "port0/line0")


def test_stop_without_axes_makes_outputs_safe(platform: Path) -> None:
    with cosmic.connect(platform, applications=("daqco",)) as rig:
        rig.daqco.set_output("piezo", 3.0)
        rig.stop("enough")
        assert wait_until(lambda: volts(rig) == 0.0, 5.0)
        with pytest.raises(cosmic.StoppedError, match="enough"):
            rig.daqco.set_output("piezo", 3.0)
        rig.reset_stop()
        rig.daqco.set_output("piezo", 3.0)


def test_a_recording_says_what_outputs_were_given(rig: cosmic.Rig, tmp_path: Path) -> None:
    with rig.daqco.record(tmp_path / "run.h5"):
        rig.daqco.set_output("piezo", 1.5)
        rig.daqco.set_line("lamp", high=True)
        rig.daqco.play("piezo", np.array([1.0, 2.0]), 100.0)
        rig.stop("enough")
        assert wait_until(lambda: rig.daqco.outputs[1].value == 0.0, 5.0)
    with cosmic.open_recording(tmp_path / "run.h5") as recording:
        given = [each.text for each in recording.events if each.kind == "output"]
    assert given == [
        "piezo: 1.5 V",
        "lamp: high",
        "piezo: 2 values at 100 Hz",
        "piezo: its safe value (enough)",
        "lamp: its safe value (enough)",
    ]
