"""Finds out which Navitar controller is on a line, and in which way it speaks."""

import logging
from dataclasses import dataclass

from cosmic.frame.errors import DeviceFault, DeviceTimeout, NotConnectedError, ProtocolError
from cosmic.vico.hw.navitar import FrameRegisters
from cosmic.vico.hw.navitar_ascii import AsciiRegisters
from cosmic.vico.hw.navitar_protocol import Product, Register
from cosmic.vico.hw.navitar_registers import Registers
from cosmic.vico.hw.serial_port import SerialPort

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Found:
    """What answered.

    Attributes
    ----------
    product : Product
        What it is.
    generation : int
        1 when it speaks in frames, 2 in text.
    """

    registers: Registers
    product: Product
    generation: int


def probe(port: SerialPort) -> Found:
    """Ask a line who is there, in frames, in text, and in frames again; nothing moves.

    Raises
    ------
    NotConnectedError
        Nobody answers, or something that is not known; the port is closed then.
    DeviceError
        The port is gone; it is closed then.
    """
    answers: list[str] = []
    ways: tuple[tuple[int, Registers], ...] = (
        (1, FrameRegisters(port, tries=1)),
        (2, AsciiRegisters(port, tries=2)),
        (1, FrameRegisters(port, tries=2)),
    )
    try:
        for generation, registers in ways:
            try:
                product = registers.read(Register.PRODUCT)
            except (DeviceTimeout, ProtocolError) as exc:
                answers.append(str(exc))
                continue
            if product in set(Product):
                logger.info("%s: product %#x, generation %d", port.name, product, generation)
                return _found(port, Product(product), generation)
            answers.append(f"product {product:#x}, which is not known")
        raise NotConnectedError(
            f"{port.name}: neither a Navitar controller nor a BrightLight answers: "
            f"{'; '.join(answers)}",
            fault=DeviceFault.COMMUNICATION,
        )
    except BaseException:
        port.close()
        raise


def _found(port: SerialPort, product: Product, generation: int) -> Found:
    registers = FrameRegisters(port) if generation == 1 else AsciiRegisters(port)
    return Found(registers, product, generation)
