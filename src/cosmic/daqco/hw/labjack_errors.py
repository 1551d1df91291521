"""LJM's errors as CoSMic exceptions, by their numbers (LJM error codes, LabJack)."""

from typing import Any, Final

from cosmic.daqco.hw.board_errors import TOO_FAST, Beyond, ErrorTable, Status
from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotConnectedError,
)

LATE: Final = (
    "they were not fetched in time; close what slows the computer, choose longer chunks (chunk_s), "
    "a lower rate, or Ethernet in place of USB, and start again"
)


_F = DeviceFault
_GONE: Final = Status(
    _F.COMMUNICATION,
    "the board is gone; check its cable and power and that Kipling lists it, then start again",
    NotConnectedError,
)
_TAKEN: Final = Status(
    _F.STATE, "another program uses the board; close it (Kipling, LJStreamM), then try again"
)
_NO_ANSWER: Final = Status(
    _F.TIMEOUT,
    "the board did not answer in time; check cable and network, and where it waits for a trigger "
    "or an external clock, that they come",
    DeviceTimeout,
)
_LATE: Final = Status(_F.OVERRUN, LATE)
_SETTING: Final = Status(_F.PARAMETER, "the board does not accept a setting")
_OLD: Final = Status(_F.UNSUPPORTED, "the firmware of the board is too old; update it with Kipling")

STATUS: Final[dict[int, Status]] = {
    1202: _SETTING,
    1203: _SETTING,
    1206: _TAKEN,
    1222: Status(_F.UNSUPPORTED, "this kind of board cannot be used; T4, T7 and T8 can"),
    1224: _GONE,
    1226: _GONE,
    1227: _GONE,
    1230: _TAKEN,
    1231: _GONE,
    1233: _GONE,
    1236: _GONE,
    1239: _GONE,
    1240: _GONE,
    1241: _GONE,
    1261: _GONE,
    1262: _GONE,
    1263: _NO_ANSWER,
    1264: _NO_ANSWER,
    1301: _LATE,
    1302: Status(_F.OTHER, "the stream could not be started; restart the board, then try again"),
    1303: Status(_F.STATE, "the stream has ended; start again"),
    1306: _NO_ANSWER,
    1307: _OLD,
    1314: _GONE,
    1320: _LATE,
    2605: Status(_F.STATE, "another program streams from the board; end that, then try again"),
    2606: _SETTING,
    2607: Status(_F.PARAMETER, "an input cannot be streamed"),
    2613: Status(_F.PARAMETER, "the waveform is too long for the memory of the board"),
    2614: Status(_F.PARAMETER, "this output cannot play a waveform"),
    2615: Status(_F.PARAMETER, "the waveform is too long for the memory of the board"),
    2620: Status(_F.STATE, "the stream has ended; start again"),
    2621: _SETTING,
    2622: Status(_F.PARAMETER, "the waveform is too long for the memory of the board"),
}
_TOO_FAST: Final = Beyond(TOO_FAST, "Hz")
_TABLE: Final = ErrorTable(STATUS, {2608: _TOO_FAST, 2942: _TOO_FAST})


def board_error(exc: Any, call: str, board: str, *, lost: int | None = None) -> CosmicError:
    """Return the exception that says what an ``LJMError`` means, also for an unknown number.

    Parameters
    ----------
    exc : LJMError
        As the package raises it; without a number where the library itself is missing.
    call : str
        What was asked, as the operator may read it in the log.
    board : str
        Its name, or the driver's where none is concerned.
    lost : int or None
        How many samples of each channel were lost, where that is known.
    """
    code, said = exc.errorCode, str(exc.errorString).strip()
    if code is None:
        return DeviceError(f"{board}: {call} failed" + (f" (driver: {said})" if said else ""))
    return _TABLE.error(code, call, board, said=said, lost=lost)
