"""A stand-in for SCU3DControl that answers like C: status codes, packets, no exceptions.

It has no physics and no time: a movement is over when its call returns. It shares no code and no
constants with the simulator or with CoSMic's binding, so that it can contradict both. Signatures
were written down a second time from the vendor's header.
"""

import ctypes
from collections import deque
from collections.abc import Callable
from ctypes import c_int32, c_uint32, c_void_p
from dataclasses import dataclass

UINT_OUT = ctypes.POINTER(c_uint32)

OK, NOT_INITIALIZED, NO_DEVICES, BAD_DEVICE, BAD_CHANNEL = 0, 2, 3, 5, 6
BAD_PARAMETER, WRONG_MODE, LIST_TOO_SMALL, ALREADY_ADDED, NOT_FOUND = 9, 13, 17, 18, 19
NO_SENSOR, WRONG_TYPE, OVERRIDDEN = 130, 131, 133
NOTHING, ERROR, POSITION, ANGLE, COMPLETED, STATUS = 0, 1, 2, 3, 4, 5
SENSOR_TYPE, SENSOR_PRESENT, SAFE_DIRECTION, SCALE, KNOWN = 7, 8, 11, 12, 13
STOPPED, HOLDING = 0, 4
LINEAR_TYPE, ROTARY_TYPE, NO_TYPE = 21, 19, 0


class FakePacket(ctypes.Structure):
    _fields_ = (
        *((name, c_uint32) for name in ("kind", "channel", "data1")),
        *((name, c_int32) for name in ("data2", "data3")),
    )


@dataclass
class FakeChannel:
    type_code: int
    position: int = 0
    activity: int = STOPPED
    reports: bool = False
    known: bool = False
    offset_nm: int = 0
    inverted: int = 0


