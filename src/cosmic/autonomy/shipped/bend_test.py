"""The bend test: a fibre is taken up, pushed as a cantilever at several spans, and put away."""

from cosmic.autonomy.handling.force_ready import SeeForce
from cosmic.autonomy.handling.grasp import MISSED, Carry, TestGrasp
from cosmic.autonomy.handling.initialise import InitialiseAgain
from cosmic.autonomy.handling.one_span import NO_CONTACT
from cosmic.autonomy.handling.prepare import MakeReady
from cosmic.autonomy.handling.push import NOT_TRUSTED, FitSpans, PushSpans, StepBack
from cosmic.autonomy.handling.put_away import (
    ADHESION,
    ClearUp,
    Finish,
    GiveUp,
    NoteFailure,
    Release,
    ToBin,
    Wipe,
)
from cosmic.autonomy.handling.reach import (
    TIP_NOT_SEEN,
    Approach,
    CloseJaws,
    FindAgain,
    Refine,
    Shift,
    Turn,
)
from cosmic.autonomy.handling.safe import make_safe
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.handling.survey import LOOK_AGAIN, Choose, Survey
from cosmic.autonomy.handling.turning import FindRotationCentre
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.combinators import Fallback, Retry, Sequence
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.procedures.walk import Part
from cosmic.autonomy.shipped.calibrate import calibrated

RELEASES = 4
PUSHES = 3


def build_bend_test(settings: HandlingSettings | None = None) -> Procedure[FibreWork]:
    """Return the procedure for one fibre; run it again for the next, on the same work."""
    settings = settings or HandlingSettings()
    return Procedure(
        "bend test",
        Sequence("bend test", *beginning(settings, SeeForce()), one_fibre(settings, measured())),
        make_safe=make_safe,
    )


def beginning(settings: HandlingSettings, *more: Part[FibreWork]) -> tuple[Part[FibreWork], ...]:
    """Return what comes before a fibre, `more` included; little of it where all is fresh."""
    return (
        Sequence(
            "prepare",
            InitialiseAgain(),
            ClearUp(),
            MakeReady(),
            *calibrated(settings),
            Survey(),
            FindRotationCentre(),
            *more,
        ),
        Retry(Sequence[FibreWork]("choose", Survey(), Choose()), 2, only={LOOK_AGAIN}),
    )


def one_fibre(settings: HandlingSettings, treated: Part[FibreWork]) -> Part[FibreWork]:
    """Return the way of one fibre from the plate by `treated` to the bin, whatever happens."""
    return Fallback(
        "one fibre",
        Sequence("fibre", Turn(), grasped(settings), Carry(), treated, put_away(), Finish()),
        Sequence("give up", NoteFailure(), put_away(), GiveUp()),
    )


def measured() -> Part[FibreWork]:
    """Return the measurement of a fibre that is held before the probe."""
    return Retry(
        Sequence[FibreWork]("measure", PushSpans(), FitSpans()),
        PUSHES,
        only={NO_CONTACT, NOT_TRUSTED},
        between=StepBack(),
    )


def grasped(settings: HandlingSettings) -> Part[FibreWork]:
    """Return the grasp of a fibre that the table has turned into place."""
    return Retry(
        Sequence[FibreWork]("grasp", FindAgain(), Approach(), Refine(), CloseJaws(), TestGrasp()),
        settings.grasp.tries,
        only={MISSED, TIP_NOT_SEEN},
        between=Shift(),
    )


def put_away() -> Part[FibreWork]:
    """Return the way to the bin, with the jaws seen to be empty at the end."""
    released = Retry(Release(), RELEASES, only={ADHESION}, between=Wipe())
    return Sequence("put away", ToBin(), released)
