"""The simulated lens and lamp of a platform, driven as the real ones are over a simulated line."""

from dataclasses import replace
from typing import Final

from cosmic.frame.errors import ConfigError
from cosmic.frame.plugins import NoOptions
from cosmic.vico.hw.brightlight import light_on
from cosmic.vico.hw.navitar import lens_on
from cosmic.vico.hw.navitar_protocol import probe
from cosmic.vico.hw.peripherals import (
    Lens,
    LensBackend,
    Light,
    LightBackend,
    PeripheralContext,
)
from cosmic.vico.hw.serial_port import SerialPort
from cosmic.vico.hw.sim_line import SimSerial
from cosmic.vico.hw.sim_peripherals import SimPeripherals


def _given(context: PeripheralContext) -> SimPeripherals:
    if context.simulation is None:
        raise ConfigError("a simulated lens or light needs the twin of the platform")
    return context.simulation


def _make_lens(_options: NoOptions, context: PeripheralContext) -> Lens:
    simulation = _given(context)
    found = probe(SerialPort(SimSerial(simulation.lens_line), "simulated lens"))
    # The simulated controller remembers nothing either; the morning after does.
    warm = replace(context, homed=context.homed or not simulation.lens.cold)
    return lens_on(found, "simulated lens", warm)


def _make_light(_options: NoOptions, context: PeripheralContext) -> Light:
    line = _given(context).light_line
    found = probe(SerialPort(SimSerial(line), "simulated light"))
    return light_on(found, "simulated BrightLight")


LENS: Final = LensBackend(_make_lens, simulated=True, twin=True)
LIGHT: Final = LightBackend(_make_light, simulated=True, twin=True)
