"""The bend test with two grippers: one measures while the other fetches and puts away."""

from collections.abc import Callable

from cosmic.autonomy.handling.approach import Turn
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.dual_gripper import (
    CarryInTurn,
    ChooseInTurn,
    ClearAway,
    DrawBack,
    EndRound,
    GoOn,
    SeeSides,
    StandBy,
    WipeInTurn,
    Withdraw,
    hidden,
    over,
)
from cosmic.autonomy.handling.plate_change import ChangePlate, PlateHandler
from cosmic.autonomy.handling.prepare import (
    InitialiseAgain,
    MakeReady,
    Register,
    make_safe,
)
from cosmic.autonomy.handling.push import Retract, SeeForce
from cosmic.autonomy.handling.put_away import (
    ADHESION,
    ClearUp,
    Finish,
    GiveUp,
    NoteFailure,
    Release,
    ToBin,
)
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.handling.standard import LookForStandard
from cosmic.autonomy.handling.survey import Survey
from cosmic.autonomy.handling.turning import FindRotationCentre
from cosmic.autonomy.procedures.combinators import (
    Fallback,
    Holding,
    Parallel,
    Repeat,
    Retry,
    Role,
    Sequence,
)
from cosmic.autonomy.procedures.procedure import Part, Procedure
from cosmic.autonomy.procedures.waits import Resource
from cosmic.autonomy.shipped.bend_test import RELEASES, grasped, measured, one_standard
from cosmic.autonomy.shipped.calibrate import calibrated

ARMS = ("left", "right")


def build_ping_pong(settings: HandlingSettings | None = None) -> Procedure[HandlingContext]:
    """Return the procedure for all fibres of a sample, until enough are done."""
    settings = settings or HandlingSettings()
    one_round = Sequence(
        "round",
        *_each(ClearAway()),
        _as(ARMS[0], Survey()),
        Parallel("both arms", *(_as(name, _fibres(settings)) for name in ARMS)),
        EndRound(),
    )
    return Procedure(
        "bend test with two grippers",
        Sequence(
            "bend test with two grippers",
            prepare(settings),
            Repeat(one_round, lambda work: work.shared.enough(), name="until none is left"),
        ),
        make_safe=make_safe,
    )


def build_standard_in_turn(settings: HandlingSettings | None = None) -> Procedure[HandlingContext]:
    """Return the procedure that bends the standard and puts it back, beside another arm."""
    settings = settings or HandlingSettings()
    return Procedure(
        "standard",
        Sequence(
            "standard",
            prepare(settings, LookForStandard()),
            *_each(ClearAway()),
            _as(ARMS[0], one_standard(settings, CarryInTurn(), Withdraw())),
        ),
        make_safe=make_safe,
    )


def build_plate_change_in_turn(
    settings: HandlingSettings | None,  # noqa: ARG001 - as the others are built
    handler: PlateHandler,
    plate: int,
) -> Procedure[HandlingContext]:
    """Return the procedure by which a handler puts another plate there, beside both arms."""
    return Procedure(
        "another plate",
        Sequence(
            "another plate",
            InitialiseAgain(),
            _as(ARMS[0], Retract()),
            *_each(ClearUp()),
            *_each(MakeReady()),
            ChangePlate(handler, plate),
        ),
        make_safe=make_safe,
    )


def _as(name: str, part: Part[HandlingContext]) -> Role[HandlingContext]:
    return Role(name, part, _arm(name))


def _each(part: Part[HandlingContext]) -> tuple[Role[HandlingContext], ...]:
    return tuple(_as(name, part) for name in ARMS)


def _arm(name: str) -> Callable[[HandlingContext], HandlingContext]:
    def arm(work: HandlingContext) -> HandlingContext:
        arms = {each: work.arm(each) for each in ARMS}
        return arms[name]

    return arm


def prepare(
    settings: HandlingSettings, survey: Part[HandlingContext] | None = None
) -> Part[HandlingContext]:
    """Return what comes before the fibres; each arm has calibrations of its own."""
    first, second = ARMS
    return Sequence(
        "prepare",
        InitialiseAgain(),
        _as(first, Retract()),
        *_each(ClearUp()),
        *_each(MakeReady()),
        *_each(Sequence("calibrate", *calibrated(settings), ClearAway())),
        _as(first, Sequence("look", Register(), survey or Survey(), FindRotationCentre())),
        _as(second, SeeSides(first)),
        _as(first, SeeForce()),
    )


def _fibres(settings: HandlingSettings) -> Part[HandlingContext]:
    """Return what one arm does until the round is over."""
    fetched = Holding(
        Sequence(
            "fetch",
            ChooseInTurn(),
            Holding(
                Sequence[HandlingContext]("take up", Turn(), grasped(settings)),
                _view,
                name="see it",
            ),
        ),
        _plate,
        leaving=DrawBack(),
        name="at the plate",
    )
    bent = Holding(
        Sequence[HandlingContext]("measure", CarryInTurn(), measured()),
        _probe,
        leaving=Withdraw(),
        name="at the probe",
    )
    one = Fallback(
        "one fibre",
        Sequence("fibre", fetched, StandBy(), bent, _put_away(), Finish()),
        Sequence("give up", NoteFailure(), _put_away(), GiveUp()),
        GoOn(),
    )
    return Repeat(one, over, name="fibre after fibre")


def _put_away() -> Part[HandlingContext]:
    wiped = Holding(WipeInTurn(), _plate, name="at the bin")
    return Sequence("put away", ToBin(), Retry(Release(), RELEASES, only={ADHESION}, between=wiped))


def _plate(work: HandlingContext) -> tuple[Resource, ...]:
    return (work.shared.plate,)


def _probe(work: HandlingContext) -> tuple[Resource, ...]:
    return (work.shared.probe,)


def _view(work: HandlingContext) -> tuple[Resource, ...]:
    """Return the position before the probe where whoever is there would hide the fibre."""
    return (work.shared.probe,) if hidden(work, work.held_fibre().reach) else ()
