"""Outputs through DAQCo's one interface: at home, and from another station."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from contract.daqco_rig import (
    DaqcoRig,
    daqco_rig,
    hosted,
    used_locally,
    used_remotely,
    with_outputs,
)
from contract.station_rig import connected, free_port, wait_until
from cosmic.frame.clock import WALL
from cosmic.frame.errors import (
    ArgumentError,
    ConfigError,
    CosmicError,
    LimitError,
    MoveRefused,
    StoppedError,
)
from cosmic.frame.network.transport import Transport


@contextmanager
def at_a_station(folder: Path) -> Iterator[tuple[DaqcoRig, Transport]]:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with (
        used_locally(with_outputs(folder)) as home,
        hosted(home, endpoint) as station,
        connected(endpoint) as transport,
        used_remotely(transport) as remote,
    ):
        yield DaqcoRig(home, remote.api, remote, station), transport


@pytest.fixture(params=["home", "station"])
def rig(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[DaqcoRig]:
    if request.param == "home":
        with daqco_rig("home", with_outputs(tmp_path)) as made:
            yield made
    else:
        with at_a_station(tmp_path) as (made, transport):
            transport.take_lease()
            yield made


def volts(rig: DaqcoRig) -> float:
    return rig.home.library.output_level("Dev1", "ao0").at(WALL.now_s())


def test_a_value_and_a_line_are_given(rig: DaqcoRig) -> None:
    rig.daqco.set_output("piezo", 2.0)
    rig.daqco.set_line("lamp", high=True)
    assert volts(rig) == 2.0 and rig.home.library.line_is_high("Dev1", "port0/line3")
    assert wait_until(lambda: [each.value for each in rig.daqco.outputs] == [2.0, 1.0], 5.0)


def test_a_waveform_is_given(rig: DaqcoRig) -> None:
    made_hz = rig.daqco.play("piezo", np.linspace(0.0, 3.0, 40), 200.0)
    assert made_hz == pytest.approx(200.0)
    assert wait_until(lambda: volts(rig) == 3.0, 5.0)


def test_what_is_outside_the_limits_is_refused_with_its_reason(rig: DaqcoRig) -> None:
    with pytest.raises(LimitError, match="5"):
        rig.daqco.set_output("piezo", 5.5)
    with pytest.raises(LimitError):
        rig.daqco.play("piezo", np.array([1.0, 6.0]), 100.0)
    with pytest.raises(ConfigError, match="piezo, lamp"):
        rig.daqco.set_output("laser", 1.0)
    assert volts(rig) == 0.0


@pytest.mark.parametrize("odd", [None, "abc", b"5", [1.0], {}, object(), True, 1j])
def test_odd_arguments_end_in_an_error_of_their_own(rig: DaqcoRig, odd: object) -> None:
    for attempt in (
        lambda: rig.daqco.set_output("piezo", odd),
        lambda: rig.daqco.set_output(odd, 1.0),
        lambda: rig.daqco.set_line("lamp", high="yes"),
        lambda: rig.daqco.play("piezo", odd, 100.0),
        lambda: rig.daqco.play("piezo", np.ones(3), odd),
    ):
        if odd == [1.0]:
            continue
        with pytest.raises((CosmicError, TypeError)):
            attempt()
    assert volts(rig) == 0.0


def test_a_stop_makes_outputs_safe_and_is_latched(rig: DaqcoRig) -> None:
    rig.daqco.set_output("piezo", 4.0)
    rig.daqco.stop_outputs("enough")
    assert wait_until(lambda: volts(rig) == 0.0, 5.0)
    assert wait_until(lambda: rig.daqco.outputs_stopped == "enough", 5.0)
    with pytest.raises(StoppedError, match="enough"):
        rig.daqco.set_output("piezo", 1.0)
    rig.daqco.reset_outputs()
    rig.daqco.set_output("piezo", 1.0)
    assert volts(rig) == 1.0


def test_an_empty_waveform_is_refused(rig: DaqcoRig) -> None:
    with pytest.raises(ArgumentError):
        rig.daqco.play("piezo", np.array([]), 100.0)


def test_only_the_holder_of_the_lease_may_set_outputs(tmp_path: Path) -> None:
    with at_a_station(tmp_path) as (rig, _):
        assert rig.station is not None
        rig.station.lease.take("somebody else", "another token", in_process=True)
        with pytest.raises(MoveRefused, match="somebody else"):
            rig.daqco.set_output("piezo", 1.0)
        assert volts(rig) == 0.0
        rig.daqco.stop_outputs()  # which anybody may


def test_outputs_are_safe_once_the_right_to_move_is_lost(tmp_path: Path) -> None:
    with at_a_station(tmp_path) as (rig, transport):
        assert rig.station is not None
        transport.take_lease()
        rig.daqco.set_output("piezo", 4.0)
        assert volts(rig) == 4.0
        rig.station.lease.take_over()
        assert wait_until(lambda: volts(rig) == 0.0, 5.0)


def test_outputs_are_safe_once_the_program_that_set_them_is_gone(tmp_path: Path) -> None:
    with at_a_station(tmp_path) as (rig, transport):
        transport.take_lease()
        rig.daqco.set_output("piezo", 4.0)
        transport.close()
        assert wait_until(lambda: volts(rig) == 0.0, 5.0)
