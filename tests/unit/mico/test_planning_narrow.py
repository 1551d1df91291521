"""Paths through narrow windows, found by the search alone."""

import pytest
from benchmarks.narrow_passages import Passage, Questions, is_safe, passages

from cosmic.mico.core.collision.sweep import Sweep
from cosmic.mico.core.planning.boxes import Boxes, Effort
from cosmic.mico.core.planning.rrt_connect import search
from cosmic.mico.core.planning.space import Path, Space

NARROW = {each.name: each for each in passages(400.0)}


def searched(passage: Passage, seed: int, effort: Effort) -> tuple[Boxes, Path | None]:
    space = Space(passage.model, passage.problem)
    boxes = Boxes(Sweep(passage.model), passage.problem, space, effort)
    return boxes, search(boxes, space.start, space.goal, seed)


@pytest.mark.parametrize("name", NARROW)
@pytest.mark.parametrize("seed", [0, 1])
def test_a_path_leads_through_every_window_and_each_leg_is_clear(name: str, seed: int) -> None:
    passage = NARROW[name]
    boxes, path = searched(passage, seed, Questions())
    assert path is not None
    assert path[-1] == boxes.space.goal
    assert all(boxes.space.contains(point) for point in path)
    assert is_safe(passage, boxes, (boxes.space.start, *path))


def test_the_same_seed_gives_the_same_corners_and_another_seed_others() -> None:
    passage = NARROW["two windows"]
    first, second, other = (searched(passage, seed, Questions())[1] for seed in (3, 3, 4))
    assert first is not None
    assert first == second
    assert first != other


def test_a_search_ends_with_its_effort() -> None:
    effort = Questions()
    effort.most = 5
    boxes, path = searched(NARROW["two windows"], 0, effort)
    assert path is None
    assert boxes.effort.checks < 5 + 60
