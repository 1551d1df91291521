"""NI-DAQmx's errors as CoSMic exceptions."""

from typing import Final

from nidaqmx.errors import (
    DaqError,
    DaqFunctionNotSupportedError,
    DaqNotFoundError,
    DaqNotSupportedError,
    Error,
)

from cosmic.daqco.hw.board_errors import TOO_FAST, Beyond, ErrorTable, Status
from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotConnectedError,
)

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
_TOO_FAST: Final = Beyond(TOO_FAST, "Hz")
_OUT_OF_RANGE: Final = Beyond("the board has no such input range", "V")
_BEYOND_OUTPUT: Final = Beyond("the value lies outside the limits of this output", "V")
TABLE: Final = ErrorTable(
    STATUS,
    dict.fromkeys((-200332, -200335, -200331, -200081), _TOO_FAST)
    | dict.fromkeys((-200579, -200580, -200695), _OUT_OF_RANGE)
    | {-200561: _BEYOND_OUTPUT},
)


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
        return TABLE.error(exc.error_code, call, board, said=_first(exc), lost=lost)
    return DeviceError(f"{board}: {call} failed: {_first(exc)}")


def _first(exc: Exception) -> str:
    lines = str(exc).strip().splitlines()
    return lines[0] if lines else type(exc).__name__
