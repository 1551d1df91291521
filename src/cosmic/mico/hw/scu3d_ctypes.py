"""SCU3DControl's C interface, one to one: packet, constants, prototypes, and binding by name.

Names and numbers are those of the vendor's header 1.5.7 (2018), which contains header 1.2 (2010)
unchanged. Nothing is converted and nothing raises on a status here; that is one floor up in
`scu3d`. The calling convention is cdecl on Windows as on Linux, hence `ctypes.CDLL`.
"""

import ctypes
from collections.abc import Callable
from ctypes import POINTER, c_int32, c_uint32, c_void_p
from functools import cache
from typing import Any, Final

from typing_extensions import override

from cosmic.mico.hw.smaract_load import SmaractFunctions


class SA_PACKET(ctypes.Structure):
    """One answer of the asynchronous mode: 20 bytes without padding; all integers 32 bit."""

    _fields_ = (
        ("packetType", c_uint32),
        ("channelIndex", c_uint32),
        ("data1", c_uint32),
        ("data2", c_int32),
        ("data3", c_int32),
    )


# configuration flags of SA_InitDevices; the reset is a bit to add
SA_SYNCHRONOUS_COMMUNICATION: Final = 0
SA_ASYNCHRONOUS_COMMUNICATION: Final = 1
SA_HARDWARE_RESET: Final = 2
# SA_SetReportOnComplete_A
SA_NO_REPORT_ON_COMPLETE: Final = 0
SA_REPORT_ON_COMPLETE: Final = 1
# what every function returns
SA_OK: Final = 0
SA_INITIALIZATION_ERROR: Final = 1
SA_NOT_INITIALIZED_ERROR: Final = 2
SA_NO_DEVICES_FOUND_ERROR: Final = 3
SA_TOO_MANY_DEVICES_ERROR: Final = 4
SA_INVALID_DEVICE_INDEX_ERROR: Final = 5
SA_INVALID_CHANNEL_INDEX_ERROR: Final = 6
SA_TRANSMIT_ERROR: Final = 7
SA_WRITE_ERROR: Final = 8
SA_INVALID_PARAMETER_ERROR: Final = 9
SA_READ_ERROR: Final = 10
SA_INTERNAL_ERROR: Final = 12  # there is no 11
SA_WRONG_MODE_ERROR: Final = 13
SA_PROTOCOL_ERROR: Final = 14
SA_TIMEOUT_ERROR: Final = 15
SA_NOTIFICATION_ALREADY_SET_ERROR: Final = 16
SA_ID_LIST_TOO_SMALL_ERROR: Final = 17
SA_DEVICE_ALREADY_ADDED_ERROR: Final = 18
SA_DEVICE_NOT_FOUND_ERROR: Final = 19
SA_INVALID_COMMAND_ERROR: Final = 128
SA_COMMAND_NOT_SUPPORTED_ERROR: Final = 129
SA_NO_SENSOR_PRESENT_ERROR: Final = 130
SA_WRONG_SENSOR_TYPE_ERROR: Final = 131
SA_END_STOP_REACHED_ERROR: Final = 132
SA_COMMAND_OVERRIDDEN_ERROR: Final = 133  # header 1.2 ends here
SA_HV_RANGE_ERROR: Final = 134
SA_TEMP_OVERHEAT_ERROR: Final = 135
SA_CALIBRATION_FAILED_ERROR: Final = 136
SA_REFERENCING_FAILED_ERROR: Final = 137
SA_NOT_PROCESSABLE_ERROR: Final = 138
SA_OTHER_ERROR: Final = 255
# SA_PACKET.packetType
SA_NO_PACKET_TYPE: Final = 0
SA_ERROR_PACKET_TYPE: Final = 1
SA_POSITION_PACKET_TYPE: Final = 2
SA_ANGLE_PACKET_TYPE: Final = 3
SA_COMPLETED_PACKET_TYPE: Final = 4
SA_STATUS_PACKET_TYPE: Final = 5
SA_CLOSED_LOOP_FREQUENCY_PACKET_TYPE: Final = 6
SA_SENSOR_TYPE_PACKET_TYPE: Final = 7
SA_SENSOR_PRESENT_PACKET_TYPE: Final = 8
SA_AMPLITUDE_PACKET_TYPE: Final = 9
SA_POSITIONER_ALIGNMENT_PACKET_TYPE: Final = 10
SA_SAFE_DIRECTION_PACKET_TYPE: Final = 11  # header 1.2 ends here
SA_SCALE_PACKET_TYPE: Final = 12
SA_PHYSICAL_POSITION_KNOWN_PACKET_TYPE: Final = 13
SA_CHANNEL_PROPERTY_PACKET_TYPE: Final = 14
SA_SYSTEM_PROPERTY_PACKET_TYPE: Final = 15
SA_INVALID_PACKET_TYPE: Final = 255
# SA_GetStatus
SA_STOPPED_STATUS: Final = 0
SA_SETTING_AMPLITUDE_STATUS: Final = 1
SA_MOVING_STATUS: Final = 2
SA_TARGETING_STATUS: Final = 3
SA_HOLDING_STATUS: Final = 4
SA_CALIBRATING_STATUS: Final = 5
SA_MOVING_TO_REFERENCE_STATUS: Final = 6
# directions, auto zero, sensor, known position, alignment
SA_BACKWARD_DIRECTION: Final = 0
SA_FORWARD_DIRECTION: Final = 1
SA_NO_AUTO_ZERO: Final = 0
SA_AUTO_ZERO: Final = 1
SA_NO_SENSOR_PRESENT: Final = 0
SA_SENSOR_PRESENT: Final = 1
SA_PHYSICAL_POSITION_UNKNOWN: Final = 0
SA_PHYSICAL_POSITION_KNOWN: Final = 1
SA_HORIZONTAL_ALIGNMENT: Final = 0
SA_VERTICAL_ALIGNMENT: Final = 1
# sensor types; the whole list, with kinds and references, is in scu3d_types
SA_NO_SENSOR_TYPE: Final = 0
SA_M_SENSOR_TYPE: Final = 1
SA_GC_SENSOR_TYPE: Final = 4
SA_RA_SENSOR_TYPE: Final = 7
SA_GF_SENSOR_TYPE: Final = 8
SA_RB_SENSOR_TYPE: Final = 9
SA_LC_SENSOR_TYPE_CODE: Final = 18
SA_LR_SENSOR_TYPE_CODE: Final = 19
SA_L_SENSOR_TYPE_CODE: Final = 21
# system properties: degree Celsius, 0.1 V, number
SA_INTERNAL_TEMPERATURE_PROP: Final = 1
SA_INTERNAL_VOLTAGE_PROP: Final = 2
SA_HARDWARE_VERSION_CODE_PROP: Final = 3
# channel properties: nm, 1 to 127, exponent of two, Hz, 0 or 1
SA_TARGET_READCHED_THRESHOLD_PROP: Final = 3  # spelt so in the header
SA_KP_PROP: Final = 5
SA_KPD_PROP: Final = 6
SA_DEFAULT_MAX_CLOSED_LOOP_FREQUENCY_PROP: Final = 15
SA_ADVANCED_STEPPING_MODE_ENABLED_PROP: Final = 21

