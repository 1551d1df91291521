"""SmarAct's SCU without the vendor's library: RS-232 firmware, its ASCII protocol, pyserial."""

import logging
import re
import threading
from collections.abc import Callable, Sequence
from typing import Annotated, Final

from pydantic import Field
from typing_extensions import override

from cosmic.frame.config import StrictModel
from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.frame.units import AxisUnit
from cosmic.mico.hw import scu_serial_text as text
from cosmic.mico.hw.addresses import device_of, open_device, refused
from cosmic.mico.hw.interface import (
    Capabilities,
    Channel,
    Controller,
    ControllerBackend,
    ControllerContext,
    DeviceIdentity,
    Direction,
    Event,
    Serial,
    TypeRead,
)
from cosmic.mico.hw.scu_serial_unit import CHANNELS, SerialLike, Unit

logger = logging.getLogger(__name__)

_NOT_OPEN: Final = "the serial lines are not open"

READ_S: Final = 0.02
"""How long one look at the port waits for a byte."""
WRITE_S: Final = 0.5
_REPORTED_ERRORS: Final = (21, 22)
_LONGEST_WAIT_S: Final = 1e6


class ScuSerialOptions(StrictModel):
    """What platform.toml says of SCUs on serial lines.

    `answer_s` and `keep_alive_s` are guesses: no document says how fast a unit answers.
    """

    ports: Annotated[tuple[str, ...], Field(strict=False, min_length=1)]
    baud: int = Field(default=9600, ge=9600, le=500_000)
    answer_s: float = Field(default=1.0, gt=0.0, le=10.0)
    keep_alive_s: float = Field(default=5.0, ge=0.0, le=60.0)


