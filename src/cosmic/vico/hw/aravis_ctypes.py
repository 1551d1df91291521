"""Aravis' C interface: its functions one to one, its errors as exceptions, its streams.

Names and numbers are those of the headers of Aravis 0.8.26 and of GLib's GObject. What a camera
makes of them is one floor up in `aravis`.
"""

import ctypes
import logging
from ctypes import (
    CFUNCTYPE,
    POINTER,
    byref,
    c_char_p,
    c_double,
    c_int,
    c_int64,
    c_size_t,
    c_uint,
    c_uint32,
    c_uint64,
    c_ulong,
    c_void_p,
)
from typing import Any, Final

from cosmic.frame.errors import DeviceError, DeviceFault, DeviceTimeout
from cosmic.vico.hw.bus_frames import buffers_for, copy_rows, empty_pixels
from cosmic.vico.hw.camera_library import bind_functions, load_camera_library
from cosmic.vico.hw.interface import CameraSettings, Pixels

logger = logging.getLogger(__name__)

LIBRARY_NAME: Final = "libaravis-0.8.so.0"
# Without packet sockets (CAP_NET_RAW) the kernel's default of 200 kB loses most frames; the
# kernel cuts this to net.core.rmem_max.
_SOCKET_BUFFER_BYTES: Final = 8_000_000

# ArvBufferStatus
ARV_BUFFER_STATUS_SUCCESS: Final = 0
# ArvAcquisitionMode, ArvAuto
ARV_ACQUISITION_MODE_CONTINUOUS: Final = 0
ARV_AUTO_OFF: Final = 0
# ArvGvStreamSocketBuffer
ARV_GV_STREAM_SOCKET_BUFFER_FIXED: Final = 0
# ArvDeviceError, of the error domain below
ARV_DEVICE_ERROR: Final = "arv-device-error-quark"
ARV_DEVICE_ERROR_WRONG_FEATURE: Final = 0
ARV_DEVICE_ERROR_FEATURE_NOT_FOUND: Final = 1
ARV_DEVICE_ERROR_NOT_CONNECTED: Final = 2
ARV_DEVICE_ERROR_PROTOCOL_ERROR: Final = 3
ARV_DEVICE_ERROR_TRANSFER_ERROR: Final = 4
ARV_DEVICE_ERROR_TIMEOUT: Final = 5
ARV_DEVICE_ERROR_NOT_FOUND: Final = 6
ARV_DEVICE_ERROR_INVALID_PARAMETER: Final = 7
ARV_DEVICE_ERROR_GENICAM_NOT_FOUND: Final = 8
ARV_DEVICE_ERROR_NO_STREAM_CHANNEL: Final = 9
ARV_DEVICE_ERROR_NOT_CONTROLLER: Final = 10
ARV_DEVICE_ERROR_UNKNOWN: Final = 11
ARV_DEVICE_ERROR_PROTOCOL_ERROR_NOT_IMPLEMENTED: Final = 12
ARV_DEVICE_ERROR_PROTOCOL_ERROR_INVALID_PARAMETER: Final = 13
ARV_DEVICE_ERROR_PROTOCOL_ERROR_INVALID_ADDRESS: Final = 14
ARV_DEVICE_ERROR_PROTOCOL_ERROR_WRITE_PROTECT: Final = 15
ARV_DEVICE_ERROR_PROTOCOL_ERROR_BAD_ALIGNMENT: Final = 16
ARV_DEVICE_ERROR_PROTOCOL_ERROR_ACCESS_DENIED: Final = 17
ARV_DEVICE_ERROR_PROTOCOL_ERROR_BUSY: Final = 18
# fundamental types of GObject: the number shifted by G_TYPE_FUNDAMENTAL_SHIFT
G_TYPE_INT: Final = 6 << 2


class GError(ctypes.Structure):
    """What a call that failed leaves behind; freed by `g_error_free`."""

    _fields_ = (("domain", c_uint32), ("code", c_int), ("message", c_char_p))


class GValue(ctypes.Structure):
    """A value with its type; all zero before `g_value_init`."""

    _fields_ = (("g_type", c_size_t), ("data", c_uint64 * 2))


ControlLostHandler = CFUNCTYPE(None, c_void_p, c_void_p)
"""Handler of ArvDevice's signal "control-lost": the device and the user data."""

