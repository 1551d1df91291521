"""All faults of the simulated platform in one place."""

from typing import Any

import pytest

from cosmic.app.simulation import SimulationFaults
from cosmic.twin.twin_faults import TwinFaults


class Part:
    def __init__(self) -> None:
        self.active: tuple[tuple[str, dict[str, Any]], ...] = ()

    def inject(self, name: str, *, board: str | None = None) -> None:
        self.active = (*self.active, (name, {"board": board}))

    def clear(self, name: str | None = None) -> None:
        self.active = tuple(each for each in self.active if name not in (None, each[0]))


def joined() -> tuple[SimulationFaults, Part, Part]:
    faults, controller, board = SimulationFaults(), Part(), Part()
    faults.join("scene", TwinFaults())
    faults.join("controller", controller)
    faults.join("board", board)
    return faults, controller, board


def test_a_name_reaches_the_part_that_has_it() -> None:
    faults, controller, board = joined()
    faults.inject("missed_grasp", times=2)
    faults.inject("stalled", board="Dev1")
    faults.inject("end_stop")
    assert [part for part, _ in faults.active] == ["scene", "controller", "board"]
    assert board.active == (("stalled", {"board": "Dev1"}),)
    assert controller.active == (("end_stop", {"board": None}),)


def test_a_name_that_two_parts_have_means_the_controller_unless_the_part_is_named() -> None:
    faults, controller, board = joined()
    faults.inject("unplugged")
    faults.inject("board unplugged")
    assert [name for name, _ in controller.active] == ["unplugged"]
    assert [name for name, _ in board.active] == ["unplugged"]


def test_clearing_without_a_name_ends_all() -> None:
    faults, *_ = joined()
    for name in ("drop", "end_stop", "overrun"):
        faults.inject(name)
    faults.clear("overrun")
    assert len(faults.active) == 2
    faults.clear()
    assert faults.active == ()


def test_what_is_injected_before_a_part_is_made_is_not_lost() -> None:
    faults, part = SimulationFaults(), Part()
    faults.expect("camera")
    faults.inject("frozen")
    faults.inject("camera lost")
    faults.clear("lost")
    faults.join("camera", part)
    assert [name for name, _ in part.active] == ["frozen"]


def test_what_is_not_there_is_refused_with_the_names_there_are() -> None:
    faults, *_ = joined()
    with pytest.raises(ValueError, match="no fault 'frozen' here; known: scene missed_grasp"):
        faults.inject("frozen")
    with pytest.raises(ValueError, match="'overrun' takes no camera"):
        faults.inject("overrun", camera="Sim1")
