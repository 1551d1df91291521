"""A fake SmarActCTL: answers like C, moves at once, and shares no code with the simulator."""

import ctypes as ct
import queue
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

OK, TIMEOUT, PARAMETER, ABORTED, NO_CHANNEL = 0, 0x04, 0x13, 0x19, 0x22
NO_SENSOR, END_STOP, NOT_FOUND, BAD_HANDLE, BAD_GROUP = 0x103, 0x200, 0xF01A, 0xF007, 0xF008
REQUEST_READY, FINISHED, GROUP = 0xF000, 1, 0x8010

POSITION, STATE, TYPE, TYPE_NAME = 0x0305001D, 0x0305000F, 0x0302003C, 0x0302003D
UNIT, REFERENCE, SAFE, HOLD, MODE = 0x03090042, 0x03090048, 0x03090027, 0x03050028, 0x03050087
CHANNELS = 0x020F0017
METRE, DEGREE = 2, 3
END = {METRE: 6 * 10**9, DEGREE: 170 * 10**9}
STEP = {METRE: 10**6, DEGREE: 25 * 10**6}


class Event(ct.Structure):
    _fields_ = (
        ("idx", ct.c_uint32),
        ("type", ct.c_uint32),
        ("value", ct.c_int64),
        ("x", ct.c_int64 * 2),
    )


@dataclass
class FakeChannel:
    letter: str
    position: int = 0
    target: int = 0
    holding: bool = False
    referenced: bool = False
    written: dict[int, int] = field(default_factory=lambda: {HOLD: 0, MODE: 0, SAFE: 1})

    @property
    def unit(self) -> int:
        return DEGREE if self.letter == "R" else METRE

    @property
    def sensor(self) -> bool:
        return self.letter != "N"

    def read(self, key: int) -> tuple[int, Any]:
        if key == POSITION:
            return (OK, self.position) if self.sensor else (NO_SENSOR, 0)
        if key == STATE:
            bits = 0x20 if self.sensor else 0
            return OK, bits | (0x80 if self.referenced else 0) | (0x2 if self.holding else 0)
        fixed = {TYPE: 342, UNIT: self.unit, REFERENCE: 1, TYPE_NAME: b"SL...S1LE"}
        return OK, fixed.get(key, self.written.get(key, 0))

    def move(self, value: int) -> int:
        mode = self.written[MODE]
        if mode == 4:
            self.holding = False
            self.position += value * STEP[self.unit]
            self.target = self.position
            return OK
        if not self.sensor:
            return NO_SENSOR
        self.target = wanted = value if mode == 0 else self.target + value
        reached = max(-END[self.unit], min(END[self.unit], wanted))
        self.position = reached
        self.holding = reached == wanted and self.written[HOLD] != 0
        return OK if reached == wanted else END_STOP


class FakeDevice:
    def __init__(self, serial: str, letters: str) -> None:
        self.serial = serial
        self.channels = [FakeChannel(letter) for letter in letters]
        self.events: queue.SimpleQueue[tuple[int, int, int]] = queue.SimpleQueue()
        self.answers: dict[int, tuple[int, Any]] = {}
        self.groups: dict[int, list[tuple[int, int]]] = {}
        self.number = 0

    def request(self, answer: tuple[int, Any], *, writes: bool) -> int:
        self.number = (self.number + 1) % 240
        self.answers[self.number] = answer
        self.events.put((0, REQUEST_READY, self.number | writes << 8))
        return self.number

    def finish(self, index: int, code: int) -> None:
        self.events.put((index, FINISHED, code))


