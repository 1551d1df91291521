"""SmarAct's SCU through the library SCU3DControl, in its asynchronous mode."""

import logging
import threading
from collections.abc import Sequence
from ctypes import byref, c_uint32
from typing import Final

from typing_extensions import override

from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.frame.plugins import NoOptions
from cosmic.frame.units import AxisUnit
from cosmic.mico.hw import scu3d_convert as convert
from cosmic.mico.hw import scu3d_ctypes as sa
from cosmic.mico.hw.addresses import no_channel
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
from cosmic.mico.hw.scu3d_errors import nothing_found, require_serials, status_error
from cosmic.mico.hw.scu3d_events import event_from_packet
from cosmic.mico.hw.smaract_load import load_library

logger = logging.getLogger(__name__)

_DIRECTIONS: Final = {
    Direction.BACKWARD: sa.SA_BACKWARD_DIRECTION,
    Direction.FORWARD: sa.SA_FORWARD_DIRECTION,
}
_MOVES: Final = {
    ("um", "to"): "SA_MovePositionAbsolute_A",
    ("um", "by"): "SA_MovePositionRelative_A",
    ("deg", "to"): "SA_MoveAngleAbsolute_A",
    ("deg", "by"): "SA_MoveAngleRelative_A",
}
_FIRST_LIST_SIZE: Final = 16
_LARGEST_LIST_SIZE: Final = 4096
_INDEX_MAX: Final = 2**32 - 1
_INVERTED: Final = 1


