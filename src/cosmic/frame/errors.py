"""The one tree of exceptions; everything CoSMic raises on purpose is a `CosmicError`."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from enum import StrEnum

from typing_extensions import override

from cosmic.frame.verdict import MoveVerdict, Reason


class CosmicError(Exception):
    """Base of every failure that CoSMic foresees; its text is fit for the operator."""


class ConfigError(CosmicError):
    """A configuration file is broken; the text names file, key and reason, all at once."""


class PluginError(ConfigError):
    """What a package brings cannot be loaded; the text names both, and what happened."""


class ProtocolError(CosmicError):
    """A peer or a device spoke in a way its protocol does not allow."""


class NotAvailable(CosmicError):  # noqa: N818 - public name of the scripted API
    """An application, a device or a function is not built, not hosted or not there."""


class QuantityError(CosmicError, ValueError):
    """A text is not a number with a unit that fits."""


class UnknownAxisError(CosmicError, KeyError):
    """No axis of that name; the text lists those there are."""

    def __init__(self, name: object, known: Iterable[str]) -> None:
        self.text = f"there is no axis {name!r}; known axes: {', '.join(known) or 'none'}"
        super().__init__(self.text)

    @override
    def __str__(self) -> str:
        return self.text


class UnknownToolError(CosmicError, KeyError):
    """No tool of that name; the text lists those there are."""

    def __init__(self, name: object, known: Iterable[str]) -> None:
        self.text = f"there is no tool {name!r}; known tools: {', '.join(known) or 'none'}"
        super().__init__(self.text)

    @override
    def __str__(self) -> str:
        return self.text


class WrongThreadError(CosmicError):
    """A blocking call was made in the GUI thread, which must never wait."""


class OperationCancelled(CosmicError):  # noqa: N818 - reads as what happened
    """An operation was cancelled before its end, most often before it began."""


class MoveCancelled(CosmicError):  # noqa: N818 - reads as what happened
    """A movement ended before its target: cancelled, or replaced by a newer command."""


class ArgumentError(CosmicError, ValueError):
    """An argument has a value that nothing can be done with; the text names it."""


class RecordingError(CosmicError):
    """A recording cannot be written, read or exported; the text names the file and what to do."""


class RecordingExistsError(RecordingError, FileExistsError):
    """There is a file of that name already, and nobody said that it may go."""


class ExportCancelled(RecordingError):  # noqa: N818 - reads as what happened
    """An export was ended by whoever began it; nothing of it is left."""


class DeviceFault(StrEnum):
    """What went wrong at a device, in words that every vendor library shares."""

    END_STOP = "end stop reached"
    NO_CHANNEL = "no such channel"
    NO_SENSOR = "no sensor"
    WRONG_KIND = "wrong positioner type"
    OVERRIDDEN = "overridden by the hand control unit"
    OVERHEATED = "overheated"
    HIGH_VOLTAGE = "high voltage supply out of range"
    CALIBRATION = "calibration failed"
    REFERENCE = "referencing failed"
    BUSY = "not possible while moving"
    PARAMETER = "parameter not accepted"
    UNSUPPORTED = "not supported by this controller or library"
    COMMUNICATION = "communication with the controller failed"
    TIMEOUT = "no answer in time"
    STATE = "library not in the right state"
    OVERRUN = "samples were lost"
    OTHER = "unclassified failure"


class DeviceError(CosmicError):
    """A device refused or failed; the text names device, channel, call and answer.

    Attributes
    ----------
    fault : DeviceFault
        What went wrong, independent of the vendor.
    code : int or None
        The vendor's own status code.
    device, channel : int or None
        Where, both counted from zero.
    """

    def __init__(
        self,
        text: str,
        *,
        fault: DeviceFault = DeviceFault.OTHER,
        code: int | None = None,
        device: int | None = None,
        channel: int | None = None,
    ) -> None:
        super().__init__(text)
        self.fault = fault
        self.code = code
        self.device = device
        self.channel = channel


class DeviceTimeout(DeviceError):  # noqa: N818 - name fixed by the conventions
    """A device did not answer in time."""


class NotConnectedError(DeviceError):
    """A device or its library is not there."""


class MoveRefused(CosmicError):  # noqa: N818 - public name of the scripted API
    """The gate refused a movement; nothing was sent to the hardware.

    Attributes
    ----------
    verdict : MoveVerdict
        The gate's answer.
    """

    def __init__(self, verdict: MoveVerdict) -> None:
        super().__init__(str(verdict))
        self.verdict = verdict


class LimitError(MoveRefused):
    """The target lies outside the soft limits."""


class CollisionError(MoveRefused):
    """Two bodies would come closer than their margin."""


class StoppedError(MoveRefused):
    """The stop is latched, or ended this movement."""


_REFUSALS: dict[Reason, type[MoveRefused]] = {
    Reason.LIMIT: LimitError,
    Reason.COLLISION: CollisionError,
    Reason.STOPPED: StoppedError,
}


def needs_extra(what: str, extra: str) -> str:
    """Return the text for the operator where a package of an extra is missing.

    Parameters
    ----------
    what : str
        What cannot be done, as the subject of a sentence: "Recording video".
    """
    return f"{what} needs the extra {extra!r}: pip install cosmic[{extra}]"


def refusal(verdict: MoveVerdict) -> MoveRefused:
    """Return the exception that says `verdict`."""
    return _REFUSALS.get(verdict.reason, MoveRefused)(verdict)


@contextmanager
def only_cosmic_errors(whom: str) -> Iterator[None]:
    """Have whatever the code of another package raises leave as a `DeviceError` that names it.

    Such a package raises what it likes, and must take nothing else along.
    """
    try:
        yield
    except CosmicError:
        raise
    except Exception as exc:
        raise DeviceError(f"{whom}: {type(exc).__name__}: {exc}") from exc
