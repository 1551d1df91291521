import sys

import pytest

from cosmic.frame.renamed import Renamed, renamed_in


class Stage:
    """Has a method and an attribute under a new name."""

    find_way = Renamed("plan_path")
    place = Renamed("position")

    def __init__(self) -> None:
        self.position = 3.0

    def plan_path(self, target: str) -> str:
        return f"to {target}"


def new_name() -> str:
    return "new"


def test_an_old_name_works_and_warns_with_the_new_one() -> None:
    stage = Stage()
    with pytest.warns(DeprecationWarning, match=r"Stage\.find_way is now called plan_path"):
        assert stage.find_way("home") == "to home"
    with pytest.warns(DeprecationWarning, match="position"):
        assert stage.place == stage.position


def test_the_warning_names_the_line_that_used_the_old_name() -> None:
    with pytest.warns(DeprecationWarning) as heard:
        _ = Stage().place
    assert heard[0].filename == __file__


def test_an_old_name_of_a_module_works_and_warns() -> None:
    look_up = renamed_in(__name__, {"old_name": "new_name"})
    assert __name__ in sys.modules
    with pytest.warns(DeprecationWarning, match="old_name is now called new_name"):
        assert look_up("old_name") is new_name


def test_a_name_that_a_module_never_had_is_an_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'other'"):
        renamed_in(__name__, {})("other")