class FakeScu3d:
    """The library object: each `SA_...` attribute is a C function pointer.

    Parameters
    ----------
    devices : dict
        For each serial number the type codes of its channels.
    without : tuple of str
        Functions this version of the library lacks.

    Attributes
    ----------
    calls : list of tuple
        Name and integer arguments of each call, in order.
    statuses : dict
        Status that a function answers instead of doing anything; tests write it.
    """

    def __init__(self, devices: dict[int, list[int]], *, without: tuple[str, ...] = ()) -> None:
        self.devices = devices
        self.calls: list[tuple[object, ...]] = []
        self.statuses: dict[str, int] = {}
        self.chosen: list[int] = []
        self.mode: int | None = None
        self.opened: list[list[FakeChannel]] = []
        self.packets: list[deque[tuple[int, int, int, int, int]]] = []
        self._publish(without)

    def push(
        self, device: int, kind: int, channel: int, data1: int = 0, data2: int = 0, data3: int = 0
    ) -> None:
        """Put a packet at the end of the queue of `device`."""
        self.packets[device].append((kind, channel, data1, data2, data3))

    def called(self, name: str) -> list[tuple[object, ...]]:
        """Return the arguments of each call of `name`."""
        return [call[1:] for call in self.calls if call[0] == name]

    def _publish(self, without: tuple[str, ...]) -> None:
        for name, (types, answer) in {**self._general(), **self._commands()}.items():
            if name not in without:
                setattr(self, name, self._pointer(name, types, answer))

    def _pointer(self, name: str, types: list[type], answer: Callable[..., int]) -> object:
        def entry(*args: object) -> int:
            self.calls.append((name, *(arg for arg in args if isinstance(arg, int))))
            return self.statuses[name] if name in self.statuses else answer(*args)

        return ctypes.CFUNCTYPE(c_uint32, *types)(entry)

    def _general(self) -> dict[str, tuple[list[type], Callable[..., int]]]:
        u, out = c_uint32, UINT_OUT
        return {
            "SA_GetDLLVersion": ([out], lambda to: self._write(to, 0x01050010)),
            "SA_GetAvailableDevices": ([out, out], self._available),
            "SA_AddDeviceToInitDevicesList": ([u], self._add),
            "SA_ClearInitDevicesList": ([], self._clear),
            "SA_InitDevices": ([u], self._init),
            "SA_ReleaseDevices": ([], self._release),
            "SA_GetNumberOfDevices": ([out], lambda to: self._write(to, len(self.opened))),
            "SA_GetDeviceID": ([u, out], lambda d, to: self._write(to, self.chosen[d])),
            "SA_GetDeviceFirmwareVersion": ([u, out], lambda d, to: self._write(to, 0x02020005)),
            # The packet is a plain address here, so that its layout is really checked.
            "SA_ReceiveNextPacket_A": ([u, u, c_void_p], self._receive),
        }

    def _commands(self) -> dict[str, tuple[list[type], Callable[..., int]]]:
        u, i = c_uint32, c_int32
        table: dict[str, tuple[list[type], Callable[..., int]]] = {
            "SA_SetReportOnComplete_A": ([u], self._report),
            "SA_GetSensorPresent_A": ([], self._sensor_present),
            "SA_GetScale_A": ([], self._get_scale),
            "SA_GetSensorType_A": ([], self._sensor_type),
            "SA_GetPhysicalPositionKnown_A": ([], self._position_known),
            "SA_GetSafeDirection_A": ([], self._get_safe_direction),
            "SA_GetPosition_A": ([], self._get_position),
            "SA_GetAngle_A": ([], self._get_angle),
            "SA_GetStatus_A": ([], self._get_status),
            "SA_SetClosedLoopMaxFrequency_A": ([u], lambda d, c, hz: OK),
            "SA_MoveStep_A": ([i, u, u], self._step),
            "SA_MovePositionAbsolute_A": ([i, u], self._position_absolute),
            "SA_MovePositionRelative_A": ([i, u], self._position_relative),
            "SA_MoveAngleAbsolute_A": ([i, i, u], self._angle_absolute),
            "SA_MoveAngleRelative_A": ([i, i, u], self._angle_relative),
            "SA_CalibrateSensor_A": ([], lambda d, c: self._moved(d, c, hold=0)),
            "SA_MoveToReference_A": ([u, u], self._reference),
            "SA_MoveToEndStop_A": ([u, u, u], self._end_stop),
            "SA_Stop_A": ([], self._stop),
        }
        return {
            name: ([u, u, *types], self._addressed(answer))
            for name, (types, answer) in table.items()
        }

    def _addressed(self, answer: Callable[..., int]) -> Callable[..., int]:
        def checked(device: int, channel: int, *args: int) -> int:
            if self.mode is None:
                return NOT_INITIALIZED
            if self.mode != 1:
                return WRONG_MODE
            if device >= len(self.opened):
                return BAD_DEVICE
            if channel >= len(self.opened[device]):
                return BAD_CHANNEL
            return answer(device, channel, *args)

        return checked

    @staticmethod
    def _write(to: "ctypes._Pointer[c_uint32]", value: int) -> int:
        to[0] = value
        return OK

    def _available(
        self, ids: "ctypes._Pointer[c_uint32]", size: "ctypes._Pointer[c_uint32]"
    ) -> int:
        if len(self.devices) > size[0]:
            return LIST_TOO_SMALL
        for index, serial in enumerate(self.devices):
            ids[index] = serial
        size[0] = len(self.devices)
        return OK

    def _add(self, serial: int) -> int:
        if serial in self.chosen:
            return ALREADY_ADDED
        self.chosen.append(serial)
        return OK

    def _clear(self) -> int:
        self.chosen = []
        return OK

    def _init(self, configuration: int) -> int:
        self.chosen = self.chosen or list(self.devices)
        if not self.chosen:
            return NO_DEVICES
        if any(serial not in self.devices for serial in self.chosen):
            return NOT_FOUND
        self.opened = [[FakeChannel(code) for code in self.devices[s]] for s in self.chosen]
        self.packets = [deque() for _ in self.opened]
        self.mode = configuration & 1
        return OK

    def _release(self) -> int:
        if self.mode is None:
            return NOT_INITIALIZED
        self.mode, self.opened, self.packets = None, [], []
        return OK

    def _receive(self, device: int, timeout: int, address: int) -> int:
        if self.mode is None:
            return NOT_INITIALIZED
        if device >= len(self.opened):
            return BAD_DEVICE
        packet = FakePacket.from_address(address)
        queue = self.packets[device]
        values = queue.popleft() if queue else (NOTHING, 0, 0, 0, 0)
        packet.kind, packet.channel, packet.data1, packet.data2, packet.data3 = values
        return OK

    def _moved(self, device: int, channel: int, *, hold: int) -> int:
        if not self._type(device, channel):
            return self._error(device, channel, NO_SENSOR)
        moved = self.opened[device][channel]
        moved.activity = HOLDING if hold else STOPPED
        if moved.reports:
            self.push(device, COMPLETED, channel)
        return OK

    def _type(self, device: int, channel: int) -> int:
        return self.opened[device][channel].type_code

    def _error(self, device: int, channel: int, code: int) -> int:
        self.push(device, ERROR, channel, code)
        return OK

    def _report(self, device: int, channel: int, report: int) -> int:
        self.opened[device][channel].reports = report == 1
        return OK

    def _sensor_present(self, device: int, channel: int) -> int:
        self.push(device, SENSOR_PRESENT, channel, int(self._type(device, channel) != NO_TYPE))
        return OK

    def _get_scale(self, device: int, channel: int) -> int:
        found = self.opened[device][channel]
        self.push(device, SCALE, channel, found.inverted, found.offset_nm)
        return OK

    def _sensor_type(self, device: int, channel: int) -> int:
        self.push(device, SENSOR_TYPE, channel, self._type(device, channel))
        return OK

    def _position_known(self, device: int, channel: int) -> int:
        self.push(device, KNOWN, channel, int(self.opened[device][channel].known))
        return OK

    def _get_safe_direction(self, device: int, channel: int) -> int:
        self.push(device, SAFE_DIRECTION, channel, 0)
        return OK

    def _get_status(self, device: int, channel: int) -> int:
        self.push(device, STATUS, channel, self.opened[device][channel].activity)
        return OK

    def _expect(self, device: int, channel: int, type_code: int) -> int:
        """Return 0 when the channel is of that type; else push the error and return its code."""
        found = self._type(device, channel)
        if found == type_code:
            return OK
        code = NO_SENSOR if found == NO_TYPE else WRONG_TYPE
        self._error(device, channel, code)
        return code

    def _get_position(self, device: int, channel: int) -> int:
        if not self._expect(device, channel, LINEAR_TYPE):
            self.push(device, POSITION, channel, 0, self.opened[device][channel].position)
        return OK

    def _get_angle(self, device: int, channel: int) -> int:
        if not self._expect(device, channel, ROTARY_TYPE):
            position = self.opened[device][channel].position
            self.push(device, ANGLE, channel, position & 0xFFFFFFFF, 0)
        return OK

    def _go(self, device: int, channel: int, type_code: int, target: int, hold: int) -> int:
        if self._expect(device, channel, type_code):
            return OK
        self.opened[device][channel].position = target
        return self._moved(device, channel, hold=hold)

    def _position_absolute(self, device: int, channel: int, target: int, hold: int) -> int:
        if hold > 60000:
            return BAD_PARAMETER
        return self._go(device, channel, LINEAR_TYPE, target, hold)

    def _position_relative(self, device: int, channel: int, diff: int, hold: int) -> int:
        target = self.opened[device][channel].position + diff
        return self._position_absolute(device, channel, target, hold)

    def _angle_absolute(
        self, device: int, channel: int, target: int, revolution: int, hold: int
    ) -> int:
        if hold > 60000 or revolution:
            return BAD_PARAMETER
        return self._go(device, channel, ROTARY_TYPE, target, hold)

    def _angle_relative(
        self, device: int, channel: int, diff: int, revolution: int, hold: int
    ) -> int:
        target = self.opened[device][channel].position + diff
        return self._angle_absolute(device, channel, target, revolution, hold)

    def _step(self, device: int, channel: int, steps: int, amplitude: int, hz: int) -> int:
        if not (abs(steps) <= 30000 and 150 <= amplitude <= 1000 and 1 <= hz <= 18500):
            return BAD_PARAMETER
        moved = self.opened[device][channel]
        moved.position += 15 * steps
        if moved.reports:
            self.push(device, COMPLETED, channel)
        return OK

    def _reference(self, device: int, channel: int, hold: int, auto_zero: int) -> int:
        self.opened[device][channel].known = self._type(device, channel) != NO_TYPE
        return self._moved(device, channel, hold=hold)

    def _end_stop(self, device: int, channel: int, direction: int, hold: int, zero: int) -> int:
        if direction > 1:
            return BAD_PARAMETER
        self.opened[device][channel].position = 60000 if direction else -60000
        return self._moved(device, channel, hold=hold)

    def _stop(self, device: int, channel: int) -> int:
        self.opened[device][channel].activity = STOPPED
        return OK
