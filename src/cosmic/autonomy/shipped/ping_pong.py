"""The bend test with two hands: one measures while the other fetches and puts away."""

from collections.abc import Callable

from cosmic.autonomy.handling.force_ready import SeeForce
from cosmic.autonomy.handling.in_turn import (
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
from cosmic.autonomy.handling.initialise import InitialiseAgain
from cosmic.autonomy.handling.prepare import (
    MakeReady,
)
from cosmic.autonomy.handling.push import Retract
from cosmic.autonomy.handling.put_away import (
    ADHESION,
    ClearUp,
    Finish,
    GiveUp,
    NoteFailure,
    Release,
    ToBin,
)
from cosmic.autonomy.handling.reach import Turn
from cosmic.autonomy.handling.safe import make_safe
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.handling.survey import Survey
from cosmic.autonomy.handling.turning import FindRotationCentre
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.combinators import Fallback, Parallel, Repeat, Retry, Sequence
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.procedures.resources import Resource
from cosmic.autonomy.procedures.sharing import Holding, Role
from cosmic.autonomy.procedures.walk import Part
from cosmic.autonomy.shipped.bend_test import RELEASES, grasped, measured
from cosmic.autonomy.shipped.calibrate import calibrated

HANDS = ("left", "right")


def build_ping_pong(settings: HandlingSettings | None = None) -> Procedure[FibreWork]:
    """Return the procedure for all fibres of a sample, until the bench says that it is enough."""
    settings = settings or HandlingSettings()
    one_round = Sequence(
        "round",
        *_each(ClearAway()),
        _as(HANDS[0], Survey()),
        Parallel("both hands", *(_as(name, _fibres(settings)) for name in HANDS)),
        EndRound(),
    )
    return Procedure(
        "bend test with two hands",
        Sequence(
            "bend test with two hands",
            prepare(settings),
            Repeat(one_round, lambda work: work.bench.enough(), name="until none is left"),
        ),
        make_safe=make_safe,
    )


def _as(name: str, part: Part[FibreWork]) -> Role[FibreWork]:
    return Role(name, part, _hand(name))


def _each(part: Part[FibreWork]) -> tuple[Role[FibreWork], ...]:
    return tuple(_as(name, part) for name in HANDS)


def _hand(name: str) -> Callable[[FibreWork], FibreWork]:
    def hand(work: FibreWork) -> FibreWork:
        hands = {each: work.hand(each) for each in HANDS}
        return hands[name]

    return hand


def prepare(settings: HandlingSettings) -> Part[FibreWork]:
    """Return what comes before the fibres; each hand has calibrations of its own."""
    first, second = HANDS
    return Sequence(
        "prepare",
        InitialiseAgain(),
        _as(first, Retract()),
        *_each(ClearUp()),
        *_each(MakeReady()),
        *_each(Sequence("calibrate", *calibrated(settings), ClearAway())),
        _as(first, Sequence("look", Survey(), FindRotationCentre())),
        _as(second, SeeSides(first)),
        _as(first, SeeForce()),
    )


def _fibres(settings: HandlingSettings) -> Part[FibreWork]:
    """Return what one hand does until the round is over."""
    fetched = Holding(
        Sequence(
            "fetch",
            ChooseInTurn(),
            Holding(
                Sequence[FibreWork]("take up", Turn(), grasped(settings)), _view, name="see it"
            ),
        ),
        _plate,
        leaving=DrawBack(),
        name="at the plate",
    )
    bent = Holding(
        Sequence[FibreWork]("measure", CarryInTurn(), measured()),
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


def _put_away() -> Part[FibreWork]:
    wiped = Holding(WipeInTurn(), _plate, name="at the bin")
    return Sequence("put away", ToBin(), Retry(Release(), RELEASES, only={ADHESION}, between=wiped))


def _plate(work: FibreWork) -> tuple[Resource, ...]:
    return (work.bench.plate,)


def _probe(work: FibreWork) -> tuple[Resource, ...]:
    return (work.bench.probe,)


def _view(work: FibreWork) -> tuple[Resource, ...]:
    """Return the place before the probe where whoever is there would hide the fibre."""
    return (work.bench.probe,) if hidden(work, work.in_hand().reach) else ()
