"""The C interface of libdc1394: its functions one to one, its errors as exceptions, its ring.

Names, numbers and the layout of the structures are those of the headers of libdc1394 2.2.6. What
a camera makes of them is one floor up in `dc1394`.
"""

import ctypes
import logging
import selectors
from ctypes import (
    POINTER,
    byref,
    c_char_p,
    c_float,
    c_int,
    c_int32,
    c_uint16,
    c_uint32,
    c_uint64,
    c_void_p,
)
from dataclasses import dataclass
from typing import Any, Final

from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.vico.hw.bus_frames import buffers_for, copy_rows, empty_pixels
from cosmic.vico.hw.camera_library import bind_functions, load_camera_library
from cosmic.vico.hw.interface import CameraSettings, Pixels

logger = logging.getLogger(__name__)

LIBRARY_NAME: Final = "libdc1394.so.25"

# dc1394error_t
DC1394_SUCCESS: Final = 0
DC1394_FAILURE: Final = -1
DC1394_FUNCTION_NOT_SUPPORTED: Final = -3
DC1394_NO_ISO_CHANNEL: Final = -7
DC1394_NO_BANDWIDTH: Final = -8
DC1394_IOCTL_FAILURE: Final = -9
DC1394_FORMAT7_ERROR_FLAG_1: Final = -13
DC1394_FORMAT7_ERROR_FLAG_2: Final = -14
DC1394_INVALID_ARGUMENT_VALUE: Final = -15
DC1394_REQ_VALUE_OUTSIDE_RANGE: Final = -16
DC1394_INVALID_FEATURE: Final = -17
DC1394_INVALID_FRAMERATE: Final = -20
DC1394_INVALID_COLOR_CODING: Final = -25
# dc1394bool_t, dc1394switch_t
DC1394_OFF: Final = 0
DC1394_ON: Final = 1
# dc1394speed_t
DC1394_ISO_SPEED_400: Final = 2
DC1394_ISO_SPEED_800: Final = 3
# dc1394operation_mode_t
DC1394_OPERATION_MODE_1394B: Final = 481
# dc1394framerate_t: 1.875 Hz and so on, each twice the one before
DC1394_FRAMERATE_1_875: Final = 32
DC1394_FRAMERATE_240: Final = 39
# dc1394video_mode_t, those without colour
DC1394_VIDEO_MODE_640x480_MONO8: Final = 69
DC1394_VIDEO_MODE_640x480_MONO16: Final = 70
DC1394_VIDEO_MODE_800x600_MONO8: Final = 73
DC1394_VIDEO_MODE_1024x768_MONO8: Final = 76
DC1394_VIDEO_MODE_800x600_MONO16: Final = 77
DC1394_VIDEO_MODE_1024x768_MONO16: Final = 78
DC1394_VIDEO_MODE_1280x960_MONO8: Final = 81
DC1394_VIDEO_MODE_1600x1200_MONO8: Final = 84
DC1394_VIDEO_MODE_1280x960_MONO16: Final = 85
DC1394_VIDEO_MODE_1600x1200_MONO16: Final = 86
DC1394_VIDEO_MODE_FORMAT7_0: Final = 88
DC1394_VIDEO_MODE_NUM: Final = 32
# dc1394color_coding_t
DC1394_COLOR_CODING_MONO8: Final = 352
DC1394_COLOR_CODING_MONO16: Final = 357
DC1394_COLOR_CODING_NUM: Final = 11
# dc1394trigger_mode_t, dc1394trigger_source_t
DC1394_TRIGGER_MODE_0: Final = 384
DC1394_TRIGGER_SOURCE_0: Final = 576
DC1394_TRIGGER_SOURCE_SOFTWARE: Final = 580
DC1394_TRIGGER_SOURCE_NUM: Final = 5
# dc1394feature_t
DC1394_FEATURE_SHUTTER: Final = 423
DC1394_FEATURE_GAIN: Final = 424
DC1394_FEATURE_TRIGGER: Final = 428
# dc1394feature_mode_t, dc1394capture_policy_t, capture flags
DC1394_FEATURE_MODE_MANUAL: Final = 736
DC1394_CAPTURE_POLICY_POLL: Final = 673
DC1394_CAPTURE_FLAGS_DEFAULT: Final = 4