ArgTypes = tuple[type, ...]

_U, _I = c_uint32, c_int32
_U_OUT, _I_OUT = POINTER(c_uint32), POINTER(c_int32)
_PACKET_OUT = POINTER(SA_PACKET)
_DEVICE: ArgTypes = (_U,)
_CHANNEL: ArgTypes = (_U, _U)

_SECTION_I: Final[dict[str, ArgTypes]] = {
    "SA_GetDLLVersion": (_U_OUT,),
    "SA_GetAvailableDevices": (_U_OUT, _U_OUT),
    "SA_AddDeviceToInitDevicesList": (_U,),
    "SA_ClearInitDevicesList": (),
    "SA_InitDevices": (_U,),
    "SA_ReleaseDevices": (),
    "SA_GetNumberOfDevices": (_U_OUT,),
    "SA_GetDeviceID": (*_DEVICE, _U_OUT),
    "SA_GetDeviceFirmwareVersion": (*_DEVICE, _U_OUT),
}
# Both forms exist: _S takes the address, what goes in and what comes out; _A answers by packet.
_PAIRS_V12: Final[dict[str, tuple[ArgTypes, ArgTypes]]] = {
    "SetClosedLoopMaxFrequency": ((*_CHANNEL, _U), ()),
    "GetClosedLoopMaxFrequency": (_CHANNEL, (_U_OUT,)),
    "SetZero": (_CHANNEL, ()),
    "GetSensorPresent": (_CHANNEL, (_U_OUT,)),
    "SetSensorType": ((*_CHANNEL, _U), ()),
    "GetSensorType": (_CHANNEL, (_U_OUT,)),
    "SetPositionerAlignment": ((*_CHANNEL, _U, _U, _U), ()),
    "GetPositionerAlignment": (_CHANNEL, (_U_OUT, _U_OUT, _U_OUT)),
    "SetSafeDirection": ((*_CHANNEL, _U), ()),
    "GetSafeDirection": (_CHANNEL, (_U_OUT,)),
    "MoveStep": ((*_CHANNEL, _I, _U, _U), ()),
    "SetAmplitude": ((*_CHANNEL, _U), ()),
    "GetAmplitude": (_CHANNEL, (_U_OUT,)),
    "MovePositionAbsolute": ((*_CHANNEL, _I, _U), ()),
    "MovePositionRelative": ((*_CHANNEL, _I, _U), ()),
    "MoveAngleAbsolute": ((*_CHANNEL, _I, _I, _U), ()),
    "MoveAngleRelative": ((*_CHANNEL, _I, _I, _U), ()),
    "CalibrateSensor": (_CHANNEL, ()),
    "MoveToReference": ((*_CHANNEL, _U, _U), ()),
    "MoveToEndStop": ((*_CHANNEL, _U, _U, _U), ()),
    "Stop": (_CHANNEL, ()),
    "GetStatus": (_CHANNEL, (_U_OUT,)),
    "GetPosition": (_CHANNEL, (_I_OUT,)),
    "GetAngle": (_CHANNEL, (_I_OUT, _I_OUT)),
}
_PAIRS_LATER: Final[dict[str, tuple[ArgTypes, ArgTypes]]] = {
    "SetScale": ((*_CHANNEL, _I, _U), ()),
    "GetScale": (_CHANNEL, (_I_OUT, _U_OUT)),
    "GetPhysicalPositionKnown": (_CHANNEL, (_U_OUT,)),
    "SetChannelProperty": ((*_CHANNEL, _I, _I), ()),
    "GetChannelProperty": ((*_CHANNEL, _I), (_I_OUT,)),
    "SetSystemProperty": ((*_DEVICE, _I, _I), ()),
    "GetSystemProperty": ((*_DEVICE, _I), (_I_OUT,)),
}
_ONLY_A: Final[dict[str, ArgTypes]] = {
    "SA_SetReportOnComplete_A": (*_CHANNEL, _U),
    "SA_SetReceiveNotification_A": (*_DEVICE, c_void_p),
    "SA_ReceiveNextPacket_A": (*_DEVICE, _U, _PACKET_OUT),
    "SA_ReceiveNextPacketIfChannel_A": (*_CHANNEL, _U, _PACKET_OUT),
    "SA_LookAtNextPacket_A": (*_DEVICE, _U, _PACKET_OUT),
    "SA_DiscardPacket_A": _DEVICE,
}


