"""Jaws that are opened by hand: whether they still hold the fibre is not known any more."""

from collections.abc import Iterator
from threading import Event
from types import SimpleNamespace
from typing import Any, cast

import pytest

import cosmic
from cosmic.app.rig import Rig
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.recorded.operations import Surroundings
from cosmic.autonomy.recorded.replay import replay_on
from cosmic.autonomy.recorded.steps import GripperStep, MoveStep, RecordedProcedure
from cosmic.autonomy.shipped.single_operation import OperationRequest, SingleOperation
from cosmic.frame.errors import NotAvailable

WIDTH_UM = 20.0


def with_fibre(rig: Rig, *, closed_at_um: float = 0.0) -> HeldFibre:
    """Have left hold a fibre, as after an operation that took it."""
    replay(rig, MoveStep(axes={"left.x": -10.0}))
    candidate = cast("Any", SimpleNamespace(candidate=SimpleNamespace(width_um=WIDTH_UM)))
    fibre = HeldFibre(number=1, reach=candidate, held=True, closed_at_um=closed_at_um)
    rig.handling.context("left").fibre = fibre
    assert rig.handling.held_by == "left"
    return fibre


def open_by(rig: Rig, steps: int) -> None:
    """Open the jaws of left, and wait until that was noticed."""
    noticed = Event()
    forget = rig.handling.subscribe(noticed.set)
    rig.mico["left.gripper"].steps(steps)
    assert noticed.wait(10.0)
    forget()


def replay(rig: Rig, *steps: Any) -> None:
    run = replay_on(rig.handling, RecordedProcedure(name="one", step=list(steps)), Surroundings())
    run.run_here()
    assert run.failure is None


@pytest.fixture
def rig() -> Iterator[Rig]:
    with cosmic.connect(rate=50.0) as made:
        made.mico["left.gripper"].set_estimate(0.0, std_um=10.0)
        yield made


def test_jaws_opened_wide_by_hand_may_hold_the_fibre_or_not(rig: Rig) -> None:
    with_fibre(rig)
    open_by(rig, 200)
    handling = rig.handling
    assert (handling.held_by, handling.may_hold) == ("", "left")
    assert handling.result is not None
    assert "not known" in handling.result.text
    assert handling.result.interrupted == "in doubt"
    assert "was opened since" in handling.why_not(OperationRequest(SingleOperation.BRING))
    assert "was opened since" in handling.why_not(OperationRequest(SingleOperation.UNDO))
    assert handling.why_not(OperationRequest(SingleOperation.PUT_AWAY)) == ""
    with pytest.raises(NotAvailable, match="put it away first"):
        replay(rig, MoveStep(axes={"left.x": -20.0}))
    opening = rig.mico["left.gripper"].position_um
    assert rig.handling.context("left").gap_um == pytest.approx(opening, abs=1.0)


def test_jaws_closed_again_by_hand_have_not_got_the_fibre_back(rig: Rig) -> None:
    with_fibre(rig)
    open_by(rig, 200)
    rig.mico["left.gripper"].steps(-200)
    assert rig.handling.held_by == ""


def test_jaws_opened_by_less_than_the_fibre_is_wide_still_hold_it(rig: Rig) -> None:
    with_fibre(rig)
    rig.mico["left.gripper"].steps(5)
    rig.mico["right.gripper"].steps(200)
    assert rig.handling.held_by == "left"


def test_the_opening_is_counted_from_where_the_jaws_had_closed(rig: Rig) -> None:
    rig.mico["left.gripper"].steps(-60)
    with_fibre(rig, closed_at_um=rig.mico["left.gripper"].position_um or 0.0)
    open_by(rig, 60)
    assert rig.handling.may_hold == "left"


def test_a_recorded_step_that_opens_the_jaws_leaves_the_same_doubt(rig: Rig) -> None:
    with_fibre(rig)
    replay(rig, GripperStep(tool="left", opening_um=150.0))
    assert rig.handling.may_hold == "left"
