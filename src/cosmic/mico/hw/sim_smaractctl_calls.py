"""The C functions of the simulated SmarActCTL that talk to a device, as Python bodies."""

import ctypes
from collections.abc import Callable
from typing import Any, Final, Protocol

from cosmic.frame.clock import WALL, Clock
from cosmic.mico.hw import sim_smaractctl_moves as moves
from cosmic.mico.hw import sim_smaractctl_properties as properties
from cosmic.mico.hw import smaractctl_ctypes as sa
from cosmic.mico.hw.sim_smaractctl_device import DEVICE_INDEX, Device, Request
from cosmic.mico.hw.sim_smaractctl_types import Refused
from cosmic.twin.scene import Scene

Body = Callable[..., int]
_DTYPES: Final = {
    "i32": sa.SA_CTL_DTYPE_INT32,
    "i64": sa.SA_CTL_DTYPE_INT64,
    "s": sa.SA_CTL_DTYPE_STRING,
}
_FIRST_MODULE_EVENT: Final = 0x4000
_LONGEST_ANSWER_S: Final = 2.0


class Session(Protocol):
    """What these functions need of the library."""

    clock: Clock
    scene: Scene

    def device(self, handle: int) -> Device:
        """Return the device with that handle; raises `Refused`."""


def device_functions(session: Session) -> dict[str, Body]:
    """Return the bodies of all functions that talk to a device, by C name."""
    return {
        **_property_functions(session),
        **_request_functions(session),
        **_movement_functions(session),
        **_transmission_functions(session),
        "SA_CTL_WaitForEvent": _waiting(session),
    }


def text_out(text: str, out: Any, size: Any) -> int:
    """Write a text where C wants it; the size goes in as bytes, comes out without the NUL."""
    data = text.encode()
    room = size[0] if size else sa.SA_CTL_STRING_MAX_LENGTH + 1
    if size:
        size[0] = len(data)
    if not out or room < len(data) + 1:
        return sa.SA_CTL_ERROR_INVALID_QUERYBUFFER_SIZE
    ctypes.memmove(out, data + b"\0", len(data) + 1)
    return sa.SA_CTL_ERROR_NONE


def _value_out(dtype: int, value: properties.Value, out: Any, size: Any) -> int:
    if dtype == sa.SA_CTL_DTYPE_STRING:
        return text_out(str(value), out, size)
    if not out:
        return sa.SA_CTL_ERROR_INVALID_PARAMETER
    if size:
        if size[0] < 1:
            return sa.SA_CTL_ERROR_INVALID_QUERYBUFFER_SIZE
        size[0] = 1
    out[0] = value
    return sa.SA_CTL_ERROR_NONE


def _given(value: Any) -> properties.Value:
    if value is None:
        raise Refused(sa.SA_CTL_ERROR_INVALID_PARAMETER)  # no text
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else int(value)


def _plugged(session: Session, handle: int) -> Device:
    device = session.device(handle)
    if device.disconnected:
        raise Refused(sa.SA_CTL_ERROR_COMMUNICATION_FAILED)
    return device


def _property_functions(session: Session) -> dict[str, Body]:
    def get(kind: str) -> Body:
        def body(handle: int, index: int, key: int, out: Any, size: Any) -> int:
            device = _plugged(session, handle)
            with device.changed:
                now_s = session.clock.now_s()
                device.advance(now_s)
                latency_s = device.latency_s()
                dtype, value = properties.read(device, index, key, now_s)
                if dtype != _DTYPES[kind]:
                    return sa.SA_CTL_ERROR_INVALID_DATA_TYPE
            session.clock.sleep(latency_s)
            return _value_out(dtype, value, out, size)

        return body

    def put(device_handle: int, index: int, key: int, dtype: int, value: Any) -> int:
        device = _plugged(session, device_handle)
        with device.changed:
            now_s = session.clock.now_s()
            device.advance(now_s)
            latency_s = device.latency_s()
            _check_type(device, index, key, dtype, now_s)
            properties.write(device, index, key, _given(value), now_s)
            device.changed.notify_all()
        session.clock.sleep(latency_s)
        return sa.SA_CTL_ERROR_NONE

    def set_one(kind: str) -> Body:
        return lambda handle, index, key, value: put(handle, index, key, _DTYPES[kind], value)

    def set_many(kind: str) -> Body:
        def body(handle: int, index: int, key: int, values: Any, size: int) -> int:
            if size != 1 or not values:
                return sa.SA_CTL_ERROR_INVALID_ARRAY_SIZE  # no property simulated takes more
            return put(handle, index, key, _DTYPES[kind], values[0])

        return body

    return {
        **{f"SA_CTL_GetProperty_{kind}": get(kind) for kind in _DTYPES},
        **{f"SA_CTL_SetProperty_{kind}": set_one(kind) for kind in _DTYPES},
        **{f"SA_CTL_SetPropertyArray_{kind}": set_many(kind) for kind in ("i32", "i64")},
    }