def _both_forms(pairs: dict[str, tuple[ArgTypes, ArgTypes]]) -> dict[str, ArgTypes]:
    sync = {f"SA_{base}_S": (*given, *answers) for base, (given, answers) in pairs.items()}
    return sync | {f"SA_{base}_A": given for base, (given, _) in pairs.items()}


_V12: Final = _SECTION_I | _both_forms(_PAIRS_V12) | _ONLY_A
PROTOTYPES: Final[dict[str, ArgTypes]] = _V12 | _both_forms(_PAIRS_LATER)
"""All 77 functions of header 1.5 with their argument types; each returns a status, c_uint32."""
FUNCTIONS_V12: Final = frozenset(_V12)
"""The 63 functions of header 1.2 (2010)."""


@cache
def function_type(name: str) -> type[Any]:
    """Return the C function type of `name`, cdecl; the class makes pointers and callbacks.

    Raises
    ------
    KeyError
        The header declares no such function.
    """
    return ctypes.CFUNCTYPE(c_uint32, *PROTOTYPES[name])


def python_function(name: str, pointer: Any) -> Any:
    """Return the C function at `pointer`, which is written in Python, for callers in Python.

    A call into C lets go of the interpreter and has to win it back, twice where the function is
    Python itself, against every thread that computes. This one keeps it; where the function waits,
    it lets others run as any Python does.

    Raises
    ------
    KeyError
        The header declares no such function.
    """
    address = ctypes.cast(pointer, c_void_p).value or 0
    return ctypes.PYFUNCTYPE(c_uint32, *PROTOTYPES[name])(address)


class Scu3dLibrary(SmaractFunctions):
    """The functions of one SCU3DControl library, each bound when it is first called.

    Parameters
    ----------
    library : ctypes.CDLL or object
        A loaded library, or anything that has the C function pointers as attributes `SA_...`. One
        whose functions are Python says so by an attribute `in_python` that is true.

    Notes
    -----
    Any thread. An old library lacks functions; those answer like a device that lacks a command.
    """

    def call(self, name: str, *args: object) -> int:
        """Call `name` and return its status; 129 (command not supported) where it is missing.

        Raises
        ------
        KeyError
            The header declares no such function.
        """
        try:
            function = self._bound[name]
        except KeyError:
            function = self._function(name)
        return SA_COMMAND_NOT_SUPPORTED_ERROR if function is None else int(function(*args))

    @override
    def _bind(self, name: str) -> Callable[..., int] | None:
        prototype = function_type(name)
        if isinstance(self._library, ctypes.CDLL):
            try:
                pointer: Callable[..., int] = prototype((name, self._library))
            except AttributeError:
                return None
            return pointer
        found: Callable[..., int] | None = getattr(self._library, name, None)
        # A NULL pointer is false; calling it would end the process.
        if found and getattr(self._library, "in_python", False):
            kept: Callable[..., int] = python_function(name, found)
            return kept
        return found or None
