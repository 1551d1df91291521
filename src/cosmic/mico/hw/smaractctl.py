"""SmarAct's MCS2 through the library SmarActCTL: requests, events and command groups."""

import ctypes
import logging
import threading
from collections.abc import Callable, Iterable, Sequence
from ctypes import byref, c_int32, c_int64, c_size_t, c_uint8, c_uint32, create_string_buffer
from dataclasses import dataclass, field
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.frame.plugins import NoOptions
from cosmic.frame.units import AxisUnit
from cosmic.mico.hw import smaractctl_convert as convert
from cosmic.mico.hw import smaractctl_ctypes as sa
from cosmic.mico.hw import smaractctl_events as events
from cosmic.mico.hw.addresses import device_of, open_device
from cosmic.mico.hw.interface import (
    Activity,
    ActivityRead,
    Capabilities,
    Channel,
    Completed,
    Controller,
    ControllerBackend,
    ControllerContext,
    DeviceIdentity,
    Direction,
    Event,
    Failed,
    MatchedMove,
    Serial,
)
from cosmic.mico.hw.smaract_load import SmaractLibrary
from cosmic.mico.hw.smaractctl_errors import LIBRARY, result_error

SMARACT_CTL: Final = SmaractLibrary(
    windows="SmarActCTL.dll",
    linux="libsmaractctl.so",
    product="SmarActCTL",
    sdk="SmarAct MCS2 SDK",
    proof="SA_CTL_Open",
    others="SCU and MCS",
)


def load_library(path: str = "") -> ctypes.CDLL:
    """Load SmarActCTL; see `SmaractLibrary.load`."""
    return SMARACT_CTL.load(path)


logger = logging.getLogger(__name__)

_NOT_OPEN: Final = "SmarActCTL is not open"

MOST_CHANNELS: Final = 18
IDLE_MAY_LIE_S: Final = 0.5
"""So long after a movement began, a channel may say that it stands though it goes on."""
_TEXTS: Final = (
    sa.SA_CTL_PKEY_POSITIONER_TYPE_NAME,
    sa.SA_CTL_PKEY_DEVICE_SERIAL_NUMBER,
)
_LONG: Final = (
    sa.SA_CTL_PKEY_POSITION,
    sa.SA_CTL_PKEY_MOVE_VELOCITY,
    sa.SA_CTL_PKEY_MOVE_ACCELERATION,
    sa.SA_CTL_PKEY_FOLLOWING_ERROR_LIMIT,
)
_POSITION_CALL: Final = "SA_CTL_GetProperty_i64"
_TEXT_SIZE: Final = sa.SA_CTL_STRING_MAX_LENGTH + 1
_FAR: Final = 10**12
"""A way that no positioner has, so that it meets its end stop: 1 m, or 1000 degrees."""
Writes = Iterable[tuple[int, int]]


@dataclass(slots=True)
class _Device:
    """One open device; what changes is written by one thread or in one step."""

    handle: int
    serial: Serial
    channels: int
    questions: dict[int, tuple[events.Question, int]] = field(default_factory=dict)
    asking: threading.Lock = field(default_factory=threading.Lock)
    begun_s: dict[int, float] = field(default_factory=dict)
    seeks_end: set[int] = field(default_factory=set)
    speeds: dict[int, tuple[int, int]] = field(default_factory=dict)
    lag_limits: dict[int, int] = field(default_factory=dict)
    frequencies: dict[int, int] = field(default_factory=dict)
    paced: set[int] = field(default_factory=set)


