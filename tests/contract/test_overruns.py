"""What follows from samples that were lost: the guard stops, and acquisition goes on by itself."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from contract.board_rig import BoardRig, NidaqmxRig, SimulatedRig
from contract.station_rig import wait_until
from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.api.recording import open_recording
from cosmic.daqco.core.settings import ChannelSettings, DaqcoSettings, ScaleSettings
from cosmic.frame.errors import NotAvailable
from cosmic.frame.failure import FailurePolicy

SCALE = ScaleSettings(name="Probe", unit="uN", coefficients=(0.0, 20.0))
SETTINGS = DaqcoSettings(
    chunk_s=0.01,
    silence_s=1.0,
    scale=(SCALE,),
    channel=(ChannelSettings(name="force", board="Dev1", input="ai1", scale="Probe"),),
)


@dataclass
class Overrunning:
    """DAQCo on boards whose time the test moves, which lose samples when it says so."""

    boards: BoardRig
    application: DaqcoApplication
    lose: Callable[[], object]
    lost: int
    stops: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.daqco = Daqco(self.application)
        self.application.guard.trip = self.stops.append

    def go_on(self, samples: int = 10) -> None:
        """Let samples come until they have arrived."""
        wanted = self.application.buffer.samples + samples
        self.boards.go_on(samples)
        assert wait_until(lambda: self.application.buffer.samples >= wanted)

    def overrun(self) -> None:
        """Lose samples, and wait until that has been dealt with."""
        core = self.application._core
        self.boards.clock.advance(0.4)
        self.lose()
        assert wait_until(lambda: self.application._core is not core or not self.daqco.running)
        wait_until(lambda: self.daqco.running, 0.2)


@pytest.fixture(params=["simulated", "NI-DAQmx"])
def rig(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Overrunning]:
    monkeypatch.setattr("cosmic.daqco.api.application.FIRST_DATA_S", 0.01)
    boards: SimulatedRig | NidaqmxRig
    if request.param == "simulated":
        boards = SimulatedRig()
        faults = boards._simulated.faults

        def lose() -> None:
            faults.inject("overrun", board="Dev1")
    else:
        boards = NidaqmxRig()
        driver = boards.driver

        def lose() -> None:
            driver.take(10_123, events=False)  # its buffer holds 10 000

    application = DaqcoApplication(
        boards.library, SETTINGS, clock=boards.clock, policy=FailurePolicy()
    )
    application.initialize()
    lost = 10 if request.param == "simulated" else 123
    made = Overrunning(boards, application, lose, lost)
    made.go_on()
    yield made
    application.shut_down()
    boards.close()


def test_acquisition_goes_on_by_itself_and_the_gap_stands_in_the_file(
    rig: Overrunning, tmp_path: Path
) -> None:
    file = tmp_path / "gap.h5"
    with rig.daqco.record(file):
        rig.go_on(50)
        rig.overrun()
        assert rig.daqco.running
        assert not rig.daqco.problem
        rig.go_on(50)
    with open_recording(file) as recording:
        assert recording.complete
        assert recording.samples >= 100
        (gap,) = recording.overruns
        assert 300 <= gap.lost <= 500, "0.4 s at 1 kHz passed"
        (note,) = [each for each in recording.events if each.kind == "overload"]
        assert "computer overloaded" in note.text
    assert not rig.stops, "no limit was armed"


@pytest.mark.parametrize("rig", ["NI-DAQmx"], indirect=True)
def test_a_board_that_says_nothing_any_more_ends_who_waits_for_it(
    rig: Overrunning, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosmic.daqco.core.udaq_core.SILENT_S", 0.3)
    rig.daqco.stop()
    rig.daqco.start()
    rig.go_on()
    averaged = rig.daqco["force"].trigger()
    assert wait_until(lambda: not rig.daqco.running)
    assert "Dev1: no samples for" in rig.daqco.problem
    with pytest.raises(NotAvailable, match="Dev1: no samples for"):
        averaged.wait(5.0)
    rig.daqco.start()
    rig.go_on()
    assert rig.daqco.running


@pytest.mark.parametrize("rig", ["simulated"], indirect=True)
def test_a_simulated_board_gives_nothing_as_long_as_its_clock_waits(
    rig: Overrunning, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosmic.daqco.core.udaq_core.SILENT_S", 0.1)
    rig.daqco.stop()
    rig.daqco.start()
    assert not wait_until(lambda: not rig.daqco.running, 0.6)
    rig.go_on()


def test_with_a_limit_armed_it_stops_first_and_says_how_much_was_lost(rig: Overrunning) -> None:
    rig.daqco.arm_limit("force", high=30.0)
    rig.overrun()
    (why,) = rig.stops
    assert why.startswith("computer overloaded, ")
    lost = rig.lost
    assert f"{lost} samples of each channel ({lost} ms) were lost" in why
    assert "limit of force is armed" in why
    assert rig.daqco.running
    rig.go_on()
    (limit,) = rig.daqco.limits
    assert limit.settings.armed
    assert limit.crossed
    assert limit.value is None
    rig.daqco.reset_limit("force")


def test_a_computer_that_loses_samples_again_and_again_is_left_alone(rig: Overrunning) -> None:
    for _ in range(3):
        rig.overrun()
        assert rig.daqco.running
    rig.overrun()
    assert wait_until(lambda: not rig.daqco.running)
    assert "restarted 3 times within 60 s" in rig.daqco.problem
    rig.daqco.start()
    rig.go_on()
    assert not rig.daqco.problem