def _check_type(device: Device, index: int, key: int, dtype: int, now_s: float) -> None:
    """Refuse a value of the wrong type; some readings need a sensor, which does not matter here."""
    try:
        wanted, _ = properties.read(device, index, key, now_s)
    except Refused as refused:
        if refused.code in (
            sa.SA_CTL_ERROR_NO_SENSOR_PRESENT,
            sa.SA_CTL_ERROR_SENSOR_DISABLED,
        ):
            return
        raise
    if wanted != dtype:
        raise Refused(sa.SA_CTL_ERROR_INVALID_DATA_TYPE)


def _request_functions(session: Session) -> dict[str, Body]:
    def ask(handle: int, index: int, key: int, number: Any, transmission: int) -> int:
        device = _plugged(session, handle)
        with device.changed:
            if not number:
                return sa.SA_CTL_ERROR_INVALID_PARAMETER
            now_s = session.clock.now_s()
            device.advance(now_s)
            number[0] = asked = device.ask(key, transmission, writes=False)

            def act(request: Request, at_s: float) -> None:
                request.dtype, request.value = properties.read(device, index, key, at_s)

            _submit(device, asked, index, act, transmission, now_s)
        return sa.SA_CTL_ERROR_NONE

    def cancel(handle: int, number: int) -> int:
        device = session.device(handle)
        with device.changed:
            if device.requests.pop(number, None) is None:
                return sa.SA_CTL_ERROR_INVALID_PARAMETER
        return sa.SA_CTL_ERROR_NONE

    def wait_for_write(handle: int, number: int) -> int:
        return _answer(session, handle, number, writes=True).code

    arrays = ("i32", "i64")
    return {
        "SA_CTL_RequestReadProperty": ask,
        "SA_CTL_WaitForWrite": wait_for_write,
        "SA_CTL_CancelRequest": cancel,
        **{f"SA_CTL_ReadProperty_{kind}": _fetching(session, kind) for kind in _DTYPES},
        **{f"SA_CTL_RequestWriteProperty_{kind}": _writing(session, kind) for kind in _DTYPES},
        **{f"SA_CTL_RequestWritePropertyArray_{kind}": _array(session, kind) for kind in arrays},
    }


def _fetching(session: Session, kind: str) -> Body:
    def body(handle: int, number: int, out: Any, size: Any) -> int:
        request = _answer(session, handle, number, writes=False)
        if request.code:
            return request.code
        if request.dtype != _DTYPES[kind]:
            return sa.SA_CTL_ERROR_INVALID_DATA_TYPE
        return _value_out(request.dtype, request.value, out, size)

    return body


def _writing(session: Session, kind: str) -> Body:
    def body(handle: int, index: int, key: int, value: Any, number: Any, transmission: int) -> int:
        device = _plugged(session, handle)
        given = _given(value)

        def act(_request: Request, at_s: float) -> None:
            _check_type(device, index, key, _DTYPES[kind], at_s)
            properties.write(device, index, key, given, at_s)

        with device.changed:
            now_s = session.clock.now_s()
            device.advance(now_s)
            asked = -1
            if number:
                number[0] = asked = device.ask(key, transmission, writes=True)
            _submit(device, asked, index, act, transmission, now_s)
        return sa.SA_CTL_ERROR_NONE

    return body