_P = c_void_p
_ERROR = POINTER(POINTER(GError))
_INT_OUT, _DOUBLE_OUT, _UINT_OUT = POINTER(c_int), POINTER(c_double), POINTER(c_uint)
_U64_OUT, _SIZE_OUT = POINTER(c_uint64), POINTER(c_size_t)
_STRINGS = POINTER(c_char_p)

Prototype = tuple[type | None, tuple[Any, ...]]

PLAIN: Final[dict[str, Prototype]] = {
    "arv_get_major_version": (c_uint, ()),
    "arv_get_minor_version": (c_uint, ()),
    "arv_get_micro_version": (c_uint, ()),
    "arv_enable_interface": (None, (c_char_p,)),
    "arv_disable_interface": (None, (c_char_p,)),
    "arv_update_device_list": (None, ()),
    "arv_get_n_devices": (c_uint, ()),
    "arv_get_device_id": (c_char_p, (c_uint,)),
    "arv_get_device_address": (c_char_p, (c_uint,)),
    "arv_get_device_vendor": (c_char_p, (c_uint,)),
    "arv_get_device_model": (c_char_p, (c_uint,)),
    "arv_get_device_serial_nbr": (c_char_p, (c_uint,)),
    "arv_get_device_protocol": (c_char_p, (c_uint,)),
    "arv_camera_get_device": (_P, (_P,)),
    "arv_camera_is_gv_device": (c_int, (_P,)),
    "arv_gv_device_is_controller": (c_int, (_P,)),
    "arv_gv_device_get_device_address": (_P, (_P,)),
    "g_inet_socket_address_get_address": (_P, (_P,)),
    "g_inet_address_to_string": (_P, (_P,)),
    "arv_stream_push_buffer": (None, (_P, _P)),
    "arv_stream_timeout_pop_buffer": (_P, (_P, c_uint64)),
    "arv_stream_get_statistics": (None, (_P, _U64_OUT, _U64_OUT, _U64_OUT)),
    "arv_gv_stream_get_statistics": (None, (_P, _U64_OUT, _U64_OUT)),
    "arv_buffer_new_allocate": (_P, (c_size_t,)),
    "arv_buffer_get_status": (c_int, (_P,)),
    "arv_buffer_get_timestamp": (c_uint64, (_P,)),
    "arv_buffer_get_system_timestamp": (c_uint64, (_P,)),
    "arv_buffer_get_frame_id": (c_uint64, (_P,)),
    "arv_buffer_get_data": (_P, (_P, _SIZE_OUT)),
    "arv_buffer_get_image_width": (c_int, (_P,)),
    "arv_buffer_get_image_height": (c_int, (_P,)),
    "arv_buffer_get_image_pixel_format": (c_uint32, (_P,)),
    "arv_buffer_get_image_padding": (None, (_P, _INT_OUT, _INT_OUT)),
    "g_object_unref": (None, (_P,)),
    "g_object_set_property": (None, (_P, c_char_p, POINTER(GValue))),
    "g_signal_connect_data": (c_ulong, (_P, c_char_p, ControlLostHandler, _P, _P, c_int)),
    "g_signal_handler_disconnect": (None, (_P, c_ulong)),
    "g_value_init": (_P, (POINTER(GValue), c_size_t)),
    "g_value_set_int": (None, (POINTER(GValue), c_int)),
    "g_quark_to_string": (c_char_p, (c_uint32,)),
    "g_error_free": (None, (POINTER(GError),)),
    "g_free": (None, (_P,)),
    "g_get_real_time": (c_int64, ()),
    "g_thread_new": (_P, (c_char_p, _P, _P)),
    "g_thread_unref": (None, (_P,)),
}
"""What cannot fail, or says so by its answer."""

_IN_CAMERA_INTS = ("x_offset", "y_offset", "width", "height", "x_binning", "y_binning")
_IN_CAMERA_FLOATS = ("exposure_time", "gain", "frame_rate")

