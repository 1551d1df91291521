"""Ways on the shipped scene: a few of the problems of benchmarks/planning.py."""

import random
import subprocess
import sys

import pytest
from benchmarks.planning import SCENE, is_safe, solve

from cosmic.mico.core.collision.scene_loader import load_scene
from cosmic.mico.core.planning.problem import Plan

SEARCH = """
import sys
sys.path.insert(0, "tests")
from dataclasses import replace
from unit.mico.planning_problems import LIMITS, arms, at
from cosmic.mico.core.collision.sweep import Sweep
from cosmic.mico.core.planning.planner import plan_path
from cosmic.mico.core.planning.problem import Problem
walled = {**LIMITS, "left.x": (2400.0, 4000.0), "left.z": (-40.0, 40.0)}
start = at(left_x=2500.0, left_y=-600.0)
problem = Problem(start, {"left.y": 600.0}, walled, budget_s=0.1)
print(type(plan_path(Sweep(arms()), problem)).__name__)
"""


@pytest.mark.parametrize("six", [False, True])
def test_blocked_problems_are_solved_by_short_paths_that_are_exactly_safe(six: bool) -> None:
    model, rng = load_scene(SCENE), random.Random(1)
    runs = solve(model, 4, six=six)
    for run in runs:
        assert isinstance(run.found, Plan), run.found
        assert is_safe(model, run, rng)
        assert run.found.length <= 2.5 * run.found.straight_length
        assert run.took_s < 10.0


def test_a_search_writes_nothing_to_the_terminal_of_the_operator() -> None:
    root = SCENE.parents[2]
    done = subprocess.run(
        [sys.executable, "-c", SEARCH],
        cwd=root,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("NoPath\n", "")
    assert done.returncode == 0
