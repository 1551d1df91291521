"""The C functions of the simulated library, as Python bodies behind ctypes function pointers."""

import logging
from collections.abc import Callable, Sequence
from typing import Any, Protocol

from cosmic.frame.clock import WALL, Clock
from cosmic.mico.hw.scu3d_ctypes import (
    SA_INVALID_CHANNEL_INDEX_ERROR,
    SA_INVALID_PARAMETER_ERROR,
    SA_NO_PACKET_TYPE,
    SA_NOT_INITIALIZED_ERROR,
    SA_NOTIFICATION_ALREADY_SET_ERROR,
    SA_OK,
    SA_OTHER_ERROR,
    SA_READ_ERROR,
    SA_SYSTEM_PROPERTY_PACKET_TYPE,
    SA_TIMEOUT_ERROR,
    SA_TRANSMIT_ERROR,
    SA_WRITE_ERROR,
    function_type,
)
from cosmic.mico.hw.sim_queue import Packet
from cosmic.mico.hw.sim_scu3d_channel import Channel
from cosmic.mico.hw.sim_scu3d_device import Device
from cosmic.mico.hw.sim_scu3d_operations import OPERATIONS, Operation
from cosmic.mico.hw.sim_scu3d_properties import SYSTEM_KEYS, system_property
from cosmic.mico.hw.sim_scu3d_types import Refusal
from cosmic.twin.scene import Scene

logger = logging.getLogger(__name__)

_FIRST_HARDWARE_ERROR = 128
_NOTHING_CAME: Packet = (SA_NO_PACKET_TYPE, 0, 0, 0, 0)
_SYSTEM_CHANNEL = 255

Body = Callable[..., int]


class Session(Protocol):
    """What the functions of section II need of the library."""

    clock: Clock
    scene: Scene

    def device(self, index: int, *, asynchronous: bool) -> Device:
        """Return the device at `index`; raises `Refusal` when that is not possible."""

    def serial_number(self) -> int:
        """Return a number that changes with every initialisation and release."""


def c_function(name: str, body: Body) -> Any:
    """Return `body` as the C function `name`; no exception ever gets into C."""

    def call(*args: Any) -> int:
        try:
            return body(*args)
        except Refusal as refusal:
            return refusal.code
        except Exception:
            logger.exception("the simulated %s failed", name)
            return SA_OTHER_ERROR

    pointer = function_type(name)(call)
    pointer.__name__ = name  # as the functions of a loaded library have; clients read it
    return pointer


def section_two(session: Session) -> dict[str, Body]:
    """Return the bodies of all functions that talk to devices, by C name."""
    bodies: dict[str, Body] = {}
    for base, operation in OPERATIONS.items():
        bodies[f"SA_{base}_S"] = _synchronous(session, base, operation)
        bodies[f"SA_{base}_A"] = _asynchronous(session, base, operation)
    del bodies["SA_SetReportOnComplete_S"]
    return bodies | _system_property_bodies(session) | _receiving_bodies(session)


def _channel(device: Device, index: int) -> Channel:
    if index >= len(device.channels):
        raise Refusal(SA_INVALID_CHANNEL_INDEX_ERROR)
    return device.channels[index]


def _stops(base: str, args: Sequence[int]) -> bool:
    """Return whether a call stops a channel; no step is another way to say so."""
    return base == "Stop" or (base == "MoveStep" and args[0] == 0)


def _sync_latency_s(device: Device, channel: int | None) -> float:
    """Return how long a synchronous call takes; call with the lock held."""
    settings = device.settings
    latency_s = device.random.uniform(settings.call_latency_low_s, settings.call_latency_high_s)
    return latency_s + device.faults.delay_s(device.number, channel)


def _block(session: Session, device_index: int, channel_index: int, *, asynchronous: bool) -> None:
    """Suffer the fault `blocked_call`, with no lock held, so that a stop gets through."""
    device = session.device(device_index, asynchronous=asynchronous)
    fault = device.faults.take("blocked_call", device.number, channel_index)
    if fault is not None:
        session.clock.sleep(fault.delay_s)


