"""The shipped scene with its stages moved by hand, and shorthand for what tests ask of it."""

from typing import Any

import numpy as np
from typing_extensions import override

from cosmic.frame.clock import ManualClock
from cosmic.twin.felt import Moment, Push
from cosmic.twin.force_settings import FibreSettings
from cosmic.twin.scene import Scene
from cosmic.twin.settings import TwinSettings, shipped_settings
from cosmic.twin.truth import NO_TRUTH, Truth

FIBRE = FibreSettings(
    length_um=2000.0,
    width_um=30.0,
    thickness_um=8.0,
    ei_n_m2=5e-11,
    ea_n=7.2,
    held_by="left",
    free_um=1200.0,
)
EI = 5e-11 * 1e18
"""uN um2."""


def settings(
    *fibres: FibreSettings, start: dict[str, float] | None = None, **contact: float
) -> TwinSettings:
    """Return the shipped constants with other fibres, starts and contact; clamps are exact."""
    shipped = shipped_settings()
    exact = {"clamp_depth_um": 0.0, "clamp_depth_spread_um": 0.0} | contact
    stages = dict(shipped.stages)
    for name, place in (start or {}).items():
        stages[name] = stages[name].model_copy(update={"start": place})
    return shipped.model_copy(
        update={
            "fibres": fibres or (FIBRE,),
            "contact": shipped.contact.model_copy(update=exact),
            "stages": stages,
        }
    )


class Heard(Truth):
    """Keeps what it is told."""

    def __init__(self) -> None:
        self.events: list[tuple[str, dict[str, Any]]] = []

    @override
    def record(self, time_s: float, event: str, **facts: object) -> None:
        self.events.append((event, dict(facts)))

    @override
    def close(self) -> None:
        self.events.append(("closed", {}))

    @property
    def names(self) -> list[str]:
        """What happened, but for the table at the start."""
        return [name for name, _ in self.events[1:]]

    def facts(self, name: str) -> dict[str, Any]:
        """Return the facts of the last event of that name."""
        return next(facts for event, facts in reversed(self.events) if event == name)


class Bench:
    """A scene, its time, and its stages as if by hand: one after another, each at its speed."""

    def __init__(
        self, twin: TwinSettings | None = None, seed: int = 0, truth: Truth = NO_TRUTH
    ) -> None:
        self.scene = Scene.from_settings(twin or settings(), ManualClock(), seed, truth=truth)
        assert self.scene.force_side is not None
        self.force_side = self.scene.force_side
        self.now_s = 0.0

    def start(self, target: dict[str, float], speed: float = 2000.0) -> float:
        """Begin to move stages, and return when all stand."""
        ends = [self.now_s]
        for name, place in target.items():
            stage = self.scene.stages[name]
            route = stage.route(self.now_s)
            route.go(place, speed)
            stage.follow(route, held_until_s=1e9)
            ends.append(route.end_s)
        return max(ends)

    def go(self, speed: float = 2000.0, **target: float) -> "Bench":
        """Move stages at once and wait for all; left_x is left.x."""
        named = {name.replace("_", ".", 1): place for name, place in target.items()}
        self.now_s = self.start(named, speed) + 0.002
        return self

    def wait(self, duration_s: float) -> "Bench":
        self.now_s += duration_s
        return self

    @property
    def moment(self) -> Moment:
        return self.force_side.timeline.moment(self.now_s)

    @property
    def force_un(self) -> float:
        return float(self.force_side.timeline.force_un(np.array([self.now_s]))[0])

    @property
    def push(self) -> Push:
        (push,) = self.moment.pushes
        return push


def before_the_fibre(bench: Bench, span_um: float = 400.0) -> Bench:
    """Bring the held fibre before the probe: the jaws' tip `span_um` to its left, 20 um away."""
    bench.go(left_x=4000.0 - span_um).go(left_z=-810.0)
    return bench.go(probe_y=-5000.0 + FIBRE.width_um / 2.0 + 20.0)


def touching_y(bench: Bench) -> float:
    """Position of probe.y at which its tip meets the undeformed fibre."""
    return -5000.0 + FIBRE.width_um / 2.0