class FakeSmaractctl:
    """The functions that the controller needs; `calls` keeps what was sent, in order."""

    def __init__(self, devices: dict[str, str]) -> None:
        self.devices = [FakeDevice(serial, letters) for serial, letters in devices.items()]
        self.open: dict[int, FakeDevice] = {}
        self.next_handle = 7
        self.calls: list[tuple[Any, ...]] = []
        self.version = ct.create_string_buffer(b"1.3.31.9")

    def SA_CTL_GetFullVersionString(self) -> int:
        return ct.addressof(self.version)

    def SA_CTL_FindDevices(self, _options: bytes, text: Any, size: Any) -> int:
        found = "\n".join(f"usb:sn:{each.serial}" for each in self.devices).encode()
        text.value = found
        size._obj.value = len(found)
        return OK

    def SA_CTL_Open(self, handle: Any, locator: bytes, _config: bytes) -> int:
        for device in self.devices:
            if locator.decode() == f"usb:sn:{device.serial}":
                handle._obj.value = self.next_handle
                self.open[self.next_handle] = device
                self.next_handle += 1
                return OK
        return NOT_FOUND

    def SA_CTL_Close(self, handle: int) -> int:
        return OK if self.open.pop(handle, None) else BAD_HANDLE

    def SA_CTL_GetProperty_i32(self, handle: int, _i: int, key: int, out: Any, _n: Any) -> int:
        out._obj.value = len(self.open[handle].channels) if key == CHANNELS else 0
        return OK

    def SA_CTL_GetProperty_i64(self, handle: int, index: int, key: int, out: Any, _n: Any) -> int:
        at = self._channel(handle, index)
        if isinstance(at, int):
            return at
        code, out._obj.value = at.read(key)
        return code

    def SA_CTL_SetProperty_i32(self, *_: Any) -> int:
        return OK

    def _channel(self, handle: int, index: int) -> FakeChannel | int:
        device = self.open.get(handle)
        if device is None:
            return BAD_HANDLE
        return device.channels[index] if index < len(device.channels) else NO_CHANNEL

    def SA_CTL_RequestReadProperty(
        self, handle: int, index: int, key: int, number: Any, _t: int
    ) -> int:
        at = self._channel(handle, index)
        if isinstance(at, int):
            return at
        number._obj.value = self.open[handle].request(at.read(key), writes=False)
        return OK

    def _read(self, handle: int, number: Any) -> tuple[int, Any]:
        return self.open[handle].answers.pop(number, (PARAMETER, 0))

    def SA_CTL_ReadProperty_i32(self, handle: int, number: int, out: Any, _n: Any) -> int:
        code, out._obj.value = self._read(handle, number)
        return code

    SA_CTL_ReadProperty_i64 = SA_CTL_ReadProperty_i32

    def SA_CTL_ReadProperty_s(self, handle: int, number: int, out: Any, _n: Any) -> int:
        code, out.value = self._read(handle, number)
        return code

    def SA_CTL_CancelRequest(self, handle: int, number: int) -> int:
        self._read(handle, number)
        return OK

    def SA_CTL_RequestWriteProperty_i32(
        self, handle: int, index: int, key: int, value: int, number: Any, _t: int
    ) -> int:
        at = self._channel(handle, index)
        if isinstance(at, int):
            return at
        at.written[key] = value
        self.calls.append(("write", index, key, value))
        number._obj.value = self.open[handle].request((OK, 0), writes=True)
        return OK

    SA_CTL_RequestWriteProperty_i64 = SA_CTL_RequestWriteProperty_i32

    def SA_CTL_WaitForWrite(self, handle: int, number: int) -> int:
        return self._read(handle, number)[0]

    def _act(self, handle: int, index: int, act: Callable[[FakeChannel], int | None]) -> int:
        at = self._channel(handle, index)
        if isinstance(at, int):
            return at
        code = act(at)
        if code is not None:
            self.open[handle].finish(index, code)
        return OK

    def SA_CTL_Move(self, handle: int, index: int, value: int, group: Any) -> int:
        number = getattr(group, "value", group)
        if number:
            self.calls.append(("grouped", index, value))
            self.open[handle].groups[number].append((index, value))
            return OK
        self.calls.append(("move", index, value))
        return self._act(handle, index, lambda at: at.move(value))

    def SA_CTL_Reference(self, handle: int, index: int, _t: int) -> int:
        def act(at: FakeChannel) -> int:
            at.referenced = True
            return OK

        return self._act(handle, index, act)

    def SA_CTL_Calibrate(self, handle: int, index: int, _t: int) -> int:
        return self._act(handle, index, lambda _at: OK)

    def SA_CTL_Stop(self, handle: int, index: int, _t: int) -> int:
        def act(at: FakeChannel) -> None:
            at.holding = False

        self.calls.append(("stop", index))
        return self._act(handle, index, act)

    def SA_CTL_OpenCommandGroup(self, handle: int, out: Any, _mode: int) -> int:
        out._obj.value = 5
        self.open[handle].groups[5] = []
        return OK

    def SA_CTL_CloseCommandGroup(self, handle: int, group: Any) -> int:
        kept: Sequence[tuple[int, int]] = self.open[handle].groups.pop(group.value, [])
        self.calls.append(("group", len(kept)))
        for index, value in kept:
            self._act(handle, index, lambda at, value=value: at.move(value))
        return OK if kept else BAD_GROUP

    def SA_CTL_CancelCommandGroup(self, handle: int, group: Any) -> int:
        return OK if self.open[handle].groups.pop(group.value, None) is not None else BAD_GROUP

    def SA_CTL_WaitForEvent(self, handle: int, event: Any, wait_ms: int) -> int:
        device = self.open.get(handle)
        if device is None:
            return BAD_HANDLE
        try:
            index, kind, value = device.events.get(timeout=wait_ms / 1000)
        except queue.Empty:
            return TIMEOUT
        ct.memmove(ct.byref(event._obj), ct.byref(Event(index, kind, value)), ct.sizeof(Event))
        return OK
