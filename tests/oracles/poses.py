"""Crowded places to start from on a scene, and movements to make from there."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from cosmic.mico.core.collision.checker import AxisSpan
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.collision.sweep import Sweep

NEAR_UM = 200.0

Position = dict[str, float]
Moves = dict[str, float]


def without_overshoot(model: SceneModel) -> SceneModel:
    """Return the scene with axes that stop where they are sent."""
    return replace(model, drives=tuple(replace(d, overshoot=0.0) for d in model.drives))


def starts(sweep: Sweep, seed: int, count: int) -> list[Position]:
    """Return free places, in half of which something is nearer than `NEAR_UM`."""
    rng = np.random.default_rng(seed)
    near: list[Position] = []
    far: list[Position] = []
    half = (count + 1) // 2
    while min(len(near), half) + min(len(far), half) < 2 * half:
        here = _anywhere(rng, sweep.model)
        found = sweep.nearest(here)
        if found is not None and found.distance_um > found.margin_um + 1.0:
            (near if found.distance_um < NEAR_UM else far).append(here)
    return [each for two in zip(near, far, strict=False) for each in two][:count]


def face_to_face(rng: np.random.Generator, model: SceneModel) -> Position:
    """Return a place at which the two arms stand roughly opposite, free or not."""
    place = {axis: model.park.get(axis, 0.0) for axis in model.axes}
    height = float(rng.uniform(-200.0, 3000.0))
    for arm in ("left", "right"):
        place[f"{arm}.x"] = float(rng.uniform(*model.travel(f"{arm}.x")))
        place[f"{arm}.y"] = float(rng.uniform(-400.0, 400.0))
        place[f"{arm}.z"] = height + float(rng.uniform(-200.0, 200.0))
    return place


def _anywhere(rng: np.random.Generator, model: SceneModel) -> Position:
    place = {}
    for axis in model.axes:
        low, high = model.travel(axis)
        middle, half = (low + high) / 2.0, (high - low) / 2.0
        place[axis] = middle + half * float(rng.uniform(-1.0, 1.0)) * float(rng.choice((0.2, 1.0)))
    return place


def spans(start: Position, moves: Moves) -> dict[str, AxisSpan]:
    """Return all axes, those of `moves` on their way."""
    found = {axis: AxisSpan(value, value, value) for axis, value in start.items()}
    for axis, way in moves.items():
        here = start[axis]
        found[axis] = AxisSpan(min(here, here + way), max(here, here + way), here, moving=True)
    return found


def within(model: SceneModel, start: Position, axis: str, way: float) -> float:
    """Return `way`, or the same the other way, or less: what stays within the travel."""
    low, high = model.travel(axis)
    room_up, room_down = high - start[axis], start[axis] - low
    room = room_up if way > 0.0 else room_down
    if abs(way) > room:
        way, room = (-way, room_down) if way > 0.0 else (-way, room_up)
    return float(np.copysign(min(abs(way), room), way))


def straight_axes(model: SceneModel) -> list[str]:
    """Return the axes along x, y and z."""
    return [axis for axis in model.axes if axis.rsplit(".", 1)[-1] in ("x", "y", "z")]


def moves_from(
    rng: np.random.Generator, model: SceneModel, start: Position
) -> Iterator[tuple[str, Moves]]:
    """Yield one movement of each kind with its name."""
    axis = str(rng.choice(straight_axes(model)))
    way = float(rng.choice((-1.0, 1.0)))
    turn = within(model, start, "table.rotation", 90.0 * way)
    yield "10 mm, one axis", {axis: within(model, start, axis, 10_000.0 * way)}
    yield "50 um jog", {axis: within(model, start, axis, 50.0 * way)}
    yield "table +-90 deg", {"table.rotation": turn}
    yield (
        "two arms, three axes each",
        {
            f"{arm}.{letter}": within(
                model, start, f"{arm}.{letter}", float(rng.choice((-1, 1)) * rng.uniform(100, 3000))
            )
            for arm in ("left", "right")
            for letter in "xyz"
        },
    )