def _array(session: Session, kind: str) -> Body:
    one = _writing(session, kind)

    def body(
        handle: int, index: int, key: int, values: Any, size: int, number: Any, sent: int
    ) -> int:
        if size != 1 or not values:
            return sa.SA_CTL_ERROR_INVALID_ARRAY_SIZE  # no property simulated takes more
        return one(handle, index, key, values[0], number, sent)

    return body


def _submit(
    device: Device,
    number: int,
    index: int,
    act: Callable[[Request, float], None],
    transmission: int,
    now_s: float,
) -> None:
    def run(at_s: float) -> None:
        if number < 0:
            try:
                act(Request(0, writes=True), at_s)
            except Refused:
                return  # nobody asked how it went
        else:
            device.answer(number, index, at_s, lambda request: act(request, at_s))

    device.run(run, transmission, now_s)


def _answer(session: Session, handle: int, number: int, *, writes: bool) -> Request:
    """Wait for the answer of a request and take it; raises `Refused`."""
    clock, device = session.clock, session.device(handle)
    deadline_s = clock.now_s() + _LONGEST_ANSWER_S
    with device.changed:
        while True:
            session.device(handle)
            request = device.requests.get(number)
            if request is None or request.writes is not writes:
                raise Refused(sa.SA_CTL_ERROR_INVALID_PARAMETER)
            now_s = clock.now_s()
            if request.due_s is not None and request.due_s <= now_s:
                return device.requests.pop(number)
            if device.disconnected:
                raise Refused(sa.SA_CTL_ERROR_COMMUNICATION_FAILED)
            if request.due_s is None and now_s >= deadline_s:
                raise Refused(sa.SA_CTL_ERROR_TIMEOUT)
            clock.wait(device.changed, request.due_s or deadline_s)


def _movement_functions(session: Session) -> dict[str, Body]:
    def command(handle: int, transmission: int, make: Callable[[Device], Any]) -> int:
        device = _plugged(session, handle)
        with device.changed:
            now_s = session.clock.now_s()
            device.advance(now_s)
            device.run(make(device), transmission, now_s)
            device.changed.notify_all()
        session.scene.keep_up()  # with no lock held
        return sa.SA_CTL_ERROR_NONE

    def move(handle: int, index: int, value: int, transmission: int) -> int:
        device = session.device(handle)
        fault = device.faults.take("blocked_call", device.number, index)
        if fault is not None:
            session.clock.sleep(fault.delay_s)  # with no lock held, so that a stop gets through
        return command(handle, transmission, lambda at: at.move(index, value))

    def reference(handle: int, index: int, transmission: int) -> int:
        return command(handle, transmission, lambda at: at.movement(index, moves.reference))

    def calibrate(handle: int, index: int, transmission: int) -> int:
        return command(handle, transmission, lambda at: at.movement(index, moves.calibrate))

    def stop(handle: int, index: int, transmission: int) -> int:
        if transmission:
            return command(handle, transmission, lambda at: at.channel(index).stop)
        device = _plugged(session, handle)
        channel, now_s = device.channel(index), session.clock.now_s()

        def carry_out() -> None:
            device.advance(now_s)
            device.run(channel.stop, transmission, now_s)
            device.changed.notify_all()

        # It counts from now, also where another call is still being carried out.
        device.lock.leave(carry_out)
        return sa.SA_CTL_ERROR_NONE

    return {
        "SA_CTL_Move": move,
        "SA_CTL_Reference": reference,
        "SA_CTL_Calibrate": calibrate,
        "SA_CTL_Stop": stop,
    }