class ScuSerialController(Controller):
    """SCUs on serial lines, one a line.

    Thread-safe. Commands only queue a line, and a stop is written past the queue.

    Parameters
    ----------
    ports : sequence of str
        Such as "/dev/ttyUSB0" or "COM3".
    open_port : callable
        Opens one of them; raises `NotConnectedError`.
    answer_s : float
        How long an answer may take, in wall time.
    keep_alive_s : float
        A unit stops everything when this program has been silent for so long; 0 for never.
    """

    def __init__(
        self,
        ports: Sequence[str],
        open_port: Callable[[str], SerialLike],
        *,
        answer_s: float = 1.0,
        keep_alive_s: float = 5.0,
        simulated: bool = False,
    ) -> None:
        self._ports = tuple(ports)
        self._open_port = open_port
        self._answer_s = answer_s
        self._keep_alive_s = keep_alive_s
        self._simulated = simulated
        self._lifecycle = threading.Lock()
        self._units: tuple[Unit, ...] = ()
        self._inverted: set[Channel] = set()

    @property
    @override
    def name(self) -> str:
        versions = sorted({unit.firmware for unit in self._units})
        firmware = f", firmware {' and '.join(versions)}" if versions else ""
        return f"SCU over RS-232{firmware}{' (simulated)' if self._simulated else ''}"

    @property
    @override
    def simulated(self) -> bool:
        return self._simulated

    @property
    @override
    def capabilities(self) -> Capabilities:
        return self._able(CHANNELS)

    @override
    def device_capabilities(self, device: int) -> Capabilities:
        return self._able(self._unit(device).channels)

    @staticmethod
    def _able(channels: int) -> Capabilities:
        return Capabilities(
            group_start=False,
            velocity=False,
            position_known=True,
            channels=channels,
            most_steps=text.MOST_STEPS,
            frequency_hz=text.FREQUENCY_HZ,
            amplitude_v=text.AMPLITUDE_V,
        )

    # Opening and closing

    @override
    def find_devices(self) -> tuple[Serial, ...]:
        with self._lifecycle:
            if self._units:
                return tuple(unit.serial for unit in self._units)
            found = self._find()
            for unit in found:
                unit.close()
        return tuple(unit.serial for unit in found)

    def _find(self) -> list[Unit]:
        """Return the units that answer, open; a port without one is told in the log."""
        found: list[Unit] = []
        for port in self._ports:
            try:
                found.append(self._greet(port))
            except DeviceError as exc:
                logger.warning("%s", exc)
        return found

    def _greet(self, port: str) -> Unit:
        """Open a port and learn whose it is; from here on each command has an answer."""
        unit = Unit(0, self._open_port(port), port, self._answer_s)
        try:
            unit.converse("E1", _exactly("E0"))
            unit.serial = int(unit.converse("GID", _group(r"ID(\d+)")))
            unit.firmware = unit.converse("V", _group(r"V(\d+\.\d+\.\d+)"))
            if unit.converse("I", _group("I(.+)")).endswith("1D"):
                unit.channels = 1
        except DeviceError:
            unit.close()
            raise
        return unit

    @override
    def open(self, serials: Sequence[Serial] = ()) -> tuple[DeviceIdentity, ...]:
        with self._lifecycle:
            if self._units:
                raise DeviceError("the serial lines are open already", fault=DeviceFault.STATE)
            found = {unit.serial: unit for unit in self._find()}
            missing = [str(each) for each in serials if each not in found]
            if missing or not found:
                for unit in found.values():
                    unit.close()
                raise NotConnectedError(
                    f"no SCU {', '.join(missing)}at {', '.join(self._ports)}; connected: "
                    f"{', '.join(map(str, found)) or 'none'}; check power, cable and ports",
                    fault=DeviceFault.COMMUNICATION,
                )
            wanted = [each for each in found if not serials or each in serials]
            for unit in (found[each] for each in found if each not in wanted):
                unit.close()
            units = tuple(found[each] for each in wanted)
            try:
                for index, unit in enumerate(units):
                    unit.index = index
                    self._guard(unit)
            except DeviceError:
                for unit in units:
                    unit.close()
                raise
            self._units = units
            self._inverted.clear()
        logger.info("%s opened with units %s", self.name, wanted)
        return tuple(
            DeviceIdentity(index, unit.serial, unit.firmware) for index, unit in enumerate(units)
        )

    def _guard(self, unit: Unit) -> None:
        """Have the unit stop everything when this program falls silent."""
        milliseconds = round(1e3 * self._keep_alive_s)
        if unit.converse(f"K{milliseconds}", _group(r"(E\d+)")) == "E0":
            unit.keep_alive_s = self._keep_alive_s
        else:
            logger.warning("%s: the unit knows no keep-alive", unit.name)

    @override
    def close(self) -> None:
        with self._lifecycle:
            units, self._units = self._units, ()
            for unit in units:
                unit.close()

    # What comes back

    @override
    def receive(self, device: int, timeout_s: float) -> Event | None:
        unit = self._unit(device)
        if not 0.0 <= timeout_s <= _LONGEST_WAIT_S:
            raise refused(
                f"a wait must be finite and not negative, got {timeout_s!r} s", none="SCU"
            )
        event = unit.receive(timeout_s)
        if isinstance(event, text.ScaleRead) and event.channel is not None:
            learn = self._inverted.add if event.inverted else self._inverted.discard
            learn(event.channel)
            return None  # asked for with the type, whose answer comes next
        if isinstance(event, TypeRead) and event.channel in self._inverted:
            event = TypeRead(event.channel, event.positioner.counted_backwards())
        if event is not None and logger.isEnabledFor(logging.DEBUG):
            logger.debug("device %d: %s", device, event)
        return event

    @override
    def report_completion(self, channel: Channel) -> None:
        unit = self._at(channel)
        unit.command(channel, f"SRC{channel.channel}R1", optional=True)
        for code in _REPORTED_ERRORS:
            unit.command(channel, f"SER{channel.channel}E{code}R1", optional=True)

    @override
    def ask_sensor_present(self, channel: Channel) -> None:
        self._at(channel).ask(channel, text.SENSOR_PRESENT)

    @override
    def ask_type(self, channel: Channel) -> None:
        unit = self._at(channel)
        unit.ask(channel, text.SCALE)
        unit.ask(channel, text.TYPE)

    @override
    def ask_position_known(self, channel: Channel) -> None:
        self._at(channel).ask(channel, text.POSITION_KNOWN)

    @override
    def ask_safe_direction(self, channel: Channel) -> None:
        self._at(channel).ask(channel, text.SAFE_DIRECTION)

    @override
    def ask_position(self, channel: Channel, unit: AxisUnit) -> None:
        self._at(channel).ask(channel, text.POSITION[unit])

    @override
    def ask_activity(self, channel: Channel) -> None:
        self._at(channel).ask(channel, text.ACTIVITY)

    # Movements

    @override
    def set_closed_loop_frequency(self, channel: Channel, frequency_hz: int) -> None:
        hertz = text.frequency(frequency_hz, channel)
        self._at(channel).command(channel, f"SCLF{channel.channel}F{hertz}")

    @override
    def step(self, channel: Channel, steps: int, *, amplitude_v: float, frequency_hz: int) -> None:
        unit = self._at(channel)
        said = text.step(channel, steps, amplitude_v, frequency_hz)
        unit.command(channel, said, moves=True)

    @override
    def move_to(self, channel: Channel, target: float, unit: AxisUnit, *, hold_s: float) -> None:
        at = self._at(channel)
        said = text.move(channel, target, unit, hold_s, relative=False)
        at.command(channel, said, moves=True)

    @override
    def move_by(self, channel: Channel, distance: float, unit: AxisUnit, *, hold_s: float) -> None:
        at = self._at(channel)
        said = text.move(channel, distance, unit, hold_s, relative=True)
        at.command(channel, said, moves=True)

    @override
    def calibrate(self, channel: Channel) -> None:
        self._at(channel).command(channel, f"CS{channel.channel}", moves=True)

    @override
    def reference(self, channel: Channel, *, hold_s: float) -> None:
        unit = self._at(channel)
        unit.command(channel, text.reference(channel, hold_s), moves=True)

    @override
    def move_to_end_stop(self, channel: Channel, direction: Direction, *, hold_s: float) -> None:
        unit = self._at(channel)
        unit.command(channel, text.end_stop(channel, direction, hold_s), moves=True)

    @override
    def stop(self, channel: Channel) -> None:
        self._at(channel).stop(channel)

    # Where

    def _unit(self, device: int) -> Unit:
        return open_device(self._units, device, _NOT_OPEN)

    def _at(self, channel: Channel) -> Unit:
        return device_of(self._units, channel, lambda unit: unit.channels, _NOT_OPEN)


