"""SCU3DControl's status codes as CoSMic exceptions."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from cosmic.frame.errors import DeviceError, DeviceFault, DeviceTimeout, NotConnectedError
from cosmic.mico.hw.addresses import where
from cosmic.mico.hw.interface import Serial
from cosmic.mico.hw.scu3d_ctypes import SA_DEVICE_NOT_FOUND_ERROR, SA_NO_DEVICES_FOUND_ERROR


@dataclass(frozen=True, slots=True)
class Status:
    """What one status code of the header means.

    Attributes
    ----------
    name : str
        The header's name, without "SA_".
    fault : DeviceFault
        The same in CoSMic's words.
    text : str
        What happened and, where it is known, what the operator can do.
    kind : type of DeviceError
        The exception that says it.
    """

    name: str
    fault: DeviceFault
    text: str
    kind: type[DeviceError] = DeviceError


_F = DeviceFault
_CABLE = "check the USB cable and the controller's power, then search for devices again"

# MCS uses the same names with other numbers from 128 up; never share this table.
STATUS: Final[dict[int, Status]] = {
    1: Status(
        "INITIALIZATION_ERROR",
        _F.COMMUNICATION,
        "the library could not be initialised; is another program using the controller?",
    ),
    2: Status("NOT_INITIALIZED_ERROR", _F.STATE, "no device is open"),
    3: Status(
        "NO_DEVICES_FOUND_ERROR",
        _F.COMMUNICATION,
        f"no controller was found; {_CABLE}",
        NotConnectedError,
    ),
    4: Status("TOO_MANY_DEVICES_ERROR", _F.STATE, "too many controllers are connected"),
    5: Status("INVALID_DEVICE_INDEX_ERROR", _F.NO_CHANNEL, "there is no such device"),
    6: Status("INVALID_CHANNEL_INDEX_ERROR", _F.NO_CHANNEL, "the device has no such channel"),
    7: Status("TRANSMIT_ERROR", _F.COMMUNICATION, f"nothing could be sent; {_CABLE}"),
    8: Status("WRITE_ERROR", _F.COMMUNICATION, f"writing failed; {_CABLE}"),
    9: Status("INVALID_PARAMETER_ERROR", _F.PARAMETER, "a value was not accepted"),
    10: Status("READ_ERROR", _F.COMMUNICATION, f"reading failed; {_CABLE}"),
    12: Status("INTERNAL_ERROR", _F.OTHER, "the library failed inside; restart the program"),
    13: Status("WRONG_MODE_ERROR", _F.STATE, "the call does not fit the communication mode"),
    14: Status("PROTOCOL_ERROR", _F.COMMUNICATION, f"the answer was garbled; {_CABLE}"),
    15: Status("TIMEOUT_ERROR", _F.TIMEOUT, f"no answer in time; {_CABLE}", DeviceTimeout),
    16: Status("NOTIFICATION_ALREADY_SET_ERROR", _F.STATE, "an event is already registered"),
    17: Status("ID_LIST_TOO_SMALL_ERROR", _F.PARAMETER, "the list of devices was too short"),
    18: Status("DEVICE_ALREADY_ADDED_ERROR", _F.STATE, "the device is already in the list"),
    19: Status(
        "DEVICE_NOT_FOUND_ERROR",
        _F.COMMUNICATION,
        f"the device is not connected; {_CABLE}",
        NotConnectedError,
    ),
    128: Status("INVALID_COMMAND_ERROR", _F.UNSUPPORTED, "the controller knows no such command"),
    129: Status(
        "COMMAND_NOT_SUPPORTED_ERROR",
        _F.UNSUPPORTED,
        "this controller or this version of the library cannot do that",
    ),
    130: Status("NO_SENSOR_PRESENT_ERROR", _F.NO_SENSOR, "the positioner has no sensor"),
    131: Status(
        "WRONG_SENSOR_TYPE_ERROR",
        _F.WRONG_KIND,
        "the command does not fit the positioner type (linear or rotary)",
    ),
    132: Status("END_STOP_REACHED_ERROR", _F.END_STOP, "the positioner ran into its end stop"),
    133: Status(
        "COMMAND_OVERRIDDEN_ERROR", _F.OVERRIDDEN, "somebody used the hand control unit meanwhile"
    ),
    134: Status(
        "HV_RANGE_ERROR",
        _F.HIGH_VOLTAGE,
        "the high voltage supply is out of range and all motion is off; switch the controller "
        "off and on again, then reference anew",
    ),
    135: Status(
        "TEMP_OVERHEAT_ERROR", _F.OVERHEATED, "the controller is too hot; it resumes by itself"
    ),
    136: Status(
        "CALIBRATION_FAILED_ERROR",
        _F.CALIBRATION,
        "calibration failed; move the positioner away from its end stop and try again",
    ),
    137: Status(
        "REFERENCING_FAILED_ERROR",
        _F.REFERENCE,
        "no reference was found; check that nothing blocks the positioner, then calibrate it",
    ),
    138: Status("NOT_PROCESSABLE_ERROR", _F.BUSY, "not possible now; wait until it has stopped"),
    255: Status("OTHER_ERROR", _F.OTHER, "the library gives no reason"),
}


LIBRARY: Final = "SCU3DControl"


def status_error(
    code: int,
    call: str,
    *,
    device: int | None = None,
    channel: int | None = None,
    serial: Serial | None = None,
) -> DeviceError:
    """Return the exception for the status `code`, also for a code that nobody documented.

    Parameters
    ----------
    code : int
        What the library returned, or what an error packet carried.
    call : str
        What was asked, as the operator may read it in the log.
    device, channel : int or None
        Where, both counted from zero.
    serial : int or None
        What is printed on that device.
    """
    at = where(device, channel, serial=serial, none=LIBRARY)
    known = STATUS.get(code)
    if known is None:
        text = f"{at}: {call} answered with the unknown status {code}"
        return DeviceError(text, code=code, device=device, channel=channel)
    text = f"{at}: {call} answered {code} (SA_{known.name}): {known.text}"
    return known.kind(text, fault=known.fault, code=code, device=device, channel=channel)


def nothing_found(call: str) -> DeviceError:
    """Return the exception for a call that finds no device at all."""
    # An empty list and the status for it are the same to the operator.
    return status_error(SA_NO_DEVICES_FOUND_ERROR, call)


def require_serials(wanted: Sequence[Serial], found: Sequence[Serial]) -> None:
    """Raise `NotConnectedError` where one of the serial numbers `wanted` was not found."""
    missing = [serial for serial in wanted if serial not in found]
    if missing:
        raise NotConnectedError(
            f"{LIBRARY}: no device with serial number {', '.join(map(str, missing))}; "
            f"connected: {', '.join(map(str, found)) or 'none'}",
            fault=DeviceFault.COMMUNICATION,
            code=SA_DEVICE_NOT_FOUND_ERROR,
        )