class dc1394camera_t(ctypes.Structure):  # noqa: N801 - the header's name
    """An open camera; the fields up to those that are read here."""

    _fields_ = (
        ("guid", c_uint64),
        ("unit", c_int),
        ("unit_spec_ID", c_uint32),
        ("unit_sw_version", c_uint32),
        ("unit_sub_sw_version", c_uint32),
        ("command_registers_base", c_uint32),
        ("unit_directory", c_uint32),
        ("unit_dependent_directory", c_uint32),
        ("advanced_features_csr", c_uint64),
        ("PIO_control_csr", c_uint64),
        ("SIO_control_csr", c_uint64),
        ("strobe_control_csr", c_uint64),
        ("format7_csr", c_uint64 * 8),
        ("iidc_version", c_int),
        ("vendor", c_char_p),
        ("model", c_char_p),
        ("vendor_id", c_uint32),
        ("model_id", c_uint32),
        ("bmode_capable", c_int),
        ("one_shot_capable", c_int),
        ("multi_shot_capable", c_int),
        ("can_switch_on_off", c_int),
        ("has_vmode_error_status", c_int),
        ("has_feature_error_status", c_int),
        ("max_mem_channel", c_int),
        ("flags", c_uint32),
    )


class dc1394camera_id_t(ctypes.Structure):  # noqa: N801 - the header's name
    """Which camera, in a list."""

    _fields_ = (("unit", c_uint16), ("guid", c_uint64))


class dc1394camera_list_t(ctypes.Structure):  # noqa: N801 - the header's name
    """The cameras on the bus; freed by `dc1394_camera_free_list`."""

    _fields_ = (("num", c_uint32), ("ids", POINTER(dc1394camera_id_t)))


class dc1394video_frame_t(ctypes.Structure):  # noqa: N801 - the header's name
    """One frame in the ring of buffers."""

    _fields_ = (
        ("image", c_void_p),
        ("size", c_uint32 * 2),
        ("position", c_uint32 * 2),
        ("color_coding", c_int),
        ("color_filter", c_int),
        ("yuv_byte_order", c_uint32),
        ("data_depth", c_uint32),
        ("stride", c_uint32),
        ("video_mode", c_int),
        ("total_bytes", c_uint64),
        ("image_bytes", c_uint32),
        ("padding_bytes", c_uint32),
        ("packet_size", c_uint32),
        ("packets_per_frame", c_uint32),
        ("timestamp", c_uint64),
        ("frames_behind", c_uint32),
        ("camera", c_void_p),
        ("id", c_uint32),
        ("allocated_image_bytes", c_uint64),
        ("little_endian", c_int),
        ("data_in_padding", c_int),
    )


class dc1394framerates_t(ctypes.Structure):  # noqa: N801 - the header's name
    """Rates of a fixed mode."""

    _fields_ = (("num", c_uint32), ("framerates", c_int * 8))


class dc1394video_modes_t(ctypes.Structure):  # noqa: N801 - the header's name
    """Modes of a camera."""

    _fields_ = (("num", c_uint32), ("modes", c_int * DC1394_VIDEO_MODE_NUM))


class dc1394color_codings_t(ctypes.Structure):  # noqa: N801 - the header's name
    """Codings of a scalable mode."""

    _fields_ = (("num", c_uint32), ("codings", c_int * DC1394_COLOR_CODING_NUM))


class dc1394trigger_sources_t(ctypes.Structure):  # noqa: N801 - the header's name
    """Where a trigger may come from."""

    _fields_ = (("num", c_uint32), ("sources", c_int * DC1394_TRIGGER_SOURCE_NUM))


_CAMERA = POINTER(dc1394camera_t)
_FRAME = POINTER(dc1394video_frame_t)
_U, _I = c_uint32, c_int
_U_OUT, _I_OUT, _F_OUT = POINTER(c_uint32), POINTER(c_int), POINTER(c_float)