def _synchronous(session: Session, base: str, operation: Operation) -> Body:
    given = operation.arguments
    unplugged_code = SA_TIMEOUT_ERROR if operation.packet else SA_TRANSMIT_ERROR

    def body(device_index: int, channel_index: int, *rest: Any) -> int:
        if operation.moves and not _stops(base, rest):
            _block(session, device_index, channel_index, asynchronous=False)
        device = session.device(device_index, asynchronous=False)
        with device.changed:
            device = session.device(device_index, asynchronous=False)
            channel = _channel(device, channel_index)
            args, outs = rest[:given], rest[given:]
            if not (all(outs) and operation.fits(*args)):
                return SA_INVALID_PARAMETER_ERROR
            if device.unplugged:
                return unplugged_code
            latency_s = 0.0 if _stops(base, args) else _sync_latency_s(device, channel_index)
            now_s = session.clock.now_s()
            device.advance(now_s)
            values, status = _run(operation, channel, now_s, args)
            status = device.reported(status)
        session.scene.keep_up()  # with no lock held
        if latency_s:
            session.clock.sleep(latency_s)
        for out, value in zip(outs, values, strict=False):
            out[0] = value
        return status

    return body


def _run(
    operation: Operation, channel: Channel, now_s: float, args: tuple[int, ...]
) -> tuple[tuple[int, ...], int]:
    try:
        return operation.run(channel, now_s, *args), SA_OK
    except Refusal as refusal:
        return (), refusal.code


def _asynchronous(session: Session, base: str, operation: Operation) -> Body:
    def body(device_index: int, channel_index: int, *args: int) -> int:
        stops = _stops(base, args)
        if operation.moves and not stops:
            _block(session, device_index, channel_index, asynchronous=True)
        device = session.device(device_index, asynchronous=True)
        if stops:
            return _stop_from_now(session, device, channel_index, operation, args)
        with device.changed:
            device = session.device(device_index, asynchronous=True)
            channel = _channel(device, channel_index)
            if not operation.fits(*args):
                return SA_INVALID_PARAMETER_ERROR
            if device.unplugged:
                return SA_TRANSMIT_ERROR
            if device.queue.full:
                return SA_WRITE_ERROR
            _carry_out(operation, device, channel, session.clock.now_s(), args)
            return SA_OK

    return body


def _stop_from_now(
    session: Session, device: Device, index: int, operation: Operation, args: tuple[int, ...]
) -> int:
    """Stop as of now, though another call be still carried out: who has the lock may be held up."""
    channel = _channel(device, index)
    if not operation.fits(*args):
        return SA_INVALID_PARAMETER_ERROR
    if device.unplugged:
        return SA_TRANSMIT_ERROR
    now_s = session.clock.now_s()
    device.lock.leave(lambda: _carry_out(operation, device, channel, now_s, args))
    return SA_OK


def _carry_out(
    operation: Operation, device: Device, channel: Channel, now_s: float, args: tuple[int, ...]
) -> None:
    """Carry out an asynchronous command; the library's lock is held."""
    device.advance(now_s)
    values, status = _run(operation, channel, now_s, args)
    if status >= _FIRST_HARDWARE_ERROR:
        channel.post_error(status, now_s)
    elif operation.packet:
        data = operation.data(args, values)
        device.post((operation.packet, channel.index, *data), now_s)
    # A listener that waits works out anew what comes next.
    device.changed.notify_all()


