"""The operations of a bend test one by one, each as a procedure for a fibre that was pointed at."""

from cosmic.autonomy.handling.approach import Turn
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.grasp import Carry
from cosmic.autonomy.handling.manual_operations import (
    AtProbe,
    CarryBack,
    CloseGently,
    Held,
    LayBack,
    LiftUp,
    LookReady,
    PushToForce,
    StandOff,
)
from cosmic.autonomy.handling.marked import ChooseMarked, MarkedFibre
from cosmic.autonomy.handling.prepare import make_safe
from cosmic.autonomy.handling.push import NO_CONTACT, Retract, StepBack
from cosmic.autonomy.handling.put_away import Finish, GiveUp, NoteFailure
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.procedures.combinators import Fallback, Retry, Sequence
from cosmic.autonomy.procedures.procedure import Part, Procedure
from cosmic.autonomy.shipped.bend_test import PUSHES, beginning, grasped, measured, put_away


def build_take(settings: HandlingSettings, marked: MarkedFibre) -> Procedure[HandlingContext]:
    """Return what takes a marked fibre up; what is not calibrated yet is calibrated first."""
    prepare, _ = beginning(settings)
    taken = Fallback(
        "take it",
        Sequence("fibre", Turn(), grasped(settings), LiftUp()),
        Sequence("give up", NoteFailure(), put_away(), GiveUp()),
    )
    return _procedure(f"take with {settings.gripper}", prepare, ChooseMarked(marked), taken)


def build_bring() -> Procedure[HandlingContext]:
    """Return what brings the held fibre before the probe, which draws back first."""
    return _procedure("bring to the probe", Held(), Retract(), LookReady(), Carry())


def build_push(push: PushToForce) -> Procedure[HandlingContext]:
    """Return what pushes the held fibre to a force, and lets it go again."""
    met = Retry(push, PUSHES, only={NO_CONTACT}, between=StepBack())
    return _procedure(push.name, Held(), AtProbe(), met, StandOff())


def build_measure() -> Procedure[HandlingContext]:
    """Return what measures the bending stiffness of the held fibre."""
    return _procedure("measure", Held(), AtProbe(), measured(seen_after=False), StandOff())


def build_put_away() -> Procedure[HandlingContext]:
    """Return what puts the held fibre away, with the jaws seen to be empty at the end."""
    return _procedure("put away", Held(), LookReady(), put_away(), Finish())


def build_lay_back() -> Procedure[HandlingContext]:
    """Return what lays the held fibre where it was taken from."""
    return _procedure("lay it back", Held(), LookReady(), LayBack())


def build_carry_back() -> Procedure[HandlingContext]:
    """Return what brings the held fibre back from the probe; the probe draws back first."""
    return _procedure("carry it back", Held(), CarryBack())


def build_close_gently(closing: CloseGently) -> Procedure[HandlingContext]:
    """Return what closes the jaws slowly; nothing is moved to be safe when it ends early."""
    return Procedure(closing.name, Sequence(closing.name, closing))


def build_retract() -> Procedure[HandlingContext]:
    """Return what takes the probe away from the fibre, and moves nothing else."""
    return _procedure("retract the probe", Retract())


def _procedure(name: str, *parts: Part[HandlingContext]) -> Procedure[HandlingContext]:
    return Procedure(name, Sequence(name, *parts), make_safe=make_safe)
