"""The pure collision gate against independent oracles: how often it is wrong, or too careful.

The oracles stand in tests/oracles and share no code with the gate: exact distances by quadratic
programming on the vertices, slabs for aligned boxes, plain conservative advancement, replays.
Everything is random with fixed seeds.
"""

from collections import Counter
from pathlib import Path

from tests.oracles import poses, trials

from benchmarks.figures import Figure, main
from cosmic.mico.core.collision.scene_loader import load_scene

NAME = "collision oracles"
SCENE = Path(__file__).resolve().parents[1] / "config" / "scenes" / "fiberstation.toml"


def _figures(
    what: str, found: Counter[str], names: tuple[str, ...], limits: dict[str, float]
) -> list[Figure]:
    counts = [Figure(NAME, f"{what}: {name}", float(found[name]), "") for name in names]
    return counts + [
        Figure(NAME, f"{what}: {name}", float(found[name]), "", limit)
        for name, limit in limits.items()
    ]


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    share = 0.01 if quick else 1.0

    def many(count: int) -> int:
        return max(2, round(count * share))

    scene = poses.without_overshoot(load_scene(SCENE))
    jaws = many(10_000)
    figures = _figures(
        "jaw past 10 um things",
        trials.jaw_trial(1, jaws),
        ("moves", "free", "collides"),
        {"tunnelled": 0, "refused though free": 0.01 * jaws},
    )
    boxes = (
        ("sliding boxes of 2 to 8 axes", trials.box_trial(2, many(3000), turning=0.0)),
        ("boxes of 2 to 8 axes, some turn", trials.box_trial(3, many(300), turning=0.3)),
        ("boxes of 1 to 3 turning axes", trials.box_trial(4, many(300), turning=1.0, axes=(1, 3))),
    )
    for what, found in boxes:
        limits = {"unsound": 0.0, "too careful": 0.01 * found["boxes"]}
        figures += _figures(what, found, ("boxes", "clear"), limits)
    for what, turning in (("retreat, sliding", 0.0), ("retreat, some turn", 0.4)):
        found = trials.retreat_trial(5, many(2500), turning=turning)
        figures += _figures(what, found, ("inside", "allowed"), {"closer": 0})
    figures += _figures(
        "two arms at once",
        trials.two_arm_trial(scene, 6, many(5000)),
        ("cases", "clear", "replays", "replays that pass near"),
        {"replays that collide": 0},
    )
    return figures + _figures(
        "plain advancement",
        trials.advancement_trial(scene, 7, many(10_000)),
        ("moves", "free"),
        {"clear though not free": 0, "refused though free": 0},
    )


if __name__ == "__main__":
    main(__doc__, measure)