class SmaractCtlController(Controller):
    """The MCS2s that one SmarActCTL library drives, real or simulated.

    Parameters
    ----------
    library : ctypes.CDLL or object
        The loaded library, or an object with the same `SA_CTL_...` function pointers.
    simulated : bool
        True when `library` moves nothing real.
    locators : sequence of str
        Devices that the library does not find by itself, such as "network:192.168.1.200".

    Notes
    -----
    Thread-safe as the library is by its documentation. A movement is sent only after the
    controller has acknowledged how it is to be made; what is asked is answered by events. Nothing
    that outlives the power is written but the limit of the following error, and that only where it
    differs.
    """

    def __init__(
        self, library: object, *, simulated: bool = False, locators: Sequence[str] = ()
    ) -> None:
        self._library = sa.SmaractCtlLibrary(library)
        self._simulated = simulated
        self._locators = tuple(locators)
        self._lifecycle = threading.Lock()
        self._devices: tuple[_Device, ...] = ()
        self._library.has("SA_CTL_Stop")  # bound now, so that the first stop is not the slowest

    @property
    @override
    def name(self) -> str:
        version = self._library.text("SA_CTL_GetFullVersionString") or "of unknown version"
        return f"SmarActCTL {version}{' (simulated)' if self._simulated else ''}"

    @property
    @override
    def simulated(self) -> bool:
        return self._simulated

    @property
    @override
    def capabilities(self) -> Capabilities:
        return self._able(max((each.channels for each in self._devices), default=MOST_CHANNELS))

    @override
    def device_capabilities(self, device: int) -> Capabilities:
        return self._able(self._device(device).channels)

    def _able(self, channels: int) -> Capabilities:
        return Capabilities(
            group_start=True,
            velocity=True,
            position_known=True,
            channels=channels,
            most_steps=convert.MOST_STEPS,
            frequency_hz=convert.FREQUENCY_HZ,
            amplitude_v=convert.AMPLITUDE_V,
            keeps_interpreter=self._library.keeps_interpreter,
        )

    # Opening and closing

    @override
    def find_devices(self) -> tuple[Serial, ...]:
        return tuple(self._found())

    def _found(self) -> dict[str, str]:
        """Return the locator of every device by its serial number, or by itself."""
        size = c_size_t(2**14)
        text = create_string_buffer(size.value)
        code = self._library.call("SA_CTL_FindDevices", b"", text, byref(size))
        self._checked(code, "SA_CTL_FindDevices()")
        found = [line.strip() for line in text.value.decode("ascii", "replace").split("\n")]
        by_serial = {each.partition(":sn:")[2] or each: each for each in found if each}
        return by_serial | {each: each for each in self._locators if each not in found}

    @override
    def open(self, serials: Sequence[Serial] = ()) -> tuple[DeviceIdentity, ...]:
        with self._lifecycle:
            if self._devices:
                raise DeviceError("SmarActCTL is open already", fault=DeviceFault.STATE)
            found = self._found()
            missing = [str(serial) for serial in serials if serial not in found]
            if missing or not found:
                raise NotConnectedError(
                    f"{LIBRARY}: no device {', '.join(missing)}; "
                    f"connected: {', '.join(found) or 'none'}; check power and cable",
                    fault=DeviceFault.COMMUNICATION,
                    code=sa.SA_CTL_ERROR_DEVICE_NOT_FOUND,
                )
            wanted = [str(serial) for serial in serials] or list(found)
            opened: list[_Device] = []
            try:
                for serial in wanted:
                    opened.append(self._open_one(serial, found[serial]))
            except DeviceError:
                self._release(opened)
                raise
            self._devices = tuple(opened)
        logger.info("%s opened with devices %s", self.name, wanted)
        firmware = self._library.text("SA_CTL_GetFullVersionString")
        return tuple(
            DeviceIdentity(index, each.serial, ".".join(firmware.split(".")[:3]))
            for index, each in enumerate(opened)
        )

    def _open_one(self, serial: str, locator: str) -> _Device:
        handle = c_uint32()
        code = self._library.call("SA_CTL_Open", byref(handle), locator.encode(), b"")
        self._checked(code, f"SA_CTL_Open({locator})")
        device = _Device(handle.value, serial, 0)
        try:
            device.channels = self._read(device, sa.SA_CTL_PKEY_NUMBER_OF_CHANNELS)
            key, on = sa.SA_CTL_PKEY_EVENT_NOTIFICATION_OPTIONS, 1
            code = self._library.call("SA_CTL_SetProperty_i32", device.handle, 0, key, on)
            self._checked(code, "SA_CTL_SetProperty_i32(EVENT_NOTIFICATION_OPTIONS)")
        except DeviceError:
            self._release([device])
            raise
        return device

    def _read(self, device: _Device, key: int) -> int:
        value = c_int32()
        code = self._library.call(
            "SA_CTL_GetProperty_i32", device.handle, 0, key, byref(value), None
        )
        self._checked(code, f"SA_CTL_GetProperty_i32({key:#010x})")
        return value.value

    @override
    def close(self) -> None:
        with self._lifecycle:
            devices, self._devices = self._devices, ()
            self._release(devices)

    def _release(self, devices: Iterable[_Device]) -> None:
        for device in devices:
            code = self._library.call("SA_CTL_Close", device.handle)
            if code != sa.SA_CTL_ERROR_NONE:
                logger.warning("%s", result_error(code, "SA_CTL_Close()", serial=device.serial))

    # What comes back

    @override
    def receive(self, device: int, timeout_s: float) -> Event | None:
        at, wait_ms = self._device(device), convert.timeout_ms(timeout_s)
        event = sa.SA_CTL_Event()
        code = self._library.call("SA_CTL_WaitForEvent", at.handle, byref(event), wait_ms)
        if code in (sa.SA_CTL_ERROR_TIMEOUT, sa.SA_CTL_ERROR_CANCELED):
            return None
        self._checked(code, "SA_CTL_WaitForEvent()", device=device)
        said = self._said(device, at, event)
        if said is not None and logger.isEnabledFor(logging.DEBUG):
            logger.debug("device %d: %s", device, said)
        return said

    def _said(self, device: int, at: _Device, event: sa.SA_CTL_Event) -> Event | None:
        if event.type == sa.SA_CTL_EVENT_REQUEST_READY:
            return self._answered(device, at, event.i64 & 0xFF)
        seeks = event.idx in at.seeks_end
        said = events.event_of(device, event, serial=at.serial, seeks_end=seeks)
        if event.type == sa.SA_CTL_EVENT_MOVEMENT_FINISHED:
            at.begun_s.pop(event.idx, None)
            if isinstance(said, (Completed, Failed)):
                at.seeks_end.discard(event.idx)
        return said

    def _answered(self, device: int, at: _Device, number: int) -> Event | None:
        """Return the event of a question whose last answer this is."""
        with at.asking:
            question, key = at.questions.pop(number, (None, 0))
        if question is None:
            return None  # a write, which its writer waits for
        code, value = self._fetch(at, number, key)
        if code != sa.SA_CTL_ERROR_NONE:
            with at.asking:
                dropped = [n for n, (other, _) in at.questions.items() if other is question]
                for other in dropped:
                    del at.questions[other]
            for other in dropped:
                self._library.call("SA_CTL_CancelRequest", at.handle, other)
            channel = question.at.channel
            call = f"reading {key:#010x}"
            error = result_error(code, call, device=device, channel=channel, serial=at.serial)
            return Failed(question.at, error)
        question.answers[key] = value
        if len(question.answers) < len(question.keys):
            return None
        return self._believed(at, question.make(question.at, question.answers))

    def _believed(self, at: _Device, said: Event) -> Event:
        """Return an answer, but not that a channel stands which has only just been sent off."""
        if isinstance(said, ActivityRead) and said.activity.at_rest:
            begun_s = at.begun_s.get(said.channel.channel)
            if begun_s is not None and WALL.now_s() - begun_s < IDLE_MAY_LIE_S:
                return ActivityRead(said.channel, Activity.TARGETING)
        return said

    def _fetch(self, at: _Device, number: int, key: int) -> tuple[int, int | str]:
        if key in _TEXTS:
            size, text = c_size_t(_TEXT_SIZE), create_string_buffer(_TEXT_SIZE)
            code = self._library.call("SA_CTL_ReadProperty_s", at.handle, number, text, byref(size))
            return code, text.value.decode("ascii", "replace")
        if key in _LONG:
            long = c_int64()
            call = "SA_CTL_ReadProperty_i64"
            return self._library.call(call, at.handle, number, byref(long), None), long.value
        short = c_int32()
        call = "SA_CTL_ReadProperty_i32"
        return self._library.call(call, at.handle, number, byref(short), None), short.value

    # Questions

    def _ask(
        self,
        channel: Channel,
        keys: tuple[int, ...],
        make: Callable[[Channel, events.Answers], Event],
    ) -> None:
        at = self._at(channel, "asking")
        question = events.Question(channel, keys, make)
        for key in keys:
            number = c_uint8()
            with at.asking:  # the answer must not come before it is known whose it is
                code = self._library.call(
                    "SA_CTL_RequestReadProperty", at.handle, channel.channel, key, byref(number), 0
                )
                if code == sa.SA_CTL_ERROR_NONE:
                    at.questions[number.value] = (question, key)
            self._checked(code, "SA_CTL_RequestReadProperty()", at=channel)

    @override
    def report_completion(self, channel: Channel) -> None:
        self._at(channel, "report_completion")  # an MCS2 always tells

    @override
    def ask_sensor_present(self, channel: Channel) -> None:
        self._ask(channel, (sa.SA_CTL_PKEY_CHANNEL_STATE,), events.sensor_present)

    @override
    def ask_type(self, channel: Channel) -> None:
        keys = (
            sa.SA_CTL_PKEY_POSITIONER_TYPE,
            sa.SA_CTL_PKEY_POSITIONER_TYPE_NAME,
            sa.SA_CTL_PKEY_POS_BASE_UNIT,
            sa.SA_CTL_PKEY_POS_REFERENCE_TYPE,
            sa.SA_CTL_PKEY_LOGICAL_SCALE_INVERSION,
        )
        self._ask(channel, keys, events.positioner_type)

    @override
    def ask_position_known(self, channel: Channel) -> None:
        self._ask(channel, (sa.SA_CTL_PKEY_CHANNEL_STATE,), events.position_known)

    @override
    def ask_safe_direction(self, channel: Channel) -> None:
        self._ask(channel, (sa.SA_CTL_PKEY_SAFE_DIRECTION,), events.safe_direction)

    @override
    def ask_position(self, channel: Channel, unit: AxisUnit) -> None:
        keys = (sa.SA_CTL_PKEY_POS_BASE_UNIT, sa.SA_CTL_PKEY_POSITION)
        self._ask(channel, keys, events.position_in(unit))

    @override
    def ask_activity(self, channel: Channel) -> None:
        self._ask(channel, (sa.SA_CTL_PKEY_CHANNEL_STATE,), events.activity_read)

    # Movements

    @override
    def set_closed_loop_frequency(self, channel: Channel, frequency_hz: int) -> None:
        hertz = convert.frequency(frequency_hz, channel)
        self._write(channel, [(sa.SA_CTL_PKEY_MAX_CL_FREQUENCY, hertz)])
        self._at(channel, "set_closed_loop_frequency").frequencies[channel.channel] = hertz

    @override
    def step(self, channel: Channel, steps: int, *, amplitude_v: float, frequency_hz: int) -> None:
        count = convert.step_count(steps, channel)
        writes = [
            (sa.SA_CTL_PKEY_STEP_AMPLITUDE, convert.amplitude(amplitude_v, channel)),
            (sa.SA_CTL_PKEY_STEP_FREQUENCY, convert.frequency(frequency_hz, channel)),
            (sa.SA_CTL_PKEY_MOVE_MODE, sa.SA_CTL_MOVE_MODE_STEP),
        ]
        self._move(channel, writes, count)

    @override
    def move_to(self, channel: Channel, target: float, unit: AxisUnit, *, hold_s: float) -> None:
        self._closed_loop(channel, convert.counts(target, unit, channel), hold_s)

    @override
    def move_by(self, channel: Channel, distance: float, unit: AxisUnit, *, hold_s: float) -> None:
        self._closed_loop(channel, convert.counts(distance, unit, channel), hold_s, from_here=True)

    @override
    def move_to_end_stop(self, channel: Channel, direction: Direction, *, hold_s: float) -> None:
        far = -_FAR if direction is Direction.BACKWARD else _FAR
        self._closed_loop(channel, far, hold_s, from_here=True, seeks_end=True)

    @override
    def move_together(self, moves: Sequence[MatchedMove]) -> None:
        """Start movements of one device as one command group; all or none."""
        at = self._of_one_device(moves)
        for move in moves:
            at.paced.add(move.channel.channel)
            self._write(move.channel, self._matched(at, move))
            limit = convert.counts(move.following_error, move.unit, move.channel)
            at.lag_limits[move.channel.channel] = limit
        group = c_uint32()
        direct = sa.SA_CTL_CMD_GROUP_TRIGGER_MODE_DIRECT
        code = self._library.call("SA_CTL_OpenCommandGroup", at.handle, byref(group), direct)
        self._checked(code, "SA_CTL_OpenCommandGroup()")
        try:
            for move in moves:
                counts = convert.counts(move.target, move.unit, move.channel)
                index = move.channel.channel
                code = self._library.call("SA_CTL_Move", at.handle, index, counts, group)
                self._checked(code, f"SA_CTL_Move({counts})", at=move.channel)
                at.seeks_end.discard(index)
        except DeviceError:
            self._library.call("SA_CTL_CancelCommandGroup", at.handle, group)
            raise
        code = self._library.call("SA_CTL_CloseCommandGroup", at.handle, group)
        now_s = WALL.now_s()
        self._checked(code, "SA_CTL_CloseCommandGroup()")
        at.begun_s.update((move.channel.channel, now_s) for move in moves)

    def _of_one_device(self, moves: Sequence[MatchedMove]) -> _Device:
        if len({move.channel.device for move in moves}) != 1:
            text = "a command group holds channels of one device"
            raise DeviceError(text, fault=DeviceFault.PARAMETER)
        return self._device(moves[0].channel.device)

    def _matched(self, at: _Device, move: MatchedMove) -> list[tuple[int, int]]:
        channel, unit = move.channel, move.unit
        limit = convert.counts(move.following_error, unit, channel)
        writes = [
            (sa.SA_CTL_PKEY_MOVE_VELOCITY, convert.velocity(move.speed, unit, channel)),
            (
                sa.SA_CTL_PKEY_MOVE_ACCELERATION,
                convert.acceleration(move.acceleration, unit, channel),
            ),
            (sa.SA_CTL_PKEY_MAX_CL_FREQUENCY, convert.FREQUENCY_HZ[1]),
            (sa.SA_CTL_PKEY_HOLD_TIME, convert.hold_ms(move.hold_s, channel)),
            (sa.SA_CTL_PKEY_MOVE_MODE, sa.SA_CTL_MOVE_MODE_CL_ABSOLUTE),
        ]
        if at.lag_limits.get(channel.channel) != limit:
            writes.append((sa.SA_CTL_PKEY_FOLLOWING_ERROR_LIMIT, limit))
        return writes

    @override
    def set_speed(
        self, channel: Channel, speed: float, acceleration: float, unit: AxisUnit
    ) -> None:
        at = self._at(channel, "set_speed")
        at.speeds[channel.channel] = (
            convert.velocity(speed, unit, channel),
            convert.acceleration(acceleration, unit, channel),
        )

    @override
    def calibrate(self, channel: Channel) -> None:
        self._write(channel, [(sa.SA_CTL_PKEY_CALIBRATION_OPTIONS, 0)])
        self._send(channel, "SA_CTL_Calibrate")

    @override
    def reference(self, channel: Channel, *, hold_s: float) -> None:
        hold_ms = convert.hold_ms(hold_s, channel)
        writes = [
            (sa.SA_CTL_PKEY_REFERENCING_OPTIONS, 0),
            (sa.SA_CTL_PKEY_HOLD_TIME, hold_ms),
        ]
        self._write(channel, [*writes, *self._speed(channel)])
        self._send(channel, "SA_CTL_Reference")

    @override
    def stop(self, channel: Channel) -> None:
        at = self._at(channel, "SA_CTL_Stop")
        # With acceleration control the first only begins to brake; the second stops.
        code = self._library.call("SA_CTL_Stop", at.handle, channel.channel, 0)
        again = self._library.call("SA_CTL_Stop", at.handle, channel.channel, 0)
        at.begun_s.pop(channel.channel, None)
        self._checked(code or again, "SA_CTL_Stop()", at=channel)

    def _closed_loop(
        self,
        channel: Channel,
        counts: int,
        hold_s: float,
        *,
        from_here: bool = False,
        seeks_end: bool = False,
    ) -> None:
        mode = sa.SA_CTL_MOVE_MODE_CL_ABSOLUTE
        if from_here and not self._library.has(_POSITION_CALL):
            mode = sa.SA_CTL_MOVE_MODE_CL_RELATIVE  # the best that it can
        elif from_here:
            # The controller's own relative mode adds to the last target, also to one that was
            # never reached, so that it may go another way than it was told.
            counts += self._here(channel)
        writes = [
            *self._speed(channel),
            (sa.SA_CTL_PKEY_HOLD_TIME, convert.hold_ms(hold_s, channel)),
            (sa.SA_CTL_PKEY_MOVE_MODE, mode),
        ]
        self._move(channel, writes, counts, seeks_end=seeks_end)

    def _here(self, channel: Channel) -> int:
        """Return the position; 0 without a sensor, where no movement begins anyway."""
        at, value, key = self._at(channel, "asking"), c_int64(), sa.SA_CTL_PKEY_POSITION
        call = _POSITION_CALL
        code = self._library.call(call, at.handle, channel.channel, key, byref(value), None)
        if code in (sa.SA_CTL_ERROR_NO_SENSOR_PRESENT, sa.SA_CTL_ERROR_SENSOR_DISABLED):
            return 0
        self._checked(code, f"{call}(POSITION)", at=channel)
        return value.value

    def _speed(self, channel: Channel) -> list[tuple[int, int]]:
        """Return what sets the speed of the next movement, or takes that of a line back."""
        at, index = self._at(channel, "moving"), channel.channel
        paced = index in at.paced
        if index not in at.speeds and not paced:
            return []
        if paced and index in at.begun_s:
            self.stop(channel)  # a channel under way keeps the speed that it has
        at.paced.discard(index)
        velocity, acceleration = at.speeds.get(index, (0, 0))
        writes = [
            (sa.SA_CTL_PKEY_MOVE_VELOCITY, velocity),
            (sa.SA_CTL_PKEY_MOVE_ACCELERATION, acceleration),
        ]
        if paced and index in at.frequencies:
            writes.append((sa.SA_CTL_PKEY_MAX_CL_FREQUENCY, at.frequencies[index]))
        return writes

    def _move(
        self, channel: Channel, writes: Writes, value: int, *, seeks_end: bool = False
    ) -> None:
        self._write(channel, writes)
        at = self._at(channel, "SA_CTL_Move")
        if seeks_end:
            at.seeks_end.add(channel.channel)
        else:
            at.seeks_end.discard(channel.channel)
        self._send(channel, "SA_CTL_Move", value)

    def _send(self, channel: Channel, call: str, *args: int) -> None:
        at = self._at(channel, call)
        at.begun_s[channel.channel] = WALL.now_s()
        code = self._library.call(call, at.handle, channel.channel, *args, 0)
        if logger.isEnabledFor(logging.DEBUG):
            logger.debug("%s at %s%s answered %#x", call, channel, args, code)
        self._checked(code, f"{call}{args}", at=channel)

    def _write(self, channel: Channel, writes: Writes) -> None:
        """Write properties one behind the other, then wait until all are acknowledged.

        Each is waited for, whatever became of those before: the library keeps the number of a
        request until its answer is fetched, and has 240 of them.
        """
        at = self._at(channel, "writing")
        codes: list[tuple[int, str]] = []
        numbers: list[tuple[int, int]] = []
        for key, value in writes:
            number = c_uint8()
            kind = "i64" if key in _LONG else "i32"
            call = f"SA_CTL_RequestWriteProperty_{kind}"
            code = self._library.call(
                call, at.handle, channel.channel, key, value, byref(number), 0
            )
            if code != sa.SA_CTL_ERROR_NONE:
                codes.append((code, f"{call}({key:#010x}, {value})"))
                break
            numbers.append((number.value, key))
        for asked, key in numbers:
            code = self._library.call("SA_CTL_WaitForWrite", at.handle, asked)
            codes.append((code, f"writing {key:#010x}"))
        for code, call in codes:
            self._checked(code, call, at=channel)

    # Where

    def _device(self, index: int) -> _Device:
        return open_device(self._devices, index, _NOT_OPEN)

    def _at(self, channel: Channel, call: str) -> _Device:
        """Return the device of a channel; ctypes would wrap an index that does not fit 8 bit."""
        return device_of(self._devices, channel, lambda device: device.channels, _NOT_OPEN, call)

    def _checked(
        self, code: int, call: str, *, device: int | None = None, at: Channel | None = None
    ) -> None:
        if code == sa.SA_CTL_ERROR_NONE:
            return
        index = at.device if at is not None else device
        known = index is not None and 0 <= index < len(self._devices)
        serial = self._devices[index].serial if known and index is not None else None
        channel = None if at is None else at.channel
        raise result_error(code, call, device=index, channel=channel, serial=serial)


def _make(_options: NoOptions, context: ControllerContext) -> Controller:
    # A locator names a device that is not found by itself.
    locators = [each for each in context.serials if isinstance(each, str) and ":" in each]
    return SmaractCtlController(load_library(context.library), locators=locators)


BACKEND: Final = ControllerBackend(_make)
