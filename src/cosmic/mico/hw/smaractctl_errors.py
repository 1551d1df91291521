"""SmarActCTL's results as CoSMic's exceptions, in one function; unknown ones still raise."""

from dataclasses import dataclass
from typing import Final

from cosmic.frame.errors import DeviceError, DeviceFault, DeviceTimeout, NotConnectedError
from cosmic.mico.hw.addresses import where
from cosmic.mico.hw.interface import Serial

_F = DeviceFault
_CABLE: Final = "check power and cable, then rescan"


@dataclass(frozen=True, slots=True)
class Result:
    """What one result of the library means."""

    name: str
    fault: DeviceFault
    text: str
    kind: type[DeviceError] = DeviceError


RESULTS: Final[dict[int, Result]] = {
    0x0004: Result("TIMEOUT", _F.TIMEOUT, f"no answer in time; {_CABLE}", DeviceTimeout),
    0x0012: Result("INVALID_KEY", _F.UNSUPPORTED, "the controller knows no such property"),
    0x0013: Result("INVALID_PARAMETER", _F.PARAMETER, "a value was not accepted"),
    0x0016: Result("INVALID_DATA_TYPE", _F.OTHER, "the property has another type"),
    0x0019: Result("ABORTED", _F.OTHER, "the movement was stopped"),
    0x0020: Result("INVALID_DEVICE_INDEX", _F.NO_CHANNEL, "there is no such device"),
    0x0021: Result("INVALID_MODULE_INDEX", _F.NO_CHANNEL, "the device has no such module"),
    0x0022: Result("INVALID_CHANNEL_INDEX", _F.NO_CHANNEL, "the device has no such channel"),
    0x0023: Result("PERMISSION_DENIED", _F.UNSUPPORTED, "the property can only be read"),
    0x0024: Result("COMMAND_NOT_GROUPABLE", _F.UNSUPPORTED, "not possible within a group"),
    0x0025: Result(
        "MOVEMENT_LOCKED", _F.BUSY, "the emergency stop is active; release it, then try again"
    ),
    0x0103: Result("NO_SENSOR_PRESENT", _F.NO_SENSOR, "the positioner has no sensor"),
    0x0104: Result("SENSOR_DISABLED", _F.NO_SENSOR, "the sensor is switched off"),
    0x0105: Result(
        "POWER_SUPPLY_DISABLED", _F.HIGH_VOLTAGE, "the power supply of the module is off"
    ),
    0x0106: Result("AMPLIFIER_DISABLED", _F.STATE, "the amplifier of the channel is off"),
    0x0110: Result(
        "MOVEMENT_OVERRIDDEN", _F.OVERRIDDEN, "somebody used the hand control module meanwhile"
    ),
    0x0111: Result("NOT_CALIBRATED", _F.CALIBRATION, "the positioner is not calibrated"),
    0x0112: Result("NOT_REFERENCED", _F.REFERENCE, "the position is not referenced"),
    0x0115: Result("CONTROL_LOOP_INPUT_DISABLED", _F.STATE, "the control loop is switched off"),
    0x0150: Result("BUSY_MOVING", _F.BUSY, "not possible now; wait until it has stopped"),
    0x0151: Result("BUSY_CALIBRATING", _F.BUSY, "it is calibrating; wait until it has ended"),
    0x0152: Result("BUSY_REFERENCING", _F.BUSY, "it is referencing; wait until it has ended"),
    0x0200: Result("END_STOP_REACHED", _F.END_STOP, "the positioner ran into its end stop"),
    0x0201: Result(
        "FOLLOWING_ERR_LIMIT",
        _F.OTHER,
        "the positioner could not follow at this speed; move more slowly",
    ),
    0x0202: Result(
        "RANGE_LIMIT_REACHED", _F.END_STOP, "the range limit stored in the controller was reached"
    ),
    0x0203: Result("POSITIONER_OVERLOAD", _F.OVERHEATED, "the positioner draws too much current"),
    0x0206: Result(
        "OVER_TEMPERATURE", _F.OVERHEATED, "the controller is too hot; it resumes by itself"
    ),
    0x0208: Result("POWER_SUPPLY_OVERLOAD", _F.HIGH_VOLTAGE, "the supply is overloaded"),
    0x0303: Result("BUSY_STREAMING", _F.BUSY, "a stream is running"),
    0x0500: Result("INTERNAL_COMMUNICATION", _F.COMMUNICATION, "the device failed inside"),
    0x7FFD: Result("FEATURE_NOT_SUPPORTED", _F.UNSUPPORTED, "this device cannot do that"),
    0x7FFE: Result("FEATURE_NOT_IMPLEMENTED", _F.UNSUPPORTED, "this library cannot do that"),
    0xF000: Result("DEVICE_LIMIT_REACHED", _F.STATE, "too many devices are open"),
    0xF001: Result("INVALID_LOCATOR", _F.PARAMETER, "the locator cannot be read"),
    0xF002: Result(
        "INITIALIZATION_FAILED", _F.STATE, "another program uses the device; close that first"
    ),
    0xF004: Result(
        "COMMUNICATION_FAILED",
        _F.COMMUNICATION,
        f"the device does not answer; {_CABLE}",
        NotConnectedError,
    ),
    0xF006: Result("INVALID_QUERYBUFFER_SIZE", _F.PARAMETER, "the buffer is too small"),
    0xF007: Result("INVALID_DEVICE_HANDLE", _F.STATE, "the device is not open"),
    0xF008: Result("INVALID_TRANSMIT_HANDLE", _F.STATE, "there is no such buffer or group"),
    0xF010: Result("CANCELED", _F.STATE, "the wait was cancelled"),
    0xF013: Result("DRIVER_FAILED", _F.COMMUNICATION, "the USB driver failed"),
    0xF016: Result("BUFFER_LIMIT_REACHED", _F.STATE, "too many questions wait for answers"),
    0xF019: Result("BUFFER_EMPTY", _F.STATE, "the group has no commands"),
    0xF01A: Result(
        "DEVICE_NOT_FOUND",
        _F.COMMUNICATION,
        f"the device is not connected; {_CABLE}",
        NotConnectedError,
    ),
    0xF01B: Result("THREAD_LIMIT_REACHED", _F.STATE, "another thread waits for events already"),
}


LIBRARY: Final = "SmarActCTL"


def result_error(
    code: int,
    call: str,
    *,
    device: int | None = None,
    channel: int | None = None,
    serial: Serial | None = None,
) -> DeviceError:
    """Return the exception for the result `code`, also for one that nobody documented.

    Parameters
    ----------
    call : str
        What was asked, as the operator may read it in the log.
    device, channel : int or None
        Where, both counted from zero.
    """
    at = where(device, channel, serial=serial, none=LIBRARY)
    known = RESULTS.get(code)
    if known is None:
        text = f"{at}: {call} answered with the unknown result {code:#06x}"
        return DeviceError(text, code=code, device=device, channel=channel)
    text = f"{at}: {call} answered {code:#06x} (SA_CTL_ERROR_{known.name}): {known.text}"
    return known.kind(text, fault=known.fault, code=code, device=device, channel=channel)
