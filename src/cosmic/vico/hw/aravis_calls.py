"""Calls of Aravis, with its errors as exceptions."""

import ctypes
import logging
from ctypes import POINTER, byref, c_uint
from typing import Any, Final

from cosmic.frame.errors import ConfigError, DeviceError, DeviceFault, DeviceTimeout
from cosmic.vico.hw import aravis_ctypes as arv

logger = logging.getLogger(__name__)

_FAULTS: Final = {
    arv.ARV_DEVICE_ERROR_WRONG_FEATURE: DeviceFault.UNSUPPORTED,
    arv.ARV_DEVICE_ERROR_FEATURE_NOT_FOUND: DeviceFault.UNSUPPORTED,
    arv.ARV_DEVICE_ERROR_NOT_CONNECTED: DeviceFault.COMMUNICATION,
    arv.ARV_DEVICE_ERROR_PROTOCOL_ERROR: DeviceFault.COMMUNICATION,
    arv.ARV_DEVICE_ERROR_TRANSFER_ERROR: DeviceFault.COMMUNICATION,
    arv.ARV_DEVICE_ERROR_TIMEOUT: DeviceFault.TIMEOUT,
    arv.ARV_DEVICE_ERROR_NOT_FOUND: DeviceFault.COMMUNICATION,
    arv.ARV_DEVICE_ERROR_INVALID_PARAMETER: DeviceFault.PARAMETER,
    arv.ARV_DEVICE_ERROR_GENICAM_NOT_FOUND: DeviceFault.UNSUPPORTED,
    arv.ARV_DEVICE_ERROR_NO_STREAM_CHANNEL: DeviceFault.UNSUPPORTED,
    arv.ARV_DEVICE_ERROR_NOT_CONTROLLER: DeviceFault.OVERRIDDEN,
    arv.ARV_DEVICE_ERROR_PROTOCOL_ERROR_NOT_IMPLEMENTED: DeviceFault.UNSUPPORTED,
    arv.ARV_DEVICE_ERROR_PROTOCOL_ERROR_INVALID_PARAMETER: DeviceFault.PARAMETER,
    arv.ARV_DEVICE_ERROR_PROTOCOL_ERROR_INVALID_ADDRESS: DeviceFault.PARAMETER,
    arv.ARV_DEVICE_ERROR_PROTOCOL_ERROR_WRITE_PROTECT: DeviceFault.PARAMETER,
    arv.ARV_DEVICE_ERROR_PROTOCOL_ERROR_BAD_ALIGNMENT: DeviceFault.PARAMETER,
    arv.ARV_DEVICE_ERROR_PROTOCOL_ERROR_ACCESS_DENIED: DeviceFault.OVERRIDDEN,
    arv.ARV_DEVICE_ERROR_PROTOCOL_ERROR_BUSY: DeviceFault.BUSY,
}


class AravisCalls:
    """The functions of one Aravis library; any thread as far as Aravis allows.

    Parameters
    ----------
    library : ctypes.CDLL or object
        The loaded library, or an object with the same functions.
    """

    def __init__(self, library: object) -> None:
        self._functions = arv.bind(library)

    def plain(self, name: str, *args: object) -> Any:
        """Call what cannot fail."""
        return self._functions[name](*args)

    def checked(self, whom: str, name: str, *args: object) -> Any:
        """Call what can fail; `whom` names the camera in the text.

        Raises
        ------
        DeviceError
            What Aravis said.
        """
        error: Any = POINTER(arv.GError)()
        answer = self._functions[name](*args, byref(error))
        if logger.isEnabledFor(logging.DEBUG):
            logger.debug("%s: %s%s = %s", whom, name, args[1:], answer)
        if error:
            raise self._exception(error, f"{whom}: {name}")
        return answer

    def pair(self, whom: str, name: str, handle: int, kind: type = ctypes.c_int) -> tuple[Any, Any]:
        """Return the two numbers that a function fills in."""
        first, second = kind(), kind()
        self.checked(whom, name, handle, byref(first), byref(second))
        return first.value, second.value

    def strings(self, whom: str, name: str, handle: int) -> tuple[str, ...]:
        """Return the texts of a function that gives an array to be freed."""
        count = c_uint()
        found = self.checked(whom, name, handle, byref(count))
        if not found:
            return ()
        try:
            return tuple(found[index].decode() for index in range(count.value))
        finally:
            self.plain("g_free", ctypes.cast(found, ctypes.c_void_p))

    def owned_text(self, name: str, handle: int) -> str:
        """Return the text of a function that cannot fail and gives one to be freed."""
        address = self.plain(name, handle)
        if not address:
            return ""
        try:
            return (ctypes.cast(address, ctypes.c_char_p).value or b"").decode(errors="replace")
        finally:
            self.plain("g_free", address)

    def set_int_property(self, handle: int, name: str, value: int) -> None:
        """Set an integer or enumerated property of a GObject."""
        holder = arv.GValue()
        self.plain("g_value_init", byref(holder), arv.G_TYPE_INT)
        self.plain("g_value_set_int", byref(holder), value)
        self.plain("g_object_set_property", handle, name.encode(), byref(holder))

    def release(self, handle: int, *, gone: bool = False) -> None:
        """Give an object back; without waiting for it where its camera is gone.

        Aravis says goodbye to a camera that no longer answers for up to five seconds an object.
        """
        if not gone:
            self.plain("g_object_unref", handle)
            return
        unref = ctypes.cast(self._functions["g_object_unref"], ctypes.c_void_p)
        self.plain("g_thread_unref", self.plain("g_thread_new", b"aravis-release", unref, handle))

    def _exception(self, error: Any, where: str) -> DeviceError:
        domain = self.plain("g_quark_to_string", error.contents.domain) or b"?"
        code = int(error.contents.code)
        text = (error.contents.message or b"no text").decode(errors="replace")
        self.plain("g_error_free", error)
        fault = DeviceFault.PARAMETER  # of the description that the camera gives of itself
        if domain.decode() == arv.ARV_DEVICE_ERROR:
            fault = _FAULTS.get(code, DeviceFault.OTHER)
        kind = DeviceTimeout if fault is DeviceFault.TIMEOUT else DeviceError
        said = f"{where}: {text} ({domain.decode()}, {code})"
        return kind(said, fault=fault, code=code)


def as_refusal(error: DeviceError) -> DeviceError | ConfigError:
    """Return what a failed setting means: a value not accepted, or a camera that fails."""
    if error.fault in (DeviceFault.PARAMETER, DeviceFault.UNSUPPORTED):
        return ConfigError(str(error))
    return error
