"""A stand-in for NI's C library, loaded under the real Python package `nidaqmx`.

It answers like C: status codes, buffers that it fills, sizes when asked with no buffer, callbacks
called by address. One board, Dev1, with four inputs; a read fills each row with the number of the
input times 0.1 V. It has only the functions that an analogue input task needs; any other call ends
in the package's own error for a function that the driver lacks.
"""

import ctypes
import threading
from collections.abc import Callable
from ctypes import c_char_p, c_double, c_int, c_int32, c_uint, c_void_p

# Attribute numbers of NIDAQmx.h.
TASK_NAME, SAMPLE_RATE, BUFFER_SIZE = 0x1276, 0x1344, 0x186C
AVAILABLE, ACQUIRED = 0x1223, 0x192A
SYSTEM_DEVICES, MAJOR, MINOR, UPDATE = 0x193B, 0x1272, 0x1923, 0x2F22
INPUTS, RANGES, PRODUCT, SIMULATED, SERIAL = 0x231E, 0x2990, 0x0631, 0x22CA, 0x0632
SINGLE_RATE, MULTI_RATE, TERMINALS = 0x298C, 0x298D, 0x2342
RSE_NRSE_DIFF = 0b111
TOO_SMALL = -200228


class FakeLibrary:
    """What `ctypes.CDLL` would give.

    Attributes
    ----------
    calls : list of tuple
        Name and plain arguments of each call.
    statuses : dict
        Status that a function answers instead of doing anything.
    answers : list of int
        What callbacks returned.
    """

    def __init__(self) -> None:
        self.calls: list[tuple[object, ...]] = []
        self.statuses: dict[str, int] = {}
        self.answers: list[int] = []
        self.channels: list[int] = []
        self.rate_hz, self.buffer, self.every, self.on_samples = 0.0, 0, 0, 0
        self.taken = self.read = self.tasks = 0
        self._thunks: list[object] = []
        for name, (types, answer) in self._functions().items():
            setattr(self, name, self._exported(name, types, answer))

    def names(self) -> list[str]:
        return [str(call[0]) for call in self.calls]

    def take(self, samples: int) -> None:
        """Take samples and call back on a thread of the driver, as its C code would."""
        self.taken += samples
        prototype = ctypes.CFUNCTYPE(c_int32, c_void_p, c_int, c_uint, c_void_p)
        callback = prototype(self.on_samples)
        thread = threading.Thread(
            target=lambda: self.answers.append(callback(1, 1, self.every, None))
        )
        thread.start()
        thread.join(20.0)

    def _functions(self) -> dict[str, tuple[list[type], Callable[..., int]]]:
        h, s, out = c_void_p, c_char_p, c_void_p
        return {
            "DAQmxGetSystemInfoAttribute": ([c_int32, out, c_uint], self._system),
            "DAQmxGetDeviceAttribute": ([s, c_int32, out, c_uint], self._device),
            "DAQmxGetPhysicalChanAttribute": ([s, c_int32, out], self._physical),
            "DAQmxGetExtendedErrorInfo": (
                [out, c_uint],
                lambda to, _: self._text(to, 99, b"In words."),
            ),
            "DAQmxCreateTask": ([s, out], self._create),
            "DAQmxGetTaskAttribute": (
                [h, c_int32, out, c_uint],
                lambda _, __, to, size: self._text(to, size, b"_unnamedTask<0>"),
            ),
            "DAQmxCreateAIVoltageChan": (
                [h, s, s, c_int, c_double, c_double, c_int, s],
                self._channel,
            ),
            "DAQmxCfgSampClkTiming": (
                [h, s, c_double, c_int, c_int, ctypes.c_uint64],
                self._timing,
            ),
            "DAQmxSetBufferAttribute": ([h, c_int32, c_uint], self._set_buffer),
            "DAQmxRegisterEveryNSamplesEvent": (
                [h, c_int, c_uint, c_uint, c_void_p, c_void_p],
                self._register,
            ),
            "DAQmxRegisterDoneEvent": ([h, c_uint, c_void_p, c_void_p], lambda *_: 0),
            "DAQmxTaskControl": ([h, c_int], lambda *_: 0),
            "DAQmxGetTimingAttribute": (
                [h, c_int32, out],
                lambda _, __, to: self._put(c_double, to, self.rate_hz),
            ),
            "DAQmxGetReadAttribute": ([h, c_int32, out], self._read_attribute),
            "DAQmxReadAnalogF64": (
                [h, c_int, c_double, c_int, c_void_p, c_uint, out, c_void_p],
                self._read,
            ),
            "DAQmxStartTask": ([h], lambda _: 0),
            "DAQmxStopTask": ([h], lambda _: 0),
            "DAQmxIsTaskDone": ([h, out], lambda _, to: self._put(c_uint, to, 0)),
            "DAQmxClearTask": ([h], self._clear),
        }

    def _exported(self, name: str, types: list[type], answer: Callable[..., int]) -> object:
        def entry(*args: object) -> int:
            self.calls.append((name, *args))
            return self.statuses[name] if name in self.statuses else answer(*args)

        thunk = ctypes.CFUNCTYPE(c_int32, *types)(entry)
        self._thunks.append(thunk)
        address = ctypes.cast(thunk, c_void_p).value
        assert address is not None
        # By address and without prototype, as a function found in a shared library is.
        return _Found(address)

    @staticmethod
    def _put(kind: type, to: int, value: float) -> int:
        ctypes.cast(to, ctypes.POINTER(kind))[0] = value
        return 0

    @staticmethod
    def _text(to: int | None, size: int, text: bytes) -> int:
        if not size:
            return len(text) + 1
        if size < len(text) + 1:
            return TOO_SMALL
        ctypes.memmove(to or 0, text + b"\0", len(text) + 1)
        return 0

    def _system(self, attribute: int, to: int, size: int) -> int:
        if attribute == SYSTEM_DEVICES:
            return self._text(to, size, b"Dev1")
        return self._put(c_uint, to, {MAJOR: 26, MINOR: 8, UPDATE: 0}[attribute])

    def _device(self, name: bytes, attribute: int, to: int, size: int) -> int:
        assert name == b"Dev1"
        texts = {INPUTS: b"Dev1/ai0, Dev1/ai1, Dev1/ai2, Dev1/ai3", PRODUCT: b"PCI-6229"}
        if attribute in texts:
            return self._text(to, size, texts[attribute])
        if attribute == RANGES:
            values = (-1.0, 1.0, -10.0, 10.0)
            if size:
                ctypes.memmove(to, (c_double * 4)(*values), 32)
            return 0 if size else len(values)
        if attribute in (SINGLE_RATE, MULTI_RATE):
            return self._put(c_double, to, 250e3)
        return self._put(c_uint, to, {SIMULATED: 0, SERIAL: 4711}[attribute])

    def _physical(self, name: bytes, attribute: int, to: int) -> int:
        assert name.startswith(b"Dev1/ai") and attribute == TERMINALS
        return self._put(c_int32, to, RSE_NRSE_DIFF)

    def _create(self, _name: bytes, handle: int) -> int:
        self.tasks += 1
        self.channels = []
        self.taken = self.read = 0
        ctypes.cast(handle, ctypes.POINTER(c_void_p))[0] = 1
        return 0

    def _clear(self, _handle: int) -> int:
        self.tasks -= 1
        return 0

    def _channel(self, _handle: int, physical: bytes, *_: object) -> int:
        self.channels.append(int(physical.partition(b"/ai")[2]))
        return 0

    def _timing(self, _handle: int, _source: bytes, rate: float, *_: object) -> int:
        self.rate_hz = rate + 0.5
        return 0

    def _set_buffer(self, _handle: int, attribute: int, value: int) -> int:
        assert attribute == BUFFER_SIZE
        self.buffer = value
        return 0

    def _register(
        self, _handle: int, kind: int, every: int, _options: int, callback: int, _data: object
    ) -> int:
        assert kind == 1
        self.every, self.on_samples = every, callback
        return 0

    def _read_attribute(self, _handle: int, attribute: int, to: int) -> int:
        if attribute == ACQUIRED:
            return self._put(ctypes.c_uint64, to, self.taken)
        assert attribute == AVAILABLE
        return self._put(c_uint, to, self.taken - self.read)

    def _read(
        self, _handle: int, count: int, _timeout: float, fill: int, to: int, size: int, *rest: int
    ) -> int:
        assert fill == 0 and size == count * len(self.channels), "by channel, and of that size"
        values = ctypes.cast(to, ctypes.POINTER(c_double))
        for row, number in enumerate(self.channels):
            for sample in range(count):
                values[row * count + sample] = 0.1 * number
        self.read += count
        return self._put(c_int, rest[0], count)


class _Found(ctypes._CFuncPtr):  # type: ignore[name-defined,misc]
    _flags_ = 1  # cdecl
    _restype_ = c_int32
