"""What the numbers of a driver's errors mean, as CoSMic exceptions."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from cosmic.daqco.hw.interface import OverrunError
from cosmic.frame.errors import CosmicError, DeviceError, DeviceFault, LimitError
from cosmic.frame.verdict import Reason, refuse

TOO_FAST = "the board cannot make this rate with these inputs; choose another"


@dataclass(frozen=True, slots=True)
class Status:
    """What one error number of a driver means.

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


@dataclass(frozen=True, slots=True)
class Beyond:
    """A value that the board cannot make.

    Attributes
    ----------
    text : str
        Which, and what the operator can do.
    unit : str
        Of that value.
    """

    text: str
    unit: str


@dataclass(frozen=True, slots=True)
class ErrorTable:
    """The numbers of one driver.

    Attributes
    ----------
    status : mapping of int to Status
        What went wrong.
    beyond : mapping of int to Beyond
        What was asked of the board in vain.
    """

    status: Mapping[int, Status]
    beyond: Mapping[int, Beyond] = field(default_factory=dict)

    def error(
        self, code: int, call: str, board: str, *, said: str = "", lost: int | None = None
    ) -> CosmicError:
        """Return the exception for a number, also for an unknown one.

        Parameters
        ----------
        call : str
            What was asked, as the operator may read it in the log.
        board : str
            Its name, or the driver's where none is concerned.
        said : str
            The driver's own words.
        lost : int or None
            How many samples of each channel were lost, where that is known.
        """
        driver = f" (driver: {said})" if said else ""
        where = f"{board}: {call} answered {code}"
        beyond = self.beyond.get(code)
        if beyond is not None:
            text = f"{where}: {beyond.text}{driver}"
            return LimitError(refuse(Reason.LIMIT, text, axis=board, unit=beyond.unit))
        known = self.status.get(code)
        if known is None:
            return DeviceError(f"{where}, which CoSMic does not know{driver}", code=code)
        if known.fault is DeviceFault.OVERRUN:
            amount = "an unknown number of" if lost is None else lost
            text = f"{where}: {amount} samples of each channel were lost: {known.text}{driver}"
            return OverrunError(text, lost=lost, code=code)
        return known.kind(f"{where}: {known.text}{driver}", fault=known.fault, code=code)