FALLIBLE: Final[dict[str, Prototype]] = {
    "arv_camera_new": (_P, (c_char_p,)),
    "arv_camera_get_vendor_name": (c_char_p, (_P,)),
    "arv_camera_get_model_name": (c_char_p, (_P,)),
    "arv_camera_get_device_serial_number": (c_char_p, (_P,)),
    "arv_camera_create_stream": (_P, (_P, _P, _P)),
    "arv_camera_get_sensor_size": (None, (_P, _INT_OUT, _INT_OUT)),
    "arv_camera_get_region": (None, (_P, _INT_OUT, _INT_OUT, _INT_OUT, _INT_OUT)),
    "arv_camera_set_region": (None, (_P, c_int, c_int, c_int, c_int)),
    "arv_camera_get_binning": (None, (_P, _INT_OUT, _INT_OUT)),
    "arv_camera_set_binning": (None, (_P, c_int, c_int)),
    "arv_camera_is_binning_available": (c_int, (_P,)),
    "arv_camera_is_region_offset_available": (c_int, (_P,)),
    "arv_camera_get_pixel_format_as_string": (c_char_p, (_P,)),
    "arv_camera_set_pixel_format_from_string": (None, (_P, c_char_p)),
    "arv_camera_dup_available_pixel_formats_as_strings": (_STRINGS, (_P, _UINT_OUT)),
    "arv_camera_start_acquisition": (None, (_P,)),
    "arv_camera_stop_acquisition": (None, (_P,)),
    "arv_camera_set_acquisition_mode": (None, (_P, c_int)),
    "arv_camera_set_trigger": (None, (_P, c_char_p)),
    "arv_camera_clear_triggers": (None, (_P,)),
    "arv_camera_software_trigger": (None, (_P,)),
    "arv_camera_is_software_trigger_supported": (c_int, (_P,)),
    "arv_camera_dup_available_trigger_sources": (_STRINGS, (_P, _UINT_OUT)),
    "arv_camera_is_exposure_auto_available": (c_int, (_P,)),
    "arv_camera_set_exposure_time_auto": (None, (_P, c_int)),
    "arv_camera_is_gain_auto_available": (c_int, (_P,)),
    "arv_camera_set_gain_auto": (None, (_P, c_int)),
    "arv_camera_get_payload": (c_uint, (_P,)),
    "arv_camera_is_feature_available": (c_int, (_P, c_char_p)),
    "arv_camera_get_integer": (c_int64, (_P, c_char_p)),
    "arv_camera_gv_set_packet_size": (None, (_P, c_int)),
    "arv_camera_gv_get_packet_size": (c_uint, (_P,)),
    "arv_device_read_memory": (c_int, (_P, c_uint64, c_uint32, _P)),
    **{
        f"arv_camera_get_{name}_bounds": (None, (_P, _INT_OUT, _INT_OUT))
        for name in _IN_CAMERA_INTS
    },
    **{f"arv_camera_get_{name}_increment": (c_int, (_P,)) for name in _IN_CAMERA_INTS},
    **{
        f"arv_camera_get_{name}_bounds": (None, (_P, _DOUBLE_OUT, _DOUBLE_OUT))
        for name in _IN_CAMERA_FLOATS
    },
    **{f"arv_camera_get_{name}": (c_double, (_P,)) for name in _IN_CAMERA_FLOATS},
    **{f"arv_camera_set_{name}": (None, (_P, c_double)) for name in _IN_CAMERA_FLOATS},
    **{f"arv_camera_is_{name}_available": (c_int, (_P,)) for name in _IN_CAMERA_FLOATS},
}
"""What takes a `GError **` as well, as its last argument."""


_NEEDED: Final = "Aravis 0.8.26 or a later 0.8 is needed (Debian 12: package libaravis-0.8-0)"
_ADVICE_TO_INSTALL: Final = (
    "Install Aravis: on Debian and Ubuntu the package libaravis-0.8-0 (apt install libaravis-0.8-0)"
)


def bind(library: object) -> dict[str, Any]:
    """Return every function above by name, with its types set.

    Parameters
    ----------
    library : ctypes.CDLL or object
        What has the functions as attributes; types are set only on those of a `CDLL`.

    Raises
    ------
    NotConnectedError
        A function is missing: the library is older than 0.8.20 or not Aravis.
    """
    wanted = PLAIN | {name: (back, (*a, _ERROR)) for name, (back, a) in FALLIBLE.items()}
    return bind_functions(library, wanted, name=LIBRARY_NAME, needed=_NEEDED)


def load_library(path: str = "") -> ctypes.CDLL:
    """Load Aravis from `path`, or from where the system looks when it is empty.

    Raises
    ------
    NotConnectedError
        It is not installed.
    """
    return load_camera_library(path or LIBRARY_NAME, _ADVICE_TO_INSTALL)