class Scu3dController(Controller):
    """The SCUs that one SCU3DControl library drives, real or simulated.

    Parameters
    ----------
    library : ctypes.CDLL or object
        The loaded library, or an object with the same `SA_...` function pointers.
    simulated : bool
        True when `library` moves nothing real.

    Notes
    -----
    Thread-safe as far as the library is: SmarAct says so for the sister product MCS and does not
    deny it for the SCU. Commands take no lock here. Distances are rounded to 0.1 um or 0.1
    millidegree, the library's own step. The stored zero of the controller is never touched.
    """

    def __init__(self, library: object, *, simulated: bool = False) -> None:
        self._library = sa.Scu3dLibrary(library)
        self._simulated = simulated
        self._lifecycle = threading.Lock()
        self._opened = False
        self._serials: dict[int, Serial] = {}
        self._inverted: set[Channel] = set()
        self._position_known = self._library.has("SA_GetPhysicalPositionKnown_A")
        self._knows_scale = self._library.has("SA_GetScale_A")
        self._library.has("SA_Stop_A")  # bound now, so that the first stop is not the slowest

    @property
    @override
    def name(self) -> str:
        version = c_uint32()
        status = self._library.call("SA_GetDLLVersion", byref(version))
        text = convert.version_text(version.value) if status == sa.SA_OK else "of unknown version"
        return f"SCU3DControl {text}{' (simulated)' if self._simulated else ''}"

    @property
    @override
    def simulated(self) -> bool:
        return self._simulated

    @property
    @override
    def capabilities(self) -> Capabilities:
        return Capabilities(
            group_start=False,
            velocity=False,
            position_known=self._position_known,
            keeps_interpreter=self._library.keeps_interpreter,
        )

    @override
    def find_devices(self) -> tuple[Serial, ...]:
        size = _FIRST_LIST_SIZE
        while True:
            serials, count = (c_uint32 * size)(), c_uint32(size)
            status = self._library.call("SA_GetAvailableDevices", serials, byref(count))
            if status == sa.SA_NO_DEVICES_FOUND_ERROR:
                return ()
            if status != sa.SA_ID_LIST_TOO_SMALL_ERROR or size >= _LARGEST_LIST_SIZE:
                break
            size *= 2
        self._checked(status, "SA_GetAvailableDevices")
        return tuple(serials[: min(count.value, size)])

    @override
    def open(self, serials: Sequence[Serial] = ()) -> tuple[DeviceIdentity, ...]:
        with self._lifecycle:
            if self._opened:
                raise DeviceError("SCU3DControl is open already", fault=DeviceFault.STATE)
            self._select(convert.serial_numbers(serials))
            self._call("SA_InitDevices", sa.SA_ASYNCHRONOUS_COMMUNICATION)
            try:
                devices = self._identify()
                if not devices:
                    raise nothing_found("SA_GetNumberOfDevices()")
                require_serials(serials, [device.serial for device in devices])
            except DeviceError:
                self._release()
                raise
            self._serials = {device.index: device.serial for device in devices}
            self._inverted.clear()
            self._opened = True
        logger.info("%s opened with devices %s", self.name, [d.serial for d in devices])
        return devices

    @override
    def close(self) -> None:
        with self._lifecycle:
            if self._opened:
                self._opened = False
                self._release()

    @override
    def receive(self, device: int, timeout_s: float) -> Event | None:
        packet = sa.SA_PACKET()
        index, wait_ms = convert.index(device, "device"), convert.timeout_ms(timeout_s)
        status = self._library.call("SA_ReceiveNextPacket_A", index, wait_ms, byref(packet))
        if status != sa.SA_OK:
            self._checked(status, "SA_ReceiveNextPacket_A", device=device)
        event = event_from_packet(device, packet, serial=self._serials.get(device))
        if packet.packetType == sa.SA_SCALE_PACKET_TYPE:
            self._learn_scale(Channel(device, packet.channelIndex), packet.data1)
            return None  # asked for with the type, whose answer comes next
        if isinstance(event, TypeRead) and event.channel in self._inverted:
            event = TypeRead(event.channel, event.positioner.counted_backwards())
        if event is not None and logger.isEnabledFor(logging.DEBUG):
            logger.debug("device %d: %s", device, event)
        return event

    @override
    def report_completion(self, channel: Channel) -> None:
        self._send(channel, "SA_SetReportOnComplete_A", sa.SA_REPORT_ON_COMPLETE)

    @override
    def ask_sensor_present(self, channel: Channel) -> None:
        self._send(channel, "SA_GetSensorPresent_A")

    @override
    def ask_type(self, channel: Channel) -> None:
        if self._knows_scale:  # its answer comes before the other one
            self._send(channel, "SA_GetScale_A")
        self._send(channel, "SA_GetSensorType_A")

    @override
    def ask_position_known(self, channel: Channel) -> None:
        self._send(channel, "SA_GetPhysicalPositionKnown_A")

    @override
    def ask_safe_direction(self, channel: Channel) -> None:
        self._send(channel, "SA_GetSafeDirection_A")

    @override
    def ask_position(self, channel: Channel, unit: AxisUnit) -> None:
        self._send(channel, "SA_GetPosition_A" if unit == "um" else "SA_GetAngle_A")

    @override
    def ask_activity(self, channel: Channel) -> None:
        self._send(channel, "SA_GetStatus_A")

    @override
    def set_closed_loop_frequency(self, channel: Channel, frequency_hz: int) -> None:
        frequency = convert.frequency(frequency_hz, channel)
        self._send(channel, "SA_SetClosedLoopMaxFrequency_A", frequency)

    @override
    def step(self, channel: Channel, steps: int, *, amplitude_v: float, frequency_hz: int) -> None:
        self._send(
            channel,
            "SA_MoveStep_A",
            convert.step_count(steps, channel),
            convert.decivolts(amplitude_v, channel),
            convert.frequency(frequency_hz, channel),
        )

    @override
    def move_to(self, channel: Channel, target: float, unit: AxisUnit, *, hold_s: float) -> None:
        self._move(channel, _MOVES[unit, "to"], target, unit, hold_s=hold_s)

    @override
    def move_by(self, channel: Channel, distance: float, unit: AxisUnit, *, hold_s: float) -> None:
        self._move(channel, _MOVES[unit, "by"], distance, unit, hold_s=hold_s)

    @override
    def calibrate(self, channel: Channel) -> None:
        self._send(channel, "SA_CalibrateSensor_A")

    @override
    def reference(self, channel: Channel, *, hold_s: float) -> None:
        hold_ms = convert.hold_ms(hold_s, channel)
        self._send(channel, "SA_MoveToReference_A", hold_ms, sa.SA_NO_AUTO_ZERO)

    @override
    def move_to_end_stop(self, channel: Channel, direction: Direction, *, hold_s: float) -> None:
        hold_ms = convert.hold_ms(hold_s, channel)
        self._send(
            channel, "SA_MoveToEndStop_A", _DIRECTIONS[direction], hold_ms, sa.SA_NO_AUTO_ZERO
        )

    @override
    def set_sensor_type(self, channel: Channel, code: int) -> None:
        self._send(channel, "SA_SetSensorType_A", convert.index(code, "sensor type"))

    @override
    def set_safe_direction(self, channel: Channel, direction: Direction) -> None:
        self._send(channel, "SA_SetSafeDirection_A", _DIRECTIONS[direction])

    @override
    def stop(self, channel: Channel) -> None:
        self._send(channel, "SA_Stop_A")

    def _learn_scale(self, at: Channel, inverted: int) -> None:
        # That the inversion is data1 stands in the manual of the sister product: only 1 counts.
        (self._inverted.add if inverted == _INVERTED else self._inverted.discard)(at)

    def _move(
        self, channel: Channel, call: str, value: float, unit: AxisUnit, *, hold_s: float
    ) -> None:
        counts = convert.position_counts(value, unit, channel)
        hold_ms = convert.hold_ms(hold_s, channel)
        turns = () if unit == "um" else (0,)
        self._send(channel, call, counts, *turns, hold_ms)

    def _send(self, at: Channel, call: str, *args: int) -> None:
        # ctypes wraps what does not fit 32 bit: 2**32 + 1 would command channel 1.
        if not (0 <= at.device <= _INDEX_MAX and 0 <= at.channel <= _INDEX_MAX):
            raise no_channel(at, call)
        status = self._library.call(call, at.device, at.channel, *args)
        # The log comes after the call, so that it never delays a stop.
        if logger.isEnabledFor(logging.DEBUG):
            logger.debug("%s%s answered %d", call, (at.device, at.channel, *args), status)
        if status != sa.SA_OK:
            self._checked(status, call, *args, device=at.device, channel=at.channel)

    def _call(self, call: str, *args: int) -> None:
        status = self._library.call(call, *args)
        logger.debug("%s%s answered %d", call, args, status)
        self._checked(status, call, *args)

    def _read(self, call: str, *args: int) -> int:
        value = c_uint32()
        status = self._library.call(call, *args, byref(value))
        logger.debug("%s%s answered %d, value %d", call, args, status, value.value)
        self._checked(status, call, *args)
        return value.value

    def _checked(
        self,
        status: int,
        call: str,
        *args: int,
        device: int | None = None,
        channel: int | None = None,
    ) -> None:
        if status == sa.SA_OK:
            return
        asked = f"{call}({', '.join(map(str, args))})"
        serial = None if device is None else self._serials.get(device)
        raise status_error(status, asked, device=device, channel=channel, serial=serial)

    def _select(self, wanted: Sequence[int]) -> None:
        found = self.find_devices()
        if not found:
            raise nothing_found("SA_GetAvailableDevices()")
        require_serials(wanted, found)
        self._call("SA_ClearInitDevicesList")
        for serial in wanted:
            self._call("SA_AddDeviceToInitDevicesList", serial)

    def _identify(self) -> tuple[DeviceIdentity, ...]:
        return tuple(
            DeviceIdentity(
                index=index,
                serial=self._read("SA_GetDeviceID", index),
                firmware=convert.version_text(self._read("SA_GetDeviceFirmwareVersion", index)),
            )
            for index in range(self._read("SA_GetNumberOfDevices"))
        )

    def _release(self) -> None:
        status = self._library.call("SA_ReleaseDevices")
        if status == sa.SA_OK:
            logger.debug("SA_ReleaseDevices() answered 0")
        else:
            logger.warning("%s", status_error(status, "SA_ReleaseDevices()"))


def _make(_options: NoOptions, context: ControllerContext) -> Controller:
    return Scu3dController(load_library(context.library))


BACKEND: Final = ControllerBackend(_make)
