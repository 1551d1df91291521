"""NI-DAQmx's errors as CoSMic exceptions."""

from dataclasses import dataclass
from typing import Final

from nidaqmx.errors import (
    DaqError,
    DaqFunctionNotSupportedError,
    DaqNotFoundError,
    DaqNotSupportedError,
    Error,
)

from cosmic.daqco.hw.interface import OverrunError
from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    LimitError,
    NotConnectedError,
)
from cosmic.frame.verdict import Reason, refuse


@dataclass(frozen=True, slots=True)
class Status:
    """What one error code of the driver means.

    Attributes
    ----------
    fault : DeviceFault
        The same in CoSMic's words.
    text : str
        What happened and what the operator can do.
    kind : type of DeviceError
        The exception that says it.
    """

    fault: DeviceFault
    text: str
    kind: type[DeviceError] = DeviceError


_F = DeviceFault
_GONE: Final = Status(
    _F.COMMUNICATION,
    "the board is gone; check its cable and power and that NI MAX lists it, then start again",
    NotConnectedError,
)
_OVERRUN: Final = Status(
    _F.OVERRUN,
    "they were not fetched in time; close what slows the computer, or lower the rate, and start "
    "again",
)
_OVERFLOW: Final = Status(
    _F.OVERRUN,
    "the memory on the board overflowed; lower the rate, use fewer inputs, or connect a USB "
    "board without a hub, and start again",
)
_TAKEN: Final = Status(
    _F.STATE,
    "another program uses the board; close it (NI MAX test panels, LabVIEW), then try again",
)
_SETTING: Final = Status(_F.PARAMETER, "the board does not accept a setting")

STATUS: Final[dict[int, Status]] = {
    -200279: _OVERRUN,
    -200222: _OVERRUN,
    -200361: _OVERFLOW,
    -200010: _OVERFLOW,
    -209829: _OVERFLOW,
    -200019: Status(
        _F.OVERRUN,
        "the converter was asked for them faster than it makes them; lower the rate, or check the "
        "external sample clock",
    ),
    -200284: Status(
        _F.TIMEOUT,
        "the samples did not come in time; where the sample clock comes from another board, check "
        "that this board runs and that the boards are joined by an RTSI cable",
        DeviceTimeout,
    ),
    -50103: _TAKEN,
    -200022: _TAKEN,
    -201105: _TAKEN,
    -200220: _GONE,
    -200324: _GONE,
    -201003: _GONE,
    -200045: _GONE,
    -200175: _GONE,
    -88705: _GONE,
    -88708: _GONE,
    -88709: _GONE,
    -88710: _GONE,
    -50405: _GONE,
    -50401: _GONE,
    -201190: Status(_F.COMMUNICATION, "unplug the board and plug it in again", NotConnectedError),
    -200170: Status(_F.NO_CHANNEL, "the board has no such input"),
    -200489: Status(_F.PARAMETER, "an input is used twice"),
    -200077: _SETTING,
    -200082: _SETTING,
    -200452: _SETTING,
    -89120: Status(
        _F.PARAMETER, "there is no such terminal for the sample clock; correct clock_source"
    ),
    -89137: Status(
        _F.STATE, "the line for the sample clock is taken by another task; end that first"
    ),
    -200981: Status(
        _F.UNSUPPORTED, "this board cannot tell when samples have come; CoSMic cannot use it"
    ),
    -200970: Status(
        _F.PARAMETER, "this board needs an even number of samples in a chunk; change chunk_s"
    ),
    -50352: Status(_F.OTHER, "the driver has no memory left; close other programs"),
}
_TOO_FAST: Final = (-200332, -200335, -200331, -200081)
_OUT_OF_RANGE: Final = (-200579, -200580, -200695)
_BEYOND_OUTPUT: Final = (-200561,)


def driver_missing() -> NotConnectedError:
    """Return the exception for a computer without the driver."""
    return NotConnectedError(
        "the NI-DAQmx driver is not installed on this computer. Install NI-DAQmx from ni.com "
        "(Windows, or one of the Linux distributions that NI lists), start the computer again, and "
        'see that NI MAX or "nilsdev" lists the board. The simulated boards need no driver: '
        'backend = "simulated" in platform.toml, [daqco]',
        fault=DeviceFault.COMMUNICATION,
    )


def board_error(exc: Error, call: str, board: str, *, lost: int | None = None) -> CosmicError:
    """Return the exception that says what the driver's `exc` means.

    Parameters
    ----------
    call : str
        What was asked, as the operator may read it in the log.
    board : str
        Its name, or the driver's where none is concerned.
    lost : int or None
        How many samples of each channel were lost, where that is known.
    """
    if isinstance(exc, DaqNotFoundError):
        return driver_missing()
    if isinstance(exc, DaqNotSupportedError):
        return NotConnectedError(
            f"{board}: {call}: NI-DAQmx does not exist for this operating system: {_first(exc)}",
            fault=DeviceFault.UNSUPPORTED,
        )
    if isinstance(exc, DaqFunctionNotSupportedError):
        return DeviceError(
            f"{board}: {call}: the installed NI-DAQmx is too old; update it: {_first(exc)}",
            fault=DeviceFault.UNSUPPORTED,
        )
    if isinstance(exc, DaqError):
        return status_error(exc.error_code, call, board, said=_first(exc), lost=lost)
    return DeviceError(f"{board}: {call} failed: {_first(exc)}")


def status_error(
    code: int, call: str, board: str, *, said: str = "", lost: int | None = None
) -> CosmicError:
    """Return the exception for the driver's error `code`, also for an unknown one.

    Parameters
    ----------
    said : str
        The driver's own words.
    lost : int or None
        How many samples of each channel were lost, where that is known.
    """
    driver = f" (driver: {said})" if said else ""
    where = f"{board}: {call} answered {code}"
    if code in _TOO_FAST:
        text = f"{where}: the board cannot make this rate with these inputs; choose another{driver}"
        return LimitError(refuse(Reason.LIMIT, text, axis=board, unit="Hz"))
    if code in _OUT_OF_RANGE:
        text = f"{where}: the board has no such input range{driver}"
        return LimitError(refuse(Reason.LIMIT, text, axis=board, unit="V"))
    if code in _BEYOND_OUTPUT:
        text = f"{where}: the value lies outside the limits of this output{driver}"
        return LimitError(refuse(Reason.LIMIT, text, axis=board, unit="V"))
    known = STATUS.get(code)
    if known is None:
        return DeviceError(f"{where}, which CoSMic does not know{driver}", code=code)
    text = known.text
    if known.fault is DeviceFault.OVERRUN:
        amount = "an unknown number of" if lost is None else lost
        text = f"{amount} samples of each channel were lost: {text}"
        return OverrunError(f"{where}: {text}{driver}", lost=lost, code=code)
    return known.kind(f"{where}: {text}{driver}", fault=known.fault, code=code)


def _first(exc: Exception) -> str:
    lines = str(exc).strip().splitlines()
    return lines[0] if lines else type(exc).__name__