_FAULTS: Final = {
    ARV_DEVICE_ERROR_WRONG_FEATURE: DeviceFault.UNSUPPORTED,
    ARV_DEVICE_ERROR_FEATURE_NOT_FOUND: DeviceFault.UNSUPPORTED,
    ARV_DEVICE_ERROR_NOT_CONNECTED: DeviceFault.COMMUNICATION,
    ARV_DEVICE_ERROR_PROTOCOL_ERROR: DeviceFault.COMMUNICATION,
    ARV_DEVICE_ERROR_TRANSFER_ERROR: DeviceFault.COMMUNICATION,
    ARV_DEVICE_ERROR_TIMEOUT: DeviceFault.TIMEOUT,
    ARV_DEVICE_ERROR_NOT_FOUND: DeviceFault.COMMUNICATION,
    ARV_DEVICE_ERROR_INVALID_PARAMETER: DeviceFault.PARAMETER,
    ARV_DEVICE_ERROR_GENICAM_NOT_FOUND: DeviceFault.UNSUPPORTED,
    ARV_DEVICE_ERROR_NO_STREAM_CHANNEL: DeviceFault.UNSUPPORTED,
    ARV_DEVICE_ERROR_NOT_CONTROLLER: DeviceFault.OVERRIDDEN,
    ARV_DEVICE_ERROR_PROTOCOL_ERROR_NOT_IMPLEMENTED: DeviceFault.UNSUPPORTED,
    ARV_DEVICE_ERROR_PROTOCOL_ERROR_INVALID_PARAMETER: DeviceFault.PARAMETER,
    ARV_DEVICE_ERROR_PROTOCOL_ERROR_INVALID_ADDRESS: DeviceFault.PARAMETER,
    ARV_DEVICE_ERROR_PROTOCOL_ERROR_WRITE_PROTECT: DeviceFault.PARAMETER,
    ARV_DEVICE_ERROR_PROTOCOL_ERROR_BAD_ALIGNMENT: DeviceFault.PARAMETER,
    ARV_DEVICE_ERROR_PROTOCOL_ERROR_ACCESS_DENIED: DeviceFault.OVERRIDDEN,
    ARV_DEVICE_ERROR_PROTOCOL_ERROR_BUSY: DeviceFault.BUSY,
}


class AravisCalls:
    """The functions of one Aravis library; any thread as far as Aravis allows.

    Parameters
    ----------
    library : ctypes.CDLL or object
        The loaded library, or an object with the same functions.
    """

    def __init__(self, library: object) -> None:
        self._functions = bind(library)

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
        error: Any = POINTER(GError)()
        answer = self._functions[name](*args, byref(error))
        if logger.isEnabledFor(logging.DEBUG):
            logger.debug("%s: %s%s = %s", whom, name, args[1:], answer)
        if error:
            raise self._exception(error, f"{whom}: {name}")
        return answer

    def pair(self, whom: str, name: str, handle: int, kind: type = c_int) -> tuple[Any, Any]:
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
            self.plain("g_free", ctypes.cast(found, c_void_p))

    def owned_text(self, name: str, handle: int) -> str:
        """Return the text of a function that cannot fail and gives one to be freed."""
        address = self.plain(name, handle)
        if not address:
            return ""
        try:
            return (ctypes.cast(address, c_char_p).value or b"").decode(errors="replace")
        finally:
            self.plain("g_free", address)

    def set_int_property(self, handle: int, name: str, value: int) -> None:
        """Set an integer or enumerated property of a GObject."""
        holder = GValue()
        self.plain("g_value_init", byref(holder), G_TYPE_INT)
        self.plain("g_value_set_int", byref(holder), value)
        self.plain("g_object_set_property", handle, name.encode(), byref(holder))

    def release(self, handle: int, *, gone: bool = False) -> None:
        """Give an object back; without waiting for it where its camera is gone.

        Aravis says goodbye to a camera that no longer answers for up to five seconds an object.
        """
        if not gone:
            self.plain("g_object_unref", handle)
            return
        unref = ctypes.cast(self._functions["g_object_unref"], c_void_p)
        self.plain("g_thread_unref", self.plain("g_thread_new", b"aravis-release", unref, handle))

    def _exception(self, error: Any, where: str) -> DeviceError:
        domain = self.plain("g_quark_to_string", error.contents.domain) or b"?"
        code = int(error.contents.code)
        text = (error.contents.message or b"no text").decode(errors="replace")
        self.plain("g_error_free", error)
        fault = DeviceFault.PARAMETER  # of the description that the camera gives of itself
        if domain.decode() == ARV_DEVICE_ERROR:
            fault = _FAULTS.get(code, DeviceFault.OTHER)
        kind = DeviceTimeout if fault is DeviceFault.TIMEOUT else DeviceError
        said = f"{where}: {text} ({domain.decode()}, {code})"
        return kind(said, fault=fault, code=code)


