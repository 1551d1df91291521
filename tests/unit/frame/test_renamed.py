import sys

import pytest

from cosmic.frame.arguments import checked
from cosmic.frame.renamed import Renamed, renamed_in, renamed_parameters


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


@checked
@renamed_parameters(way="path")
def follow(path: str, *, speed: float = 1.0) -> str:
    return f"{path} at {speed:g}"


def test_an_old_name_of_a_parameter_works_and_warns_where_it_was_used() -> None:
    with pytest.warns(
        DeprecationWarning, match=r"follow\(way=\.\.\.\) is now called path"
    ) as heard:
        assert follow(way="home", speed=2.0) == "home at 2"  # type: ignore[call-arg]
    assert heard[0].filename == __file__
    assert follow("home") == follow(path="home") == "home at 1"


def test_both_names_of_a_parameter_are_an_error() -> None:
    with pytest.raises(TypeError, match="got both 'way' and 'path'"):
        follow(path="home", way="away")  # type: ignore[call-arg]
