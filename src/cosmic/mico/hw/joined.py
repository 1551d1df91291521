"""Several controllers, of one make or of different ones, as one `Controller`."""

import logging
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar, get_args

from typing_extensions import override

from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    DeviceFault,
    NotConnectedError,
    only_cosmic_errors,
)
from cosmic.frame.units import AxisUnit
from cosmic.mico.hw.interface import (
    Capabilities,
    Channel,
    Controller,
    DeviceIdentity,
    Direction,
    Event,
    Failed,
    MatchedMove,
    Serial,
)

logger = logging.getLogger(__name__)

T = TypeVar("T")


def asked(part: Controller, call: Callable[[], T]) -> T:
    """Return what a call of `part` returns; raises nothing but a `CosmicError`."""
    with only_cosmic_errors(part.name):
        return call()


def _readdress(error: DeviceError, own: int, device: int) -> None:
    """Have an error of a part name the device as the platform counts it."""
    error.device = device
    if error.args and isinstance(error.args[0], str):
        text = re.sub(rf"^device {own}\b", f"device {device}", error.args[0])
        error.args = (text, *error.args[1:])


def _event(received: Event | None) -> Event | None:
    if received is not None and not isinstance(received, get_args(Event)):
        raise TypeError(f"{received!r} is not an event of a controller")
    return received


@dataclass(frozen=True, slots=True)
class _JoinedDevice:
    """One device: whose it is, and under which index that one knows it."""

    controller: Controller
    index: int