_STATUS: Final[dict[str, tuple[Any, ...]]] = {
    "dc1394_camera_enumerate": (c_void_p, POINTER(POINTER(dc1394camera_list_t))),
    "dc1394_video_get_supported_modes": (_CAMERA, POINTER(dc1394video_modes_t)),
    "dc1394_video_get_supported_framerates": (_CAMERA, _I, POINTER(dc1394framerates_t)),
    "dc1394_video_get_framerate": (_CAMERA, _I_OUT),
    "dc1394_video_set_framerate": (_CAMERA, _I),
    "dc1394_video_get_mode": (_CAMERA, _I_OUT),
    "dc1394_video_set_mode": (_CAMERA, _I),
    "dc1394_video_set_operation_mode": (_CAMERA, _I),
    "dc1394_video_set_iso_speed": (_CAMERA, _I),
    "dc1394_video_get_transmission": (_CAMERA, _I_OUT),
    "dc1394_video_set_transmission": (_CAMERA, _I),
    "dc1394_format7_get_max_image_size": (_CAMERA, _I, _U_OUT, _U_OUT),
    "dc1394_format7_get_unit_size": (_CAMERA, _I, _U_OUT, _U_OUT),
    "dc1394_format7_get_unit_position": (_CAMERA, _I, _U_OUT, _U_OUT),
    "dc1394_format7_get_color_codings": (_CAMERA, _I, POINTER(dc1394color_codings_t)),
    "dc1394_format7_get_packet_parameters": (_CAMERA, _I, _U_OUT, _U_OUT),
    "dc1394_format7_set_roi": (_CAMERA, _I, _I, c_int32, c_int32, c_int32, c_int32, c_int32),
    "dc1394_format7_get_roi": (_CAMERA, _I, _I_OUT, _U_OUT, _U_OUT, _U_OUT, _U_OUT, _U_OUT),
    "dc1394_feature_is_present": (_CAMERA, _I, _I_OUT),
    "dc1394_feature_get_value": (_CAMERA, _I, _U_OUT),
    "dc1394_feature_set_value": (_CAMERA, _I, _U),
    "dc1394_feature_get_boundaries": (_CAMERA, _I, _U_OUT, _U_OUT),
    "dc1394_feature_set_mode": (_CAMERA, _I, _I),
    "dc1394_feature_has_absolute_control": (_CAMERA, _I, _I_OUT),
    "dc1394_feature_set_absolute_control": (_CAMERA, _I, _I),
    "dc1394_feature_get_absolute_boundaries": (_CAMERA, _I, _F_OUT, _F_OUT),
    "dc1394_feature_get_absolute_value": (_CAMERA, _I, _F_OUT),
    "dc1394_feature_set_absolute_value": (_CAMERA, _I, c_float),
    "dc1394_external_trigger_set_power": (_CAMERA, _I),
    "dc1394_external_trigger_set_mode": (_CAMERA, _I),
    "dc1394_external_trigger_set_source": (_CAMERA, _I),
    "dc1394_external_trigger_get_supported_sources": (_CAMERA, POINTER(dc1394trigger_sources_t)),
    "dc1394_software_trigger_set_power": (_CAMERA, _I),
    "dc1394_capture_setup": (_CAMERA, _U, _U),
    "dc1394_capture_stop": (_CAMERA,),
    "dc1394_capture_dequeue": (_CAMERA, _I, POINTER(_FRAME)),
    "dc1394_capture_enqueue": (_CAMERA, _FRAME),
}
"""What answers with a dc1394error_t."""

_OTHERS: Final[dict[str, tuple[Any, tuple[Any, ...]]]] = {
    "dc1394_new": (c_void_p, ()),
    "dc1394_free": (None, (c_void_p,)),
    "dc1394_camera_free_list": (None, (POINTER(dc1394camera_list_t),)),
    "dc1394_camera_new_unit": (_CAMERA, (c_void_p, c_uint64, c_int)),
    "dc1394_camera_free": (None, (_CAMERA,)),
    "dc1394_capture_get_fileno": (c_int, (_CAMERA,)),
    "dc1394_capture_is_frame_corrupt": (c_int, (_CAMERA, _FRAME)),
    "dc1394_error_get_string": (c_char_p, (c_int,)),
}


_NEEDED: Final = "libdc1394 2.2 is needed (Debian: package libdc1394-25)"
_ADVICE_TO_INSTALL: Final = (
    "Install libdc1394: on Debian the package libdc1394-25 (apt "
    "install libdc1394-25); there is none for Windows"
)


def bind(library: object) -> dict[str, Any]:
    """Return every function above by name, with its types set on those of a `ctypes.CDLL`.

    Raises
    ------
    NotConnectedError
        A function is missing: it is not libdc1394 2.2.
    """
    wanted = _OTHERS | {name: (c_int, arguments) for name, arguments in _STATUS.items()}
    return bind_functions(library, wanted, name=LIBRARY_NAME, needed=_NEEDED)


def load_library(path: str = "") -> ctypes.CDLL:
    """Load libdc1394 from `path`, or from where the system looks when it is empty.

    Raises
    ------
    NotConnectedError
        It is not installed.
    """
    return load_camera_library(path or LIBRARY_NAME, _ADVICE_TO_INSTALL)


