"""Calls of libdc1394, with its status codes as exceptions."""

import logging
from ctypes import byref, c_float, c_int, c_uint32
from typing import Any, Final

from cosmic.frame.errors import ConfigError, DeviceError, DeviceFault
from cosmic.vico.hw import dc1394_ctypes as dc

logger = logging.getLogger(__name__)

_FAULTS: Final = {
    dc.DC1394_FAILURE: DeviceFault.COMMUNICATION,
    dc.DC1394_IOCTL_FAILURE: DeviceFault.COMMUNICATION,
    dc.DC1394_FUNCTION_NOT_SUPPORTED: DeviceFault.UNSUPPORTED,
    dc.DC1394_NO_ISO_CHANNEL: DeviceFault.STATE,
    dc.DC1394_NO_BANDWIDTH: DeviceFault.STATE,
    dc.DC1394_FORMAT7_ERROR_FLAG_1: DeviceFault.PARAMETER,
    dc.DC1394_FORMAT7_ERROR_FLAG_2: DeviceFault.PARAMETER,
    dc.DC1394_INVALID_ARGUMENT_VALUE: DeviceFault.PARAMETER,
    dc.DC1394_REQ_VALUE_OUTSIDE_RANGE: DeviceFault.PARAMETER,
    dc.DC1394_INVALID_FEATURE: DeviceFault.UNSUPPORTED,
    dc.DC1394_INVALID_FRAMERATE: DeviceFault.PARAMETER,
    dc.DC1394_INVALID_COLOR_CODING: DeviceFault.PARAMETER,
}
_ADVICE: Final = {
    dc.DC1394_NO_ISO_CHANNEL: "another program may have it; a reset of the bus frees channels",
    dc.DC1394_NO_BANDWIDTH: "the bus is full: lower the rate or the size, or stop another camera",
}


class Dc1394Calls:
    """The functions of one libdc1394.

    Parameters
    ----------
    library : ctypes.CDLL or object
        The loaded library, or an object with the same functions.
    """

    def __init__(self, library: object) -> None:
        self._functions = dc.bind(library)

    def plain(self, name: str, *args: object) -> Any:
        """Call what answers with something other than a status."""
        return self._functions[name](*args)

    def checked(self, whom: str, name: str, *args: object) -> None:
        """Call what answers with a status; `whom` names the camera in the text.

        Raises
        ------
        DeviceError
            What the library said.
        """
        status = int(self._functions[name](*args))
        if logger.isEnabledFor(logging.DEBUG):
            logger.debug("%s: %s%s = %d", whom, name, args[1:], status)
        if status != dc.DC1394_SUCCESS:
            raise self.error(f"{whom}: {name}", status)

    def error(self, where: str, status: int) -> DeviceError:
        """Return the exception for a status other than success."""
        text = (self.plain("dc1394_error_get_string", status) or b"no text").decode()
        advice = f"; {_ADVICE[status]}" if status in _ADVICE else ""
        fault = _FAULTS.get(status, DeviceFault.OTHER)
        return DeviceError(f"{where}: {text} ({status}){advice}", fault=fault, code=status)


class Dc1394Handle:
    """One open dc1394camera_t: calls with the camera filled in, numbers instead of pointers."""

    def __init__(self, calls: Dc1394Calls, pointer: Any, whom: str) -> None:
        self.calls = calls
        self.pointer = pointer
        self.whom = whom

    def call(self, name: str, *args: object) -> None:
        """Call what answers with a status; raises `DeviceError`."""
        self.calls.checked(self.whom, name, self.pointer, *args)

    def integer(self, name: str, *args: object) -> int:
        """Return the one signed number, switch or enumeration that a function fills in."""
        answer = c_int()
        self.call(name, *args, byref(answer))
        return answer.value

    def numbers(self, name: str, *args: object, count: int = 1) -> tuple[int, ...]:
        """Return the unsigned numbers that a function fills in."""
        answers = [c_uint32() for _ in range(count)]
        self.call(name, *args, *(byref(each) for each in answers))
        return tuple(each.value for each in answers)

    def floats(self, name: str, *args: object, count: int = 1) -> tuple[float, ...]:
        """Return the numbers with a fraction that a function fills in."""
        answers = [c_float() for _ in range(count)]
        self.call(name, *args, *(byref(each) for each in answers))
        return tuple(each.value for each in answers)


def as_refusal(error: DeviceError) -> DeviceError | ConfigError:
    """Return what a failed setting means: a value not accepted, or a camera that fails."""
    if error.fault in (DeviceFault.PARAMETER, DeviceFault.UNSUPPORTED):
        return ConfigError(str(error))
    return error