class JoinedController(Controller):
    """Numbers the devices of all `parts` one behind the other, and passes every call on.

    Thread-safe as the parts are. A part none of whose devices is connected is left out while
    others are there; which device is which is told by the serial numbers.

    Parameters
    ----------
    parts : sequence of Controller
        At least one; what each drives, no other does.
    """

    def __init__(self, parts: Sequence[Controller]) -> None:
        self._parts = tuple(parts)
        self._joined: tuple[_JoinedDevice, ...] = ()

    @property
    @override
    def name(self) -> str:
        return " and ".join(part.name for part in self._parts)

    @property
    @override
    def simulated(self) -> bool:
        return all(part.simulated for part in self._parts)

    @property
    @override
    def capabilities(self) -> Capabilities:
        every = [part.capabilities for part in self._parts]
        return Capabilities(
            group_start=all(each.group_start for each in every),
            velocity=all(each.velocity for each in every),
            position_known=all(each.position_known for each in every),
            channels=max(each.channels for each in every),
            most_steps=min(each.most_steps for each in every),
            frequency_hz=(
                max(each.frequency_hz[0] for each in every),
                min(each.frequency_hz[1] for each in every),
            ),
            amplitude_v=(
                max(each.amplitude_v[0] for each in every),
                min(each.amplitude_v[1] for each in every),
            ),
            keeps_interpreter=all(each.keeps_interpreter for each in every),
        )

    @override
    def device_capabilities(self, device: int) -> Capabilities:
        joined = self._joined_device(device)
        return joined.controller.device_capabilities(joined.index)

    @override
    def find_devices(self) -> tuple[Serial, ...]:
        return tuple(serial for part in self._parts for serial in _connected(part))

    @override
    def open(self, serials: Sequence[Serial] = ()) -> tuple[DeviceIdentity, ...]:
        if self._joined:
            raise DeviceError(f"{self.name} is open already", fault=DeviceFault.STATE)
        found = [_connected(part) for part in self._parts]
        missing = [each for each in serials if not any(each in one for one in found)]
        if missing:
            raise NotConnectedError(
                f"no device with serial number {', '.join(map(str, missing))}; connected: "
                f"{', '.join(str(each) for one in found for each in one) or 'none'}",
                fault=DeviceFault.COMMUNICATION,
            )
        joined: list[_JoinedDevice] = []
        identities: list[DeviceIdentity] = []
        try:
            for part, there in zip(self._parts, found, strict=True):
                own = [each for each in serials if each in there]
                if not there or (serials and not own):
                    logger.warning("%s: none of its devices is connected", part.name)
                    continue
                for identity in asked(part, partial(part.open, own)):
                    identities.append(replace(identity, index=len(joined)))
                    joined.append(_JoinedDevice(part, identity.index))
        except CosmicError:
            self._close_parts()
            raise
        if not joined:
            raise NotConnectedError(
                f"{self.name}: no device is connected; check power and cable",
                fault=DeviceFault.COMMUNICATION,
            )
        self._joined = tuple(joined)
        return tuple(identities)

    @override
    def close(self) -> None:
        self._joined = ()
        self._close_parts()

    def _close_parts(self) -> None:
        for part in self._parts:
            try:
                part.close()
            except Exception:  # of a package that somebody brought: the others are closed too
                logger.exception("%s: closing failed", part.name)

    @override
    def receive(self, device: int, timeout_s: float) -> Event | None:
        joined = self._joined_device(device)
        try:
            event = asked(
                joined.controller,
                lambda: _event(joined.controller.receive(joined.index, timeout_s)),
            )
        except DeviceError as exc:
            _readdress(exc, joined.index, device)
            raise
        if event is None:
            return None
        channel = event.channel
        if isinstance(event, Failed):
            _readdress(event.error, joined.index, device)
        return event if channel is None else replace(event, channel=replace(channel, device=device))

    @override
    def report_completion(self, channel: Channel) -> None:
        self._at(channel, lambda to, at: to.report_completion(at))

    @override
    def ask_sensor_present(self, channel: Channel) -> None:
        self._at(channel, lambda to, at: to.ask_sensor_present(at))

    @override
    def ask_type(self, channel: Channel) -> None:
        self._at(channel, lambda to, at: to.ask_type(at))

    @override
    def ask_position_known(self, channel: Channel) -> None:
        self._at(channel, lambda to, at: to.ask_position_known(at))

    @override
    def ask_safe_direction(self, channel: Channel) -> None:
        self._at(channel, lambda to, at: to.ask_safe_direction(at))

    @override
    def ask_position(self, channel: Channel, unit: AxisUnit) -> None:
        self._at(channel, lambda to, at: to.ask_position(at, unit))

    @override
    def ask_activity(self, channel: Channel) -> None:
        self._at(channel, lambda to, at: to.ask_activity(at))

    @override
    def set_closed_loop_frequency(self, channel: Channel, frequency_hz: int) -> None:
        self._at(channel, lambda to, at: to.set_closed_loop_frequency(at, frequency_hz))

    @override
    def set_speed(
        self, channel: Channel, speed: float, acceleration: float, unit: AxisUnit
    ) -> None:
        self._at(channel, lambda to, at: to.set_speed(at, speed, acceleration, unit))

    @override
    def step(self, channel: Channel, steps: int, *, amplitude_v: float, frequency_hz: int) -> None:
        self._at(
            channel,
            lambda to, at: to.step(at, steps, amplitude_v=amplitude_v, frequency_hz=frequency_hz),
        )

    @override
    def move_to(self, channel: Channel, target: float, unit: AxisUnit, *, hold_s: float) -> None:
        self._at(channel, lambda to, at: to.move_to(at, target, unit, hold_s=hold_s))

    @override
    def move_by(self, channel: Channel, distance: float, unit: AxisUnit, *, hold_s: float) -> None:
        self._at(channel, lambda to, at: to.move_by(at, distance, unit, hold_s=hold_s))

    @override
    def move_together(self, moves: Sequence[MatchedMove]) -> None:
        devices = {move.channel.device for move in moves}
        if len(devices) != 1:
            text = "only channels of one device are started by one command"
            raise DeviceError(text, fault=DeviceFault.PARAMETER)
        joined = self._joined_device(devices.pop())
        own = [replace(move, channel=replace(move.channel, device=joined.index)) for move in moves]
        asked(joined.controller, lambda: joined.controller.move_together(own))

    @override
    def calibrate(self, channel: Channel) -> None:
        self._at(channel, lambda to, at: to.calibrate(at))

    @override
    def reference(self, channel: Channel, *, hold_s: float) -> None:
        self._at(channel, lambda to, at: to.reference(at, hold_s=hold_s))

    @override
    def move_to_end_stop(self, channel: Channel, direction: Direction, *, hold_s: float) -> None:
        self._at(channel, lambda to, at: to.move_to_end_stop(at, direction, hold_s=hold_s))

    @override
    def set_sensor_type(self, channel: Channel, code: int) -> None:
        self._at(channel, lambda to, at: to.set_sensor_type(at, code))

    @override
    def set_safe_direction(self, channel: Channel, direction: Direction) -> None:
        self._at(channel, lambda to, at: to.set_safe_direction(at, direction))

    @override
    def stop(self, channel: Channel) -> None:
        self._at(channel, lambda to, at: to.stop(at))

    def _at(self, channel: Channel, call: Callable[[Controller, Channel], T]) -> T:
        try:
            joined = self._joined_device(channel.device)
        except DeviceError as exc:
            exc.channel = channel.channel
            raise
        try:
            own = Channel(joined.index, channel.channel)
            return asked(joined.controller, lambda: call(joined.controller, own))
        except DeviceError as exc:
            _readdress(exc, joined.index, channel.device)
            exc.channel = channel.channel
            raise

    def _joined_device(self, device: int) -> _JoinedDevice:
        joined = self._joined
        if not joined:
            raise DeviceError(f"{self.name} is not open", fault=DeviceFault.STATE, device=device)
        if not 0 <= device < len(joined):
            text = f"device {device}: there is no such device"
            raise DeviceError(text, fault=DeviceFault.NO_CHANNEL, device=device)
        return joined[device]


def _connected(part: Controller) -> tuple[Serial, ...]:
    """Return the devices of one part; none of one that is not there, which the others outlive."""
    try:
        return asked(part, part.find_devices)
    except NotConnectedError as exc:
        logger.error("%s: %s", part.name, exc)
        return ()


class UnavailableController(JoinedController):
    """In place of a controller that cannot be made; it has no devices, and says why.

    Parameters
    ----------
    backend : str
        What the configuration names.
    reason : str
        What the operator reads.
    """

    def __init__(self, backend: str, reason: str) -> None:
        super().__init__(())
        self._backend = backend
        self._reason = reason

    @property
    @override
    def name(self) -> str:
        return self._backend

    @property
    @override
    def simulated(self) -> bool:
        return False

    @property
    @override
    def capabilities(self) -> Capabilities:
        return Capabilities(group_start=False, velocity=False, position_known=True)

    @override
    def find_devices(self) -> tuple[Serial, ...]:
        raise NotConnectedError(self._reason, fault=DeviceFault.UNSUPPORTED)

    @override
    def open(self, serials: Sequence[Serial] = ()) -> tuple[DeviceIdentity, ...]:
        raise NotConnectedError(self._reason, fault=DeviceFault.UNSUPPORTED)
