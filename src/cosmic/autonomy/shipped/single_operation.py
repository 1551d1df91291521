"""One operation on a fibre: what is asked for, what it would do, and how it ended, in words."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from cosmic.autonomy.bending.result import BendingResult
from cosmic.autonomy.campaign.formatting import EI_LABEL, interval, stiffness, with_interval
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.handling.manual_operations import CloseGently, PushToForce
from cosmic.autonomy.handling.marked import MarkedFibre
from cosmic.autonomy.procedures.failures import STOPPED, ProcedureAborted, ProcedureStopped
from cosmic.autonomy.procedures.run import ProcedureRun

USUAL_FORCE_UN: Final = 50.0
IN_DOUBT: Final = "in doubt"
ENDED: Final = "ended"
"""What an operation is called that whoever watched over it has ended."""

Values = tuple[tuple[str, str], ...]
"""Of what was measured: a name, and the value with its 95 % interval and unit."""


class SingleOperation(StrEnum):
    """What can be done with a fibre by itself; the value is the word."""

    TAKE = "take"
    BRING = "bring to the probe"
    PUSH = "push"
    MEASURE = "measure"
    PUT_AWAY = "put away"
    UNDO = "undo"
    CLOSE = "close gently"


PUSHES: Final = frozenset({SingleOperation.PUSH, SingleOperation.MEASURE})
UNDO_WORDS: Final[Mapping[SingleOperation, str]] = {
    SingleOperation.TAKE: "The fibre is laid where it was taken from.",
    SingleOperation.BRING: "The probe draws back, then the fibre is carried back.",
    SingleOperation.PUSH: "The probe draws back from the fibre; nothing else moves.",
    SingleOperation.MEASURE: "The probe draws back from the fibre; nothing else moves.",
}


@dataclass(frozen=True, slots=True, eq=False)
class OperationRequest:
    """One operation that is wanted.

    Attributes
    ----------
    gripper : str
        Which one takes the fibre; every later operation is done with that one.
    force_un : float
        How far to push.
    marked : MarkedFibre or None
        The fibre to be taken.
    """

    operation: SingleOperation
    gripper: str = ""
    force_un: float = USUAL_FORCE_UN
    marked: MarkedFibre | None = None

    @property
    def title(self) -> str:
        """What it is called in the window."""
        if self.operation is SingleOperation.TAKE:
            return f"Take with {self.gripper}"
        if self.operation is SingleOperation.PUSH:
            return f"Push to {self.force_un:g} µN"
        return self.operation.value.capitalize()


@dataclass(frozen=True, slots=True)
class OperationResult:
    """How an operation ended.

    Attributes
    ----------
    good : bool
        It did what it should.
    text : str
        A sentence: what was found, or why it was refused or failed.
    values : tuple of (str, str)
        What was measured: a name, and the value with its 95 % interval and unit; of a replay, what
        it was given.
    interrupted : str
        "stopped" by the stop, "ended" by whoever watched over it, or "in doubt" where the jaws were
        opened by no operation; empty where it was none of them.
    """

    title: str
    good: bool
    text: str
    values: tuple[tuple[str, str], ...] = ()
    interrupted: str = ""


@dataclass(frozen=True, slots=True)
class OperationPreview:
    """What an operation would do.

    Attributes
    ----------
    text : str
        In a sentence.
    poses : tuple of mapping
        Where all axes would be, one after the other, from where they are now; um or deg.
    """

    text: str
    poses: tuple[Mapping[str, float], ...] = ()


def interruption(run: ProcedureRun[HandlingContext]) -> str:
    """Return what cut a run off, as `OperationResult.interrupted` has it; empty for nothing."""
    if isinstance(run.failure, ProcedureStopped):
        return STOPPED
    return ENDED if isinstance(run.failure, ProcedureAborted) else ""


def outcome(
    request: OperationRequest, work: HandlingContext, push: PushToForce, closing: CloseGently
) -> tuple[Values, str]:
    """Return what an operation that ended well has measured, and what it did, in a sentence."""
    if request.operation is SingleOperation.CLOSE:
        return _closed(work, closing)
    fibre, operation = work.fibre, request.operation
    if fibre is None:
        gone = "laid back" if operation is SingleOperation.UNDO else "put away"
        return (), f"The fibre is {gone}; {work.settings.gripper} is empty."
    if operation is SingleOperation.TAKE:
        return _size(fibre), f"{work.settings.gripper} holds fibre {fibre.number}."
    if operation is SingleOperation.BRING:
        return (("free length", f"{fibre.free_um:.0f} µm"),), "The fibre is before the probe."
    if operation is SingleOperation.PUSH and push.pushed is not None:
        return _pushed(push), f"The fibre pushed back with {push.pushed.force_un:.1f} µN."
    if operation is SingleOperation.MEASURE and fibre.bending is not None:
        return _stiffness(fibre.bending), "The bending stiffness is measured."
    return (), f"Taken back; {work.settings.gripper} still holds the fibre."


def _closed(work: HandlingContext, closing: CloseGently) -> tuple[Values, str]:
    state = work.mico[work.gripper.gap_axis].details
    opening = math.nan if state.position is None else state.position
    values = [("opening", f"{with_interval(opening, state.std)} µm")]
    text = "The jaws have made all their steps: they are closed, or hold what is between."
    if closing.felt_un is not None:
        values.append(("force", f"{closing.felt_un:+.1f} µN"))
        text = "Closing ended: a force was felt."
    return tuple(values), text


def _size(fibre: HeldFibre) -> Values:
    return (
        ("length", f"{with_interval(fibre.length_um, fibre.length_std_um)} µm"),
        ("width", f"{with_interval(fibre.width_um, fibre.width_std_um, 1)} µm"),
        ("curl", with_interval(fibre.curl, fibre.curl_std, 3)),
    )


def _pushed(push: PushToForce) -> Values:
    found = push.pushed
    if found is None:
        return ()
    return (
        ("force (noise)", f"{with_interval(found.force_un, found.force_std_un, 2)} µN"),
        ("bend", f"{found.bend_um:.1f} µm, span {found.span_um:.0f} µm"),
        ("stiffness", f"{with_interval(found.fit.k_un_um, found.fit.k_std_un_um, 2)} µN/µm"),
    )


def _stiffness(result: BendingResult) -> Values:
    if not math.isfinite(result.ei_n_m2):
        return ()
    bounds = interval(result.ei_low_n_m2, result.ei_high_n_m2)
    return (("EI", f"{stiffness(result.ei_n_m2)} ({bounds}, 95 %) {EI_LABEL}"),)


def untrusted(work: HandlingContext) -> Values:
    """Return what was measured of the held fibre and is not trusted; empty for nothing."""
    fibre = work.fibre
    if fibre is None or fibre.bending is None or fibre.bending.trusted:
        return ()
    return tuple((f"{name}, not trusted", value) for name, value in _stiffness(fibre.bending))
