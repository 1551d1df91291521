"""STOP and abort in every operation of every shipped procedure: a safe end, and nothing is lost.

The operations are those of the procedures' own trees; one that comes only after something went
wrong has a row in `PROVOKED`.
"""

from collections.abc import Iterator
from typing import Final

import pytest

from cosmic.autonomy.calibrating.calibrated import Calibrated
from cosmic.autonomy.calibrating.heights import HEIGHTS
from cosmic.autonomy.campaign.campaign import Campaign
from cosmic.autonomy.handling.prepare import PLATE
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.procedures.operation import UnitOperation
from cosmic.autonomy.procedures.procedure import Part
from cosmic.autonomy.shipped.registry import PROCEDURES
from system.campaign_bench import Bench, bench
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


def operations_of(part: Part) -> Iterator[UnitOperation]:
    if isinstance(part, UnitOperation):
        yield part
        return
    for each in part.parts:
        yield from operations_of(each)


def all_operations() -> dict[str, tuple[str, Way]]:
    """Return each operation with the first procedure that has it, and how it is come to."""
    found: dict[str, tuple[str, Way]] = {}
    # What two arms do in turn is stopped in test_two_hands.py.
    alone = {name: each for name, each in PROCEDURES.items() if each.arms == 1}
    for procedure, shipped in alone.items():
        for each in operations_of(shipped.build(HandlingSettings()).root):
            way = Way((each.key,)) if isinstance(each, Calibrated) else Way()
            found.setdefault(each.name, (procedure, PROVOKED.get(each.name, way)))
    return found


OPERATIONS: Final = all_operations()


def trials() -> list[tuple[int, str]]:
    """Return all operations, each with the number of the plate that its fibres are taken from."""
    return [(number // TESTS_ON_ONE_PLATE, name) for number, name in enumerate(OPERATIONS)]


@pytest.fixture(scope="module")
def plate(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Bench]:
    with bench(tmp_path_factory.mktemp("plate"), rate=RATE, seed=1 + request.param) as made:
        yield made


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize(("plate", "operation"), trials(), indirect=["plate"])
def test_stop_and_abort_in_every_operation_end_it_safely_and_nothing_is_lost(
    plate: Bench, operation: str
) -> None:
    procedure, way = OPERATIONS[operation]
    trial = Trial(plate, procedure, operation, way)
    trial.stop(moving=False)
    trial.abort(moving=True)
    trial.stop(moving=True)
    trial.finish()