class AravisStream:
    """An ArvStream with its pool of buffers; one thread at a time.

    Parameters
    ----------
    camera : int
        Address of the ArvCamera; the caller keeps it alive.

    Raises
    ------
    DeviceError
        The camera fails, or another program controls it.
    """

    def __init__(self, calls: AravisCalls, camera: int, whom: str, rate_hz: float) -> None:
        self._calls = calls
        self._gige = bool(calls.plain("arv_camera_is_gv_device", camera))
        payload = int(calls.checked(whom, "arv_camera_get_payload", camera))
        self._stream = calls.checked(whom, "arv_camera_create_stream", camera, None, None)
        if not self._stream:
            raise DeviceError(f"{whom}: Aravis made no stream", fault=DeviceFault.COMMUNICATION)
        if self._gige:
            fixed = ARV_GV_STREAM_SOCKET_BUFFER_FIXED
            calls.set_int_property(self._stream, "socket-buffer", fixed)
            calls.set_int_property(self._stream, "socket-buffer-size", _SOCKET_BUFFER_BYTES)
        for _ in range(buffers_for(rate_hz, payload)):
            self.push(calls.plain("arv_buffer_new_allocate", payload))

    def pop(self, timeout_s: float) -> int | None:
        """Return the next buffer that was filled, to be pushed back; None after a while."""
        found = self._calls.plain(
            "arv_stream_timeout_pop_buffer", self._stream, round(timeout_s * 1e6)
        )
        return None if found is None else int(found)

    def push(self, buffer: int) -> None:
        """Give a buffer to be filled; it belongs to the stream from now on."""
        self._calls.plain("arv_stream_push_buffer", self._stream, buffer)

    def underruns(self) -> int:
        """Return how often no buffer was free."""
        numbers = [c_uint64() for _ in range(3)]
        self._calls.plain(
            "arv_stream_get_statistics", self._stream, *(byref(each) for each in numbers)
        )
        return numbers[2].value

    def packets(self) -> tuple[int, int]:
        """Return how many packets were asked for again, and how many never came; GigE only."""
        resent, missing = c_uint64(), c_uint64()
        if self._gige:
            self._calls.plain(
                "arv_gv_stream_get_statistics", self._stream, byref(resent), byref(missing)
            )
        return resent.value, missing.value

    def close(self, *, gone: bool = False) -> None:
        """End its thread and free its buffers; `gone`: the camera is."""
        self._calls.release(self._stream, gone=gone)


class AravisBuffer:
    """What is in a buffer that was filled; valid until it is pushed back."""

    def __init__(self, calls: AravisCalls, buffer: int) -> None:
        self._calls = calls
        self._buffer = buffer

    @property
    def whole(self) -> bool:
        """Nothing of it is missing."""
        return bool(self._get("status") == ARV_BUFFER_STATUS_SUCCESS)

    @property
    def number(self) -> int:
        """The frame's number on the wire; a stranger's where the first packet is missing."""
        return int(self._get("frame_id"))

    @property
    def device_ns(self) -> int:
        """The camera's clock."""
        return int(self._get("timestamp"))

    @property
    def system_ns(self) -> int:
        """Time on the clock of this computer (`g_get_real_time`) when its first packet was seen."""
        return int(self._get("system_timestamp"))

    def pixels(self, settings: CameraSettings) -> Pixels | None:
        """Return a copy of the image, None where it is not of the size in force."""
        image = empty_pixels(settings)
        height, width = image.shape[:2]
        gap = 0
        if self.whole:  # else Aravis does not tell
            if (self._get("image_width"), self._get("image_height")) != (width, height):
                return None
            across, down = c_int(), c_int()
            name = "arv_buffer_get_image_padding"
            self._calls.plain(name, self._buffer, byref(across), byref(down))
            gap = across.value
        line = image.nbytes // height + gap
        size = c_size_t()
        start = self._calls.plain("arv_buffer_get_data", self._buffer, byref(size))
        if not start or size.value < line * height - gap:
            return None
        copy_rows(start, line, image)
        image.flags.writeable = False
        return image

    def _get(self, what: str) -> int:
        return int(self._calls.plain(f"arv_buffer_get_{what}", self._buffer))
