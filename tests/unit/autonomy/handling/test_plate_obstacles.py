"""What stands on the plate is kept clear of: in the bin, and where the plate's map is measured."""

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typing_extensions import override

from cosmic.autonomy.handling import prepare
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.plate_obstacles import any_under, plate_obstacles
from cosmic.autonomy.handling.prepare import CalibratePlate, TurnOn
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.procedures.operation import Steps
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import MoveRefused, NotAvailable
from cosmic.frame.verdict import MoveVerdict, Reason
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.collision.scene_loader import load_scene
from cosmic.vico.core.tool_settings import ToolSettings

CLIP = np.array([[10e3, -4e3], [12e3, -4e3], [12e3, 4e3], [10e3, 4e3]])
SCENE = Path(__file__).resolve().parents[4] / "config" / "scenes" / "fiberstation.toml"
SIDES = {"left": 1.0, "right": -1.0}


class Bench(HandlingContext):
    """A plate with a clip at some angle, and one gripper; nothing moves."""

    def __init__(self, gripper: str, table_deg: float) -> None:
        none: Any = None
        settings = HandlingSettings(gripper=gripper)  # type: ignore[arg-type]
        super().__init__(none, none, none, settings, ManualClock(), none)
        self.shared.obstacles_um = (CLIP,)
        self.angle_deg = table_deg

    @property
    @override
    def table_deg(self) -> float:
        return self.angle_deg

    @override
    def tool(self, name: str) -> ToolSettings:
        return ToolSettings(
            name=name,
            x_axis=f"{name}.x",
            y_axis=f"{name}.y",
            z_axis=f"{name}.z",
            gap_axis=f"{name}.gripper",
            tip_um=(0.0, 0.0, 0.0),
            forward=(SIDES[name], 0.0),
            width_um=100.0,
        )


def test_the_scene_of_a_station_is_asked_for_where_it_has_not_come_yet() -> None:
    here = load_scene(SCENE)

    class Far:
        checks_collisions = True

        @property
        def collision(self) -> Any:
            raise NotAvailable("the scene of the station has not arrived yet")

        def scene(self) -> SceneModel:
            return here

    far: Any = Far()
    (clip,) = plate_obstacles(far)
    assert clip.min(axis=0) == pytest.approx(CLIP.min(axis=0))
    assert clip.max(axis=0) == pytest.approx(CLIP.max(axis=0))
    far.checks_collisions = False
    assert plate_obstacles(far) == ()


@pytest.mark.parametrize("gripper", ["left", "right"])
@pytest.mark.parametrize("table_deg", [-155.0, -90.0, 0.0, 20.0, 100.0, 154.8, 180.0])
def test_nothing_is_put_away_where_the_clip_stands(gripper: str, table_deg: float) -> None:
    work = Bench(gripper, table_deg)

    there = work.bin_position(40.0)

    assert there[f"{gripper}.z"] == 40.0
    grid = np.array(
        [[x, y] for x in np.linspace(10e3, 12e3, 21) for y in np.linspace(-4e3, 4e3, 81)]
    )
    off = work.calibration.frame.on_platform(grid, table_deg)
    off -= np.array([there[f"{gripper}.x"], there[f"{gripper}.y"]])
    ahead, aside = off[:, 0] * SIDES[gripper], np.abs(off[:, 1])
    assert not ((ahead < 0.0) & (ahead > -6000.0) & (aside < 600.0)).any()
    assert abs(there[f"{gripper}.y"]) <= 5000.0


def test_an_obstacle_that_stands_askew_beside_the_corner_is_not_below() -> None:
    askew = np.array([[0.0, 100.0], [100.0, 0.0], [200.0, 100.0], [100.0, 200.0]])
    low = np.array([-100.0, -100.0])
    assert not any_under([askew], low, np.array([40.0, 40.0])), "their boxes overlap, not they"
    assert any_under([askew], low, np.array([60.0, 60.0]))
    assert any_under([askew], low, np.array([300.0, 300.0])), "all of it"
    assert any_under([askew], np.array([90.0, 90.0]), np.array([110.0, 110.0])), "in its middle"


def test_where_the_bin_is_clear_it_stays_where_it_is_set() -> None:
    work = Bench("left", 0.0)
    places = work.settings.places
    assert work.bin_position() == {"left.x": places.bin_x_um, "left.y": places.bin_y_um}


def _finished(steps: Steps) -> Any:
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value


def refused(reason: Reason) -> MoveRefused:
    return MoveRefused(MoveVerdict(allowed=False, reason=reason, text="in the way"))


@pytest.fixture
def tried(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[str]]:
    """Return what makes the map of the plate end so: its results in turn, and what was done."""

    def make(*results: MoveRefused | float) -> list[str]:
        done: list[str] = []
        left = list(results)

        def calibrate_at(*_given: object) -> Steps:
            done.append("map")
            result = left.pop(0)
            if isinstance(result, MoveRefused):
                raise result
            return result
            yield

        def turn(_self: object, _work: object) -> Steps:
            done.append("turn")
            return
            yield

        monkeypatch.setattr(prepare, "calibrate_at", calibrate_at)
        monkeypatch.setattr(TurnOn, "steps", turn)
        return done

    return make


def measured(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Carry the calibration out, and return the residual that it kept."""
    kept: list[float] = []
    work = SimpleNamespace(
        settings=HandlingSettings(),
        calibration=SimpleNamespace(zoom_run=0),
        shared=SimpleNamespace(zoom_runs=3),
    )
    monkeypatch.setattr(
        CalibratePlate,
        "kept",
        lambda _self, _work, residual, *_more, **_named: kept.append(residual),
    )
    _finished(CalibratePlate().measure(work))  # type: ignore[arg-type]
    return kept


def test_where_the_clip_is_in_the_way_of_the_map_the_table_turns_on(
    monkeypatch: pytest.MonkeyPatch, tried: Callable[..., list[str]]
) -> None:
    done = tried(refused(Reason.COLLISION), refused(Reason.COLLISION), 0.25)

    assert measured(monkeypatch) == [0.25]
    assert done == ["map", "turn", "map", "turn", "map"]


def test_what_is_in_the_way_at_every_angle_is_reported(
    monkeypatch: pytest.MonkeyPatch, tried: Callable[..., list[str]]
) -> None:
    done = tried(*[refused(Reason.COLLISION)] * 9)

    with pytest.raises(MoveRefused):
        measured(monkeypatch)
    assert done == ["map", "turn"] * 3 + ["map"]


def test_nothing_turns_for_another_refusal(
    monkeypatch: pytest.MonkeyPatch, tried: Callable[..., list[str]]
) -> None:
    done = tried(refused(Reason.LIMIT), 0.25)

    with pytest.raises(MoveRefused):
        measured(monkeypatch)
    assert done == ["map"]