def _exactly(wanted: str) -> Callable[[str], str | None]:
    return lambda said: said if said == wanted else None


def _group(pattern: str) -> Callable[[str], str | None]:
    def fits(said: str) -> str | None:
        found = re.fullmatch(pattern, said)
        return None if found is None else found.group(1)

    return fits


def open_serial_port(name: str, baud: int) -> SerialLike:
    """Open a port of this computer with 8 data bits, no parity, 1 stop bit, for this program alone.

    Raises
    ------
    NotConnectedError
        There is none of that name, it is taken, or it may not be opened; the text says which
        there are.
    """
    # Imported here, so that a platform without serial lines does not load it.
    import serial
    from serial.tools.list_ports import comports

    try:
        port: SerialLike = serial.Serial(
            name, baud, timeout=READ_S, write_timeout=WRITE_S, exclusive=True
        )
    except (OSError, ValueError) as exc:  # ValueError: a name that pyserial cannot read
        there = ", ".join(sorted(str(each.device) for each in comports())) or "none"
        raise NotConnectedError(
            f"serial port {name!r} cannot be opened ({exc}); another program may use it, or the "
            f"right to use it is missing. Ports there are: {there}",
            fault=DeviceFault.COMMUNICATION,
        ) from exc
    return port


def _make(options: ScuSerialOptions, context: ControllerContext) -> Controller:
    del context  # units are told apart by their own numbers
    return ScuSerialController(
        options.ports,
        lambda name: open_serial_port(name, options.baud),
        answer_s=options.answer_s,
        keep_alive_s=options.keep_alive_s,
    )


BACKEND: Final = ControllerBackend(_make, ScuSerialOptions)