def _system_property_bodies(session: Session) -> dict[str, Body]:
    def get_sync(device_index: int, key: int, out: Any) -> int:
        device = session.device(device_index, asynchronous=False)
        if not out or key not in SYSTEM_KEYS:
            return SA_INVALID_PARAMETER_ERROR
        if device.unplugged:
            return SA_TIMEOUT_ERROR
        with device.changed:
            latency_s, value = _sync_latency_s(device, None), system_property(device, key)
        session.clock.sleep(latency_s)
        out[0] = value
        return SA_OK

    def get_async(device_index: int, key: int) -> int:
        device = session.device(device_index, asynchronous=True)
        if key not in SYSTEM_KEYS:
            return SA_INVALID_PARAMETER_ERROR
        if device.unplugged:
            return SA_TRANSMIT_ERROR
        with device.changed:
            if device.queue.full:
                return SA_WRITE_ERROR
            value = system_property(device, key)
            packet = (SA_SYSTEM_PROPERTY_PACKET_TYPE, _SYSTEM_CHANNEL, key, value, 0)
            device.post(packet, session.clock.now_s())
        return SA_OK

    def set_none(asynchronous: bool) -> Body:
        # All keys known can only be read.
        def body(device_index: int, _key: int, _value: int) -> int:
            session.device(device_index, asynchronous=asynchronous)
            return SA_INVALID_PARAMETER_ERROR

        return body

    return {
        "SA_GetSystemProperty_S": get_sync,
        "SA_GetSystemProperty_A": get_async,
        "SA_SetSystemProperty_S": set_none(asynchronous=False),
        "SA_SetSystemProperty_A": set_none(asynchronous=True),
    }


def _receiving_bodies(session: Session) -> dict[str, Body]:
    def receive(device_index: int, timeout_ms: int, packet: Any) -> int:
        return _receive(session, device_index, timeout_ms, packet)

    def receive_if_channel(
        device_index: int, channel_index: int, timeout_ms: int, packet: Any
    ) -> int:
        _channel(session.device(device_index, asynchronous=True), channel_index)
        return _receive(session, device_index, timeout_ms, packet, channel=channel_index)

    def look(device_index: int, timeout_ms: int, packet: Any) -> int:
        return _receive(session, device_index, timeout_ms, packet, consume=False)

    def discard(device_index: int) -> int:
        device = session.device(device_index, asynchronous=True)
        with device.changed:
            now_s = session.clock.now_s()
            device.advance(now_s)
            device.queue.pop(now_s)
            device.changed.notify_all()
        return SA_OK

    def set_notification(device_index: int, event: int | None) -> int:
        device = session.device(device_index, asynchronous=True)
        if not event:
            return SA_INVALID_PARAMETER_ERROR
        with device.changed:
            if device.notification is not None:
                return SA_NOTIFICATION_ALREADY_SET_ERROR
            device.notification = event
        return SA_OK

    return {
        "SA_ReceiveNextPacket_A": receive,
        "SA_ReceiveNextPacketIfChannel_A": receive_if_channel,
        "SA_LookAtNextPacket_A": look,
        "SA_DiscardPacket_A": discard,
        "SA_SetReceiveNotification_A": set_notification,
    }


def _receive(
    session: Session,
    device_index: int,
    timeout_ms: int,
    packet: Any,
    *,
    channel: int | None = None,
    consume: bool = True,
) -> int:
    clock = session.clock
    device = session.device(device_index, asynchronous=True)
    if not packet:
        return SA_INVALID_PARAMETER_ERROR
    opened = session.serial_number()
    # The time-out counts on the wall, so that listeners do not spin on a fast clock; the clock's
    # time ends it as well, for a test may move that.
    deadline_s = clock.now_s() + timeout_ms / 1e3 * (clock.rate or 1.0)
    wall_s = WALL.now_s() + timeout_ms / 1e3
    with device.changed:
        while True:
            if session.serial_number() != opened:
                return SA_NOT_INITIALIZED_ERROR
            if device.unplugged:
                return SA_READ_ERROR
            now_s = clock.now_s()
            device.advance(now_s)
            head = device.queue.head(now_s)
            if head is not None and channel in (None, head[1]):
                break
            if now_s >= deadline_s or WALL.now_s() >= wall_s:
                head = _NOTHING_CAME
                break
            clock.wait(device.changed, min(deadline_s, device.next_event_s(now_s)))
        if consume and head is not _NOTHING_CAME:
            device.queue.pop(now_s)
            device.changed.notify_all()
    session.scene.keep_up()  # with no lock held
    out = packet[0]
    out.packetType, out.channelIndex, out.data1, out.data2, out.data3 = head
    return SA_OK
