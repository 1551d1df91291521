"""Whatever a script hands to a handle of a station: it works, or the argument is named."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from contract.mico_rig import hosted_mico, remote_mico, wait_for
from cosmic.frame.errors import MoveCancelled, StoppedError
from cosmic.frame.network.errors import StationTimeout
from cosmic.mico.api.mico import Mico
from system.odd_arguments import LEFT_OUT, calls_of, complaint, tried

THINGS: dict[str, Callable[[Mico], object]] = {
    "mico": lambda mico: mico,
    "axis": lambda mico: mico["left.x"],
    "gripper": lambda mico: mico["left.gripper"],
    "group": lambda mico: mico.group("left.x", "left.y"),
    "poses": lambda mico: mico.poses,
    "collision": lambda mico: mico.collision,
}
SENSIBLE: dict[str, object] = {
    "name": "x", "names": "left.x", "axis": "left.x", "target": 10.0, "distance": 1.0,
    "position": 0.0, "value": 1.0, "targets": {"left.x": 10.0}, "distances": {"left.x": 1.0},
    "first": "left.x", "second": "right.x", "one": "left_x", "other": "plate", "steps": 1,
    "frequency_hz": 5000, "direction": "forward", "jog.direction": 1, "follow.wait": False,
    "go.wait": False, "callback": None, "code": 1, "zero": 0.0, "timeout_s": 0.01, "speed": 1.0,
}  # fmt: skip

LONG = {"begin_initialisation", "begin_search", "begin_rescan"}
"""What they begin goes on at the station while the others are tried."""


def has_answered(mico: Mico) -> bool:
    """Give the first call of all, which makes the thread of the calls; a busy one is late."""
    try:
        mico["left.x"].stop()
    except StationTimeout:
        return False
    return True


@pytest.fixture
def mico() -> Iterator[Mico]:
    """MiCo of a station, as another program has it; made anew, for what was begun may go on."""
    with hosted_mico(rate=50.0) as hosted, remote_mico(hosted, "in-process") as (made, _, _):
        wait_for(lambda: has_answered(made))
        yield made


class MuteError(Exception):
    def __str__(self) -> str:
        raise ValueError("no text")


REASONS = [
    None,
    5,
    ValueError("too much force"),
    MuteError(),
    b"x",
    np.ones(2),
    "x" * 100_000,
    "\ud800",
]


@pytest.mark.parametrize("reason", REASONS, ids=lambda reason: type(reason).__name__)
def test_a_stop_is_carried_out_whatever_reason_it_is_given(mico: Mico, reason: Any) -> None:
    axis = mico["left.x"]
    axis.set_closed_loop_frequency(50)
    move = axis.move_to(2000.0, wait=False)
    axis.halt(reason)
    assert isinstance(move.exception(5.0), MoveCancelled)
    move = axis.move_to(-2000.0, wait=False)
    mico.stop(reason)
    assert isinstance(move.exception(5.0), StoppedError)
    wait_for(lambda: mico.stop_state.reason)
    mico.reset_stop()


@pytest.mark.parametrize("reason", REASONS, ids=lambda reason: type(reason).__name__)
def test_so_it_is_where_the_axes_are(reason: Any) -> None:
    with hosted_mico(rate=50.0) as hosted:
        mico = hosted.mico
        move = mico["left.x"].move_to(2000.0, wait=False)
        mico.stop(reason)
        assert isinstance(move.exception(5.0), StoppedError)
        assert mico.stop_state.reason
        mico.reset_stop()


@pytest.mark.parametrize("name", THINGS)
def test_odd_arguments_of_what_is_remote_are_named_and_break_nothing(mico: Mico, name: str) -> None:
    wrong: dict[str, None] = {}
    tries = 0
    for call in calls_of(name, THINGS[name](mico), SENSIBLE, LEFT_OUT | LONG):
        for link in mico.links:
            mico.unlink(link.first)
        for parameter, odd, error in tried(call):
            tries += 1
            if mico.stop_state.reason is not None:
                mico.reset_stop()
            if found := complaint(call, parameter, odd, error):
                wrong[found] = None
    assert not wrong, "\n".join(wrong)
    assert tries > 0


@pytest.mark.parametrize("what", ["axis", "group"])
@pytest.mark.parametrize("odd", [np.array([1.0, 2.0]), None, "abc"], ids=["array", "None", "text"])
def test_a_stop_with_an_odd_argument_stops(mico: Mico, what: str, odd: object) -> None:
    axis, thing = mico["left.x"], THINGS[what](mico)
    stop: Any = thing.stop  # type: ignore[attr-defined]
    axis.set_closed_loop_frequency(300)
    movement = axis.move_by(2000.0, wait=False)
    wait_for(lambda: axis.details.in_motion)
    stop(odd)
    assert movement.exception(5.0) is not None
    wait_for(lambda: not axis.details.in_motion)
    axis.set_closed_loop_frequency(5000)
    axis.move_to(0.0)
