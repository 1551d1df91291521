"""The bend test: take a fibre up, push it as a cantilever at several spans, put it away.

The transport goes the same way and measures nothing.
"""

from cosmic.autonomy.handling.approach import (
    TIP_NOT_SEEN,
    Approach,
    CloseJaws,
    FindAgain,
    Refine,
    Shift,
    Turn,
)
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.grasp import MISSED, Carry, TestGrasp
from cosmic.autonomy.handling.guided_move import OUT_OF_SIGHT, STRAYED
from cosmic.autonomy.handling.plate_change import ChangePlate, PlateHandler
from cosmic.autonomy.handling.prepare import InitialiseAgain, MakeReady, make_safe
from cosmic.autonomy.handling.push import (
    NO_CONTACT,
    NOT_TRUSTED,
    FitSpans,
    PushSpans,
    SeeForce,
    StepBack,
)
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
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.handling.standard import (
    NO_STANDARD,
    CarryStandardBack,
    ChooseStandard,
    LeaveStandard,
    LookForStandard,
    WipeAtHome,
)
from cosmic.autonomy.handling.survey import LOOK_AGAIN, Choose, Survey
from cosmic.autonomy.handling.turning import FindRotationCentre
from cosmic.autonomy.procedures.combinators import Fallback, Retry, Sequence
from cosmic.autonomy.procedures.procedure import Part, Procedure
from cosmic.autonomy.shipped.calibrate import calibrated

RELEASES = 4
PUSHES = 3
"""As level, lower, and higher: a fibre may point up or down."""
MEASUREMENTS = 2
"""A grip that gave way may hold the second time; what a model does not fit it fits no better."""
LOOKS = 2


def build_bend_test(settings: HandlingSettings | None = None) -> Procedure[HandlingContext]:
    """Return the procedure for one fibre; run it again for the next, on the same work."""
    settings = settings or HandlingSettings()
    return Procedure(
        "bend test",
        Sequence("bend test", *beginning(settings, SeeForce()), one_fibre(settings, measured())),
        make_safe=make_safe,
    )


def beginning(
    settings: HandlingSettings, *more: Part[HandlingContext]
) -> tuple[Part[HandlingContext], ...]:
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
        Retry(Sequence[HandlingContext]("choose", Survey(), Choose()), 2, only={LOOK_AGAIN}),
    )


def one_fibre(settings: HandlingSettings, treated: Part[HandlingContext]) -> Part[HandlingContext]:
    """Return the way of one fibre from the plate by `treated` to the bin, whatever happens."""
    return Fallback(
        "one fibre",
        Sequence("fibre", Turn(), grasped(settings), Carry(), treated, put_away(), Finish()),
        Sequence("give up", NoteFailure(), put_away(), GiveUp()),
    )


def measured(pushes: int = PUSHES, *, seen_after: bool = True) -> Part[HandlingContext]:
    """Return the measurement of a fibre that is held before the probe.

    Where it is to be seen afterwards, it is given up when the camera stays lost meanwhile.
    """
    push = PushSpans(seen_after=seen_after)
    pushed = Retry(push, pushes, only={NO_CONTACT}, between=StepBack())
    return Retry(
        Sequence("measure", pushed, FitSpans()),
        MEASUREMENTS,
        only={NOT_TRUSTED},
        between=StepBack(),
    )


def grasped(settings: HandlingSettings) -> Part[HandlingContext]:
    """Return the grasp of a fibre that the table has turned into place."""
    return Retry(
        Sequence[HandlingContext](
            "grasp", FindAgain(), Approach(), Refine(), CloseJaws(), TestGrasp()
        ),
        settings.grasp.tries,
        only={MISSED, TIP_NOT_SEEN, OUT_OF_SIGHT, STRAYED},
        between=Shift(),
    )


def put_away() -> Part[HandlingContext]:
    """Return the way to the bin, with the jaws seen to be empty at the end."""
    released = Retry(Release(), RELEASES, only={ADHESION}, between=Wipe())
    return Sequence("put away", ToBin(), released)


def build_standard(settings: HandlingSettings | None = None) -> Procedure[HandlingContext]:
    """Return the procedure that bends the standard and puts it back, with one gripper."""
    settings = settings or HandlingSettings()
    begin = Sequence(
        "prepare",
        InitialiseAgain(),
        ClearUp(),
        MakeReady(),
        *calibrated(settings),
        LookForStandard(),
        FindRotationCentre(),
        SeeForce(),
    )
    return Procedure(
        "standard",
        Sequence("standard", begin, one_standard(settings, Carry())),
        make_safe=make_safe,
    )


def one_standard(
    settings: HandlingSettings, carry: Part[HandlingContext], *leaving: Part[HandlingContext]
) -> Part[HandlingContext]:
    """Return the path of the standard from the plate to the probe and back, whatever happens."""
    back = Sequence[HandlingContext](
        "put back",
        *leaving,
        CarryStandardBack(),
        Retry(Release(), RELEASES, only={ADHESION}, between=WipeAtHome()),
    )
    return Sequence(
        "measure the standard",
        Retry(
            Sequence[HandlingContext]("choose", LookForStandard(), ChooseStandard()),
            LOOKS,
            only={NO_STANDARD},
        ),
        Fallback(
            "the standard",
            Sequence("bend it", Turn(), grasped(settings), carry, measured(PUSHES + 1)),
            NoteFailure(),
        ),
        back,
        LeaveStandard(),
    )


def build_plate_change(
    settings: HandlingSettings | None,  # noqa: ARG001 - as the others are built
    handler: PlateHandler,
    plate: int,
) -> Procedure[HandlingContext]:
    """Return the procedure by which a handler puts another plate there, with one gripper."""
    return Procedure(
        "another plate",
        Sequence(
            "another plate",
            InitialiseAgain(),
            ClearUp(),
            MakeReady(),
            ChangePlate(handler, plate),
        ),
        make_safe=make_safe,
    )


def build_transport(settings: HandlingSettings | None = None) -> Procedure[HandlingContext]:
    """Return the procedure for one fibre; run it again for the next, on the same work."""
    settings = settings or HandlingSettings()
    nothing = Sequence[HandlingContext]("nothing is measured")
    return Procedure(
        "transport",
        Sequence("transport", *beginning(settings), one_fibre(settings, nothing)),
        make_safe=make_safe,
    )
