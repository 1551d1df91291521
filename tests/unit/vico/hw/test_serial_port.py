"""Ports that are missing, taken, lost, or have the wrong thing at their end."""

import sys

import pytest

from contract.peripheral_rig import PeripheralRig, Terminal, terminal
from cosmic.frame.errors import ConfigError, DeviceError, DeviceFault, NotConnectedError
from cosmic.vico.hw import serial_port
from cosmic.vico.hw.factory import make_lens, make_light
from cosmic.vico.hw.peripherals import LensAxis
from cosmic.vico.hw.sim_line import LineFaults

needs_terminals = pytest.mark.skipif(
    sys.platform == "win32", reason="there are no pseudo-terminals"
)


@pytest.mark.parametrize("backend", ["navitar", "brightlight"])
def test_a_missing_port_is_said_with_those_there_are(
    backend: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serial_port, "list_ports", lambda: ("COM1", "COM9"))
    with pytest.raises(NotConnectedError, match=r"COM77.*Ports there are: COM1, COM9") as caught:
        if backend == "navitar":
            make_lens("navitar", port="COM77")
        else:
            make_light("brightlight", port="COM77")
    assert caught.value.fault == DeviceFault.COMMUNICATION


def test_the_ports_there_are_can_be_listed() -> None:
    assert all(isinstance(each, str) for each in serial_port.list_ports())


def test_a_backend_without_what_it_needs_is_refused() -> None:
    with pytest.raises(ConfigError, match="needs a port"):
        make_lens("navitar")
    with pytest.raises(ConfigError, match="twin"):
        make_light("simulated")


def test_none_is_nothing() -> None:
    assert make_lens("none") is None
    assert make_light("none") is None


@needs_terminals
def test_a_port_has_one_user() -> None:
    with terminal(PeripheralRig().simulation.light_line) as end:
        light = make_light("brightlight", port=end.path)
        with pytest.raises(NotConnectedError, match="another program"):
            make_light("brightlight", port=end.path)
        assert light is not None
        light.close()
        again = make_light("brightlight", port=end.path)
        assert again is not None
        again.close()


@needs_terminals
def test_a_light_on_the_port_of_the_lens_is_noticed() -> None:
    with (
        terminal(PeripheralRig().simulation.light_line) as end,
        pytest.raises(NotConnectedError, match="exchanged"),
    ):
        make_lens("navitar", port=end.path)


@needs_terminals
def test_a_port_that_vanishes_is_a_lost_line() -> None:
    end = Terminal(PeripheralRig().simulation.lens_line)
    lens = make_lens("navitar", port=end.path)
    assert lens is not None
    assert lens.state(LensAxis.ZOOM).position_counts == 0
    end.close()
    with pytest.raises(DeviceError, match="line is lost") as caught:
        lens.state(LensAxis.ZOOM)
    assert caught.value.fault == DeviceFault.COMMUNICATION
    lens.close()


def test_a_simulated_line_that_was_unplugged_stays_lost_until_it_is_opened_again() -> None:
    rig = PeripheralRig()
    lens = make_lens("simulated", simulation=rig.simulation)
    assert lens is not None
    rig.simulation.faults.inject("unplugged")
    for _ in range(2):
        with pytest.raises(DeviceError, match="line is lost"):
            lens.state(LensAxis.ZOOM)
        rig.simulation.faults.clear()
    lens.close()
    again = make_lens("simulated", simulation=rig.simulation)
    assert again is not None and again.state(LensAxis.ZOOM).position_counts == 0


def test_faults_have_names() -> None:
    faults = LineFaults()
    for wrong in (faults.inject, faults.clear):
        with pytest.raises(ValueError, match="known: garbage, lost_bytes, silent, unplugged"):
            wrong("gremlins")
    rig = PeripheralRig()
    with pytest.raises(ValueError, match="known: lens, light"):
        rig.simulation.faults.inject("silent", where="camera")


def test_a_lens_said_to_be_homed_is_not_believed_when_both_motors_count_zero() -> None:
    for cold in (True, False):
        lens = make_lens("simulated", homed=True, simulation=PeripheralRig(cold=cold).simulation)
        assert lens is not None
        assert [lens.state(axis).homed for axis in LensAxis] == [not cold] * 2
