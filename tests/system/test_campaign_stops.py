"""STOP in every operation of every shipped procedure, and abort in every third: a safe end, and
nothing is lost.

The operations are those of the procedures' own trees; one that comes only after something went
wrong has a row in `PROVOKED`.
"""

from collections.abc import Callable, Iterator
from typing import Final

import pytest

from cosmic.autonomy.calibrating.calibrated import Calibrated
from cosmic.autonomy.calibrating.touching import TOUCH, TouchJaw
from cosmic.autonomy.campaign.campaign import Campaign
from cosmic.autonomy.handling.context import HEIGHTS
from cosmic.autonomy.handling.prepare import PLATE
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.procedures.operation import UnitOperation
from cosmic.autonomy.procedures.procedure import Part
from cosmic.autonomy.shipped.registry import PROCEDURES
from cosmic.vico.hw.peripherals import LensAxis
from system.campaign_bench import Bench, bench, wait_for
from system.campaign_trial import Provoke, Trial, Way

RATE: Final = 10.0
TESTS_ON_ONE_PLATE: Final = 5


def fault(name: str, **where: object) -> Provoke:
    return lambda bench, _campaign: bench.rig.faults.inject(name, **where)


def mark_unreliable(_bench: Bench, campaign: Campaign) -> None:
    campaign.work.shared.needs_initialisation = True


DARK: Final = fault("light_dimmed", amount=0.02)
PROVOKED: Final = {
    "initialise again": Way(provoke=mark_unreliable),
    "take heights from the file": Way((HEIGHTS,), DARK),
    "turn the table on": Way((PLATE,), DARK),
    "try beside it": Way(provoke=fault("missed_grasp")),
    "step back": Way(provoke=fault("out_of_plane")),
    "shake and wipe": Way(provoke=fault("jaw_adhesion")),
    "note the failure": Way(provoke=fault("drop")),
    "give it up": Way(provoke=fault("drop")),
}

TOUCHED: Final = Way((TOUCH,), more="[parameters.calibration]\ntouch = true\n")


def operations_of(part: Part) -> Iterator[UnitOperation]:
    if isinstance(part, UnitOperation):
        yield part
        return
    for each in part.parts:
        yield from operations_of(each)


def all_operations() -> dict[str, tuple[str, Way]]:
    """Return each operation with the first procedure that has it, and how it is come to."""
    found: dict[str, tuple[str, Way]] = {}
    # What two arms do in turn is stopped in test_dual_gripper.py.
    alone = {name: each for name, each in PROCEDURES.items() if each.arms == 1}
    for procedure, shipped in alone.items():
        for each in operations_of(shipped.build(HandlingSettings()).root):
            way = Way((each.key,)) if isinstance(each, Calibrated) else Way()
            found.setdefault(each.name, (procedure, PROVOKED.get(each.name, way)))
    found[TouchJaw.name] = ("bend test", TOUCHED)
    return found


OPERATIONS: Final = all_operations()


def trials() -> list[tuple[int, tuple[str, ...]]]:
    """Return operations that one campaign is struck in, with the number of its plate."""
    names = list(OPERATIONS)
    struck: list[tuple[int, tuple[str, ...]]] = []
    for first in range(0, len(names), TESTS_ON_ONE_PLATE):
        here = names[first : first + TESTS_ON_ONE_PLATE]
        recipes = {(OPERATIONS[name][0], OPERATIONS[name][1].more) for name in here}
        for recipe in sorted(recipes):
            of = [n for n in here if (OPERATIONS[n][0], OPERATIONS[n][1].more) == recipe]
            struck.append((first // TESTS_ON_ONE_PLATE, tuple(of)))
    return struck


def first_of(given: int | tuple[str, ...]) -> str:
    """Return how a trial is called."""
    return str(given) if isinstance(given, int) else f"from {given[0]}"


@pytest.fixture(scope="module")
def plate(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Bench]:
    with bench(tmp_path_factory.mktemp("plate"), rate=RATE, seed=1 + request.param) as made:
        yield made


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize(("plate", "operations"), trials(), indirect=["plate"], ids=first_of)
def test_stop_and_abort_in_every_operation_end_it_safely_and_nothing_is_lost(
    plate: Bench, operations: tuple[str, ...]
) -> None:
    procedure, way = OPERATIONS[operations[0]]
    trial = Trial(plate, procedure, operations[0], way)
    for operation in operations:
        trial.go_on_to(operation, OPERATIONS[operation][1])
        assert not trial.is_done(), f"{operation!r} can be come to no more: ask for more fibres"
        # By turns, for each way there costs minutes: at rest, in motion, and an abort before it.
        number = list(OPERATIONS).index(operation)
        if number % 3 == 0:
            trial.abort(moving=True)
        trial.stop(moving=bool(number % 2))
    # The way to the end costs most: it is gone once, with all that was cut off behind it.
    trial.finish()


def stopped_when(bench: Bench, campaign: Campaign, moment: Callable[[], bool]) -> None:
    """Let a campaign run until then, and press STOP."""
    campaign.start()
    wait_for(lambda: moment() or campaign.over, "the moment to stop")
    assert not campaign.over, campaign.end_reason
    bench.rig.stop("a hand on the button")
    wait_for(lambda: campaign.over, "the end after STOP")
    campaign.join()
    bench.rig.reset_stop()


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("plate", [0], indirect=True)
def test_a_campaign_stopped_while_lens_and_axes_are_homed_goes_on(plate: Bench) -> None:
    recipe, lens = plate.recipe(), plate.rig.vico.lens
    assert lens is not None

    def homed() -> bool:
        zoom = lens.state(LensAxis.ZOOM)
        return zoom is not None and zoom.homed

    def beyond() -> bool:
        axis = plate.rig.mico["left.z"]
        return axis.limits is not None and (axis.position_um or 0.0) > axis.limits[1]

    campaign = plate.campaign(recipe, "homed")
    mark_unreliable(plate, campaign)
    stopped_when(plate, campaign, beyond)
    assert beyond()
    campaign = plate.campaign(recipe, "homed")
    campaign.run_here()
    assert campaign.end_reason == "1 good fibres"
    assert homed()


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("plate", [0], indirect=True)
def test_a_campaign_stopped_with_the_probe_at_a_jaw_goes_on(plate: Bench) -> None:
    recipe = plate.recipe(more=TOUCHED.more)
    campaign = plate.campaign(recipe, "touched", forget=TOUCHED.forget)
    felt = plate.rig.daqco

    def touches() -> bool:
        here = campaign.operation == TouchJaw.name
        return here and abs(felt.latest().get("force", 0.0)) > 2.0

    stopped_when(plate, campaign, touches)
    campaign = plate.campaign(recipe, "touched", forget=TOUCHED.forget)
    campaign.run_here()
    assert campaign.end_reason == "1 good fibres"