def _transmission_functions(session: Session) -> dict[str, Body]:
    def open_one(handle: int, out: Any, *, group: bool) -> int:
        device = _plugged(session, handle)
        if not out:
            return sa.SA_CTL_ERROR_INVALID_PARAMETER
        with device.changed:
            out[0] = device.open_transmission(group=group)
        return sa.SA_CTL_ERROR_NONE

    def open_group(handle: int, out: Any, trigger: int) -> int:
        if trigger == sa.SA_CTL_CMD_GROUP_TRIGGER_MODE_EXTERNAL:
            return sa.SA_CTL_ERROR_FEATURE_NOT_SUPPORTED  # nothing is wired to a trigger input
        if trigger != sa.SA_CTL_CMD_GROUP_TRIGGER_MODE_DIRECT:
            return sa.SA_CTL_ERROR_INVALID_PARAMETER
        return open_one(handle, out, group=True)

    def send(handle: int, transmission: int, *, group: bool) -> int:
        device = _plugged(session, handle)
        with device.changed:
            _require(device, transmission, group=group)
            now_s = session.clock.now_s()
            device.advance(now_s)
            device.send(transmission, now_s)
            device.changed.notify_all()
        session.scene.keep_up()
        return sa.SA_CTL_ERROR_NONE

    def drop(handle: int, transmission: int, *, group: bool) -> int:
        device = session.device(handle)
        with device.changed:
            _require(device, transmission, group=group)
            device.drop(transmission)
            device.changed.notify_all()
        return sa.SA_CTL_ERROR_NONE

    def no_stream(handle: int, *_args: Any) -> int:
        session.device(handle)
        return sa.SA_CTL_ERROR_FEATURE_NOT_SUPPORTED

    streams = ("OpenStream", "StreamFrame", "CloseStream", "AbortStream")
    return {
        "SA_CTL_CreateOutputBuffer": lambda handle, out: open_one(handle, out, group=False),
        "SA_CTL_FlushOutputBuffer": lambda handle, at: send(handle, at, group=False),
        "SA_CTL_CancelOutputBuffer": lambda handle, at: drop(handle, at, group=False),
        "SA_CTL_OpenCommandGroup": open_group,
        "SA_CTL_CloseCommandGroup": lambda handle, at: send(handle, at, group=True),
        "SA_CTL_CancelCommandGroup": lambda handle, at: drop(handle, at, group=True),
        **{f"SA_CTL_{name}": no_stream for name in streams},
    }


def _require(device: Device, transmission: int, *, group: bool) -> None:
    if device.transmission(transmission).group is not group:
        raise Refused(sa.SA_CTL_ERROR_INVALID_TRANSMIT_HANDLE)


def _waiting(session: Session) -> Body:
    def wait(handle: int, event: Any, timeout_ms: int) -> int:
        device = session.device(handle)
        if not event:
            return sa.SA_CTL_ERROR_INVALID_PARAMETER
        with device.changed:
            if device.waiting == handle:
                return sa.SA_CTL_ERROR_THREAD_LIMIT_REACHED
            device.waiting = handle
            try:
                packet = _next_event(session, device, handle, timeout_ms)
            finally:
                if device.waiting == handle:  # it may be open again, and waited for
                    device.waiting = 0
        session.scene.keep_up()  # with no lock held
        out = event[0]
        out.type, index, value = packet[0], packet[1], packet[2]
        out.idx = 0 if index == DEVICE_INDEX else index
        if out.type == sa.SA_CTL_EVENT_REQUEST_READY:
            out.value.i64 = value
        else:
            out.value.i64 = value & 0xFFFF_FFFF
        return sa.SA_CTL_ERROR_NONE

    return wait


def _next_event(
    session: Session, device: Device, handle: int, timeout_ms: int
) -> tuple[int, int, int, int, int]:
    """Wait for the next event and take it; raises `Refused`. With the device's lock held."""
    clock = session.clock
    for_ever = timeout_ms == sa.SA_CTL_INFINITE
    # The time-out counts on the wall, so that listeners do not spin on a fast clock; the clock's
    # time ends it as well, for a test may move that.
    wait_s = 1e9 if for_ever else timeout_ms / 1e3
    deadline_s = clock.now_s() + wait_s * (clock.rate or 1.0)
    wall_s = WALL.now_s() + wait_s
    while True:
        if device.handle != handle:
            raise Refused(sa.SA_CTL_ERROR_CANCELED)
        if device.cancelled:
            device.cancelled = False
            raise Refused(sa.SA_CTL_ERROR_CANCELED)
        now_s = clock.now_s()
        device.advance(now_s)
        head = device.queue.head(now_s)
        if head is not None:
            device.queue.pop(now_s)
            return head
        if device.disconnected:
            raise Refused(sa.SA_CTL_ERROR_COMMUNICATION_FAILED)
        if now_s >= deadline_s or WALL.now_s() >= wall_s:
            raise Refused(sa.SA_CTL_ERROR_TIMEOUT)
        clock.wait(device.changed, min(deadline_s, device.next_event_s(now_s)))
