"""Navitar's BrightLight LED, in the frames of the first generation."""

import logging
from typing import Final

from typing_extensions import override

from cosmic.frame.errors import ConfigError, ProtocolError
from cosmic.frame.plugins import NoOptions
from cosmic.vico.hw.navitar_protocol import Found, Product, Register, Registers, open_line
from cosmic.vico.hw.peripherals import Light, LightBackend, PeripheralContext

logger = logging.getLogger(__name__)

FULL: Final = 1000
"""Value of the register at 100 %."""


class BrightLight(Light):
    """A lamp; it follows in steps of 0.1 %.

    Parameters
    ----------
    registers : Registers
        Closed with this object.
    """

    def __init__(self, registers: Registers, *, name: str = "BrightLight") -> None:
        self._registers = registers
        self._name = name

    @property
    @override
    def name(self) -> str:
        return self._name

    @override
    def percent(self) -> float:
        value = self._registers.read(Register.BRIGHTNESS)
        if not 0 <= value <= FULL:
            raise ProtocolError(f"{self.name}: reports a brightness of {value}, not 0 to {FULL}")
        return value * 100.0 / FULL

    @override
    def set_percent(self, percent: float) -> None:
        if not 0.0 <= percent <= 100.0:
            raise ConfigError(f"{self.name}: cannot shine at {percent} %: 0 to 100")
        logger.debug("%s: %.1f %%", self.name, percent)
        self._registers.write(Register.BRIGHTNESS, round(percent * FULL / 100.0))

    @override
    def close(self) -> None:
        self._registers.close()


def light_on(found: Found, name: str) -> BrightLight:
    """Return the lamp of a line that answered.

    Raises
    ------
    NotConnectedError
        Something else is there.
    """
    return BrightLight(found.expect("a BrightLight", Product.BRIGHTLIGHT).registers, name=name)


def _make(_options: NoOptions, context: PeripheralContext) -> Light:
    return light_on(open_line(context.port, "brightlight"), "BrightLight")


BACKEND: Final = LightBackend(_make)
