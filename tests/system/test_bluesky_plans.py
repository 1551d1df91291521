"""Plans that ship with bluesky run on axes, groups and channels as they are."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from bluesky import RunEngine, plans
from bluesky.utils import FailedStatus
from event_model import DocumentNames, schema_validators

import cosmic
from contract.station_rig import free_port
from system.docs_blocks import ROOT, blocks
from system.served_program import served_program

QUEUE = ROOT / "docs" / "how-to" / "queue-plans.md"
Plan = Callable[[Any, Any, Any], Any]

TRIED: dict[str, tuple[Plan, int]] = {
    "count": (lambda x, _y, d: plans.count([d, x], 3), 3),
    "scan": (lambda x, _y, d: plans.scan([d], x, 0, 20, 3), 3),
    "rel_scan": (lambda x, _y, d: plans.rel_scan([d], x, -5, 5, 3), 3),
    "inner product": (lambda x, y, d: plans.scan([d], x, 0, 20, y, 0, 10, 3), 3),
    "list_scan": (lambda x, _y, d: plans.list_scan([d], x, [1, 5, 3]), 3),
    "rel_list_scan": (lambda x, y, d: plans.rel_list_scan([d], x, [1, 2], y, [3, 4]), 2),
    "log_scan": (lambda x, _y, d: plans.log_scan([d], x, 0, 2, 3), 3),
    "grid_scan": (lambda x, y, d: plans.grid_scan([d], x, 0, 5, 2, y, 0, 5, 2), 4),
    "rel_grid_scan": (lambda x, y, d: plans.rel_grid_scan([d], x, 0, 5, 2, y, 0, 5, 2), 4),
    "list_grid_scan": (lambda x, y, d: plans.list_grid_scan([d], x, [0, 5], y, [0, 5]), 4),
    "spiral": (lambda x, y, d: plans.spiral([d], x, y, 0, 0, 10, 10, 5, 4), 4),
    "spiral_fermat": (lambda x, y, d: plans.spiral_fermat([d], x, y, 0, 0, 9, 9, 3, 1), 3),
    "spiral_square": (lambda x, y, d: plans.spiral_square([d], x, y, 0, 0, 9, 9, 3, 3), 9),
    "x2x_scan": (lambda x, y, d: plans.x2x_scan([d], x, y, 0, 10, 3), 3),
    "adaptive_scan": (
        lambda x, _y, d: plans.adaptive_scan([d], "force", x, 0, 40, 5, 20, 1, False),
        3,
    ),
    "tune_centroid": (lambda x, _y, d: plans.tune_centroid([d], "force", x, 0, 20, 5, 3), 3),
}


@pytest.fixture(scope="module")
def rig() -> Iterator[cosmic.Rig]:
    with cosmic.connect(rate=20.0, applications=("mico", "daqco")) as rig:
        rig.daqco["force"].average_s = 0.05
        yield rig


@pytest.mark.parametrize("name", TRIED)
def test_a_plan_of_bluesky_runs_unchanged(rig: cosmic.Rig, name: str) -> None:
    plan, least = TRIED[name]
    engine, read = RunEngine({}, context_managers=[]), []

    def hear(kind: str, document: dict[str, Any]) -> None:
        schema_validators[DocumentNames[kind]].validate(document)
        json.dumps(document)
        if kind == "event":
            read.append(document["data"])
        assert document.get("exit_status", "success") == "success"

    engine.subscribe(hear)
    x, y = (rig.mico[each] for each in ("left.x", "left.y"))
    engine(plan(x, y, rig.daqco["force"]))
    assert len(read) >= least
    assert all("force" in each for each in read)


@pytest.mark.timeout(120)
def test_the_startup_script_of_a_queue_names_plans_that_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (script,) = (each for each in blocks(QUEUE) if each.language == "python")
    line, closers = free_port(), []
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr("atexit.register", closers.append)
    with served_program(tmp_path, free_port(), line, "--name", "fibers"):
        names: dict[str, Any] = {}
        exec(compile(script.text.replace("7447", str(line)), str(QUEUE), "exec"), names)
        try:
            engine, rig = names["RE"], names["rig"]
            for plan in (names["push"](0.0, 5.0, 2), names["look"](1)):
                engine(plan)
            with pytest.raises(FailedStatus, match="outside its limit"):
                engine(names["push"](0.0, 1e6, 2))
            assert not rig.stations["fibers"].here, "the right to move was given back"
            with pytest.raises(FailedStatus) as refused:
                engine(plans.scan([], names["left_x"], 0.0, 5.0, 2))
            assert isinstance(refused.value.__cause__, cosmic.MoveRefused)
        finally:
            for close in closers:
                close()
    kept = [each.read_text("utf-8").splitlines() for each in (tmp_path / "runs").iterdir()]
    assert kept
    assert all(json.loads(each[0])["name"] == "start" for each in kept)