_FAULTS: Final = {
    DC1394_FAILURE: DeviceFault.COMMUNICATION,
    DC1394_IOCTL_FAILURE: DeviceFault.COMMUNICATION,
    DC1394_FUNCTION_NOT_SUPPORTED: DeviceFault.UNSUPPORTED,
    DC1394_NO_ISO_CHANNEL: DeviceFault.STATE,
    DC1394_NO_BANDWIDTH: DeviceFault.STATE,
    DC1394_FORMAT7_ERROR_FLAG_1: DeviceFault.PARAMETER,
    DC1394_FORMAT7_ERROR_FLAG_2: DeviceFault.PARAMETER,
    DC1394_INVALID_ARGUMENT_VALUE: DeviceFault.PARAMETER,
    DC1394_REQ_VALUE_OUTSIDE_RANGE: DeviceFault.PARAMETER,
    DC1394_INVALID_FEATURE: DeviceFault.UNSUPPORTED,
    DC1394_INVALID_FRAMERATE: DeviceFault.PARAMETER,
    DC1394_INVALID_COLOR_CODING: DeviceFault.PARAMETER,
}
_ADVICE: Final = {
    DC1394_NO_ISO_CHANNEL: "another program may have it; a reset of the bus frees channels",
    DC1394_NO_BANDWIDTH: "the bus is full: lower the rate or the size, or stop another camera",
}


class Dc1394Calls:
    """The functions of one libdc1394.

    Parameters
    ----------
    library : ctypes.CDLL or object
        The loaded library, or an object with the same functions.
    """

    def __init__(self, library: object) -> None:
        self._functions = bind(library)

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
        if status != DC1394_SUCCESS:
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


@dataclass(frozen=True, slots=True, eq=False)
class Taken:
    """A frame copied from the ring.

    Attributes
    ----------
    received_us : int
        Time of day (unix) at which the kernel had it.
    ring_full : bool
        All buffers waited to be read, so that the kernel had none for the next frame.
    """

    data: Pixels
    received_us: int
    corrupt: bool
    ring_full: bool


class Dc1394Ring:
    """Makes the ring, and takes frames from it; one thread at a time.

    Raises
    ------
    DeviceError
        No channel or no bandwidth is left on the bus, or no memory.
    """

    def __init__(self, handle: Dc1394Handle, settings: CameraSettings) -> None:
        self._handle = handle
        self._settings = settings
        self._buffers = buffers_for(settings.rate_hz, 0)
        flags = DC1394_CAPTURE_FLAGS_DEFAULT
        handle.call("dc1394_capture_setup", self._buffers, flags)
        self._arrivals = selectors.DefaultSelector()
        file = handle.calls.plain("dc1394_capture_get_fileno", handle.pointer)
        self._arrivals.register(file, selectors.EVENT_READ)

    def take(self, timeout_s: float) -> Taken | None:
        """Return the next frame, None after a while; raises `DeviceError`."""
        frame = self._dequeued()
        if frame is None and self._arrivals.select(timeout_s):
            frame = self._dequeued()
        if frame is None:
            return None
        try:
            return self._copied(frame)
        finally:
            self._handle.call("dc1394_capture_enqueue", frame)

    def close(self) -> None:
        """Give the ring, the channel and the bandwidth back."""
        self._arrivals.close()
        # The answer says nothing of use: it fails for a camera that is gone.
        self._handle.calls.plain("dc1394_capture_stop", self._handle.pointer)

    def _dequeued(self) -> Any:
        frame: Any = POINTER(dc1394video_frame_t)()
        self._handle.call("dc1394_capture_dequeue", DC1394_CAPTURE_POLICY_POLL, byref(frame))
        return frame or None

    def _copied(self, frame: Any) -> Taken:
        found = frame.contents
        data = empty_pixels(self._settings)
        height, width = data.shape
        stride = found.stride or width * data.itemsize
        fits = tuple(found.size) == (width, height) and stride * height <= found.total_bytes
        if fits:
            copy_rows(found.image, stride, data)
        if data.itemsize > 1 and not found.little_endian:
            data.byteswap(inplace=True)  # IIDC sends the high byte first
        data.flags.writeable = False
        name = "dc1394_capture_is_frame_corrupt"
        corrupt = self._handle.calls.plain(name, self._handle.pointer, frame)
        return Taken(
            data=data,
            received_us=int(found.timestamp),
            corrupt=bool(corrupt) or not fits,
            ring_full=found.frames_behind >= self._buffers - 1,
        )
