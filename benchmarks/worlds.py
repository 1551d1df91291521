"""Whether the interval of a bending stiffness holds the truth in worlds it was not built for.

In each world sessions are sealed: sensor, jaws, probe and standard are drawn anew, then fibres, and
the raw spans are all that the analysis sees (tests/oracles/sealed_session.py, which shares nothing
with it). Each effect stands alone, then pairs of the largest, a random mixture, and the three
worlds of a laboratory.
"""

import math
import time
from collections import Counter
from dataclasses import dataclass, field, replace

import numpy as np
from tests.oracles.sealed_session import (
    FRIENDLY,
    HARSH,
    REALISTIC,
    STANDARD_EI,
    Fibre,
    Push,
    Session,
    World,
    pushes,
)

from benchmarks.figures import Figure, main, percentile
from cosmic.app.blind_trial import UNSEEN
from cosmic.autonomy.bending.curved import NaturalShape
from cosmic.autonomy.bending.fit import (
    Certificate,
    MeasuredFibre,
    fit_campaign,
    half_width_percent,
    measure_fibre,
)
from cosmic.autonomy.bending.plan import FARTHER, guess_ei, plan_spans
from cosmic.autonomy.bending.result import BendingError, BendingResult, Quality
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.bending.span import Span

NAME = "worlds"
SESSIONS, FIBRES = 20, 16
STEEPEST_DEG = 40.0
LEAST_COVER, MOST_COVER = 90.0, 99.0
OFF_PERCENT, THROWN_PERCENT = 1.0, 15.0
SCALE = 1e-18

CALM = World(
    "calm",
    noise_un=0.03,
    walk_un_sqrt_s=0.01,
    spring=0.1,
    friction=(0.1, 0.3),
    clamp=("log", 20.0, 0.3),
    jaw_un_um=(1500.0, 0.3),
    probe_side_un_um=12.0,
    contact_um=1.0,
    repeat_um=0.3,
    relaxation=(0.01, 0.0),
)

SINGLE = {
    "gain 5 %": {"gain": 0.05},
    "drift of the gain": {"gain_drift": 0.01},
    "cross-talk": {"crosstalk": 0.05, "arc_deg": (35.0, 0.3)},
    "noise": {"noise_un": 0.15, "walk_un_sqrt_s": 0.05},
    "contact place": {"contact_um": 5.0, "repeat_um": 1.0},
    "stage": {"scale": 0.003, "reversal_um": 0.5, "way_um": 0.1},
    "EI along the fibre 15 %": {"ei_cv": 0.15},
    "EI along the fibre 25 %": {"ei_cv": 0.25},
    "kinks": {"hinges_mm": 1.0},
    "twist": {"trend": 0.4},
    "curl": {"arc_deg": (45.0, 0.3), "image_deg": 1.0},
    "relaxation": {"relaxation": (0.06, 0.02)},
    "yield": {"yield_strain": (0.006, 0.3)},
    "shear": {"shear": 40.0},
    "friction 0.5": {"friction": (0.4, 0.6)},
    "adhesion": {"adhesion_un": 3.0},
    "clamp 40 um": {"clamp": ("normal", 40.0, 15.0)},
    "clamp 80 um": {"clamp": ("log", 80.0, 0.4)},
    "soft jaws": {"jaw_un_um": (300.0, 0.5)},
    "slip": {"slip": 0.4},
}
PAIRS = (
    ("EI along the fibre 25 %", "clamp 40 um"),
    ("curl", "friction 0.5"),
    ("relaxation", "soft jaws"),
    ("curl", "EI along the fibre 15 %"),
    ("clamp 80 um", "contact place"),
)


PROVOKED: dict[Quality, dict[str, object]] = {
    Quality.SLIPPED: {"slip": 1.0, "slip_um": (5.0, 10.0)},
    Quality.RELAXED: {"relaxation": (0.12, 0.01)},
    Quality.SET: {"yield_strain": (0.001, 0.1), "set_part": 0.5},
    Quality.HINGE: {"weak": 1.0},
    Quality.NON_UNIFORM: {"ei_cv": 0.5},
    Quality.FRICTION: {"friction": (0.6, 0.7)},
    Quality.CLAMP_DEEP: {"clamp": ("log", 110.0, 0.2)},
    Quality.MOVED: {"moved": 1.0},
    Quality.SATURATED: {"range_un": 25.0},
    Quality.NOT_A_FIBRE: {"not_fibre": 1.0},
}
"""Worlds in which one cause acts so strongly that it has to be named."""

SUREST = (
    Quality.SATURATED,
    Quality.NOT_A_FIBRE,
    Quality.SLIPPED,
    Quality.BROKEN,
    Quality.SET,
    Quality.MOVED,
    Quality.HINGE,
    Quality.RELAXED,
    Quality.CLAMP_DEEP,
    Quality.FRICTION,
    Quality.NON_UNIFORM,
)


def named(result: BendingResult) -> str:
    """Return the cause that a result names first."""
    seen = result.flags | result.notes
    return next((str(each) for each in SUREST if each in seen), "none")


def confusion(sessions: int, fibres: int) -> dict[Quality, Counter[str]]:
    """Return what is named where each cause acts."""
    found: dict[Quality, Counter[str]] = {}
    for cause, change in PROVOKED.items():
        world, counts = replace(CALM, name=str(cause), **change), Counter[str]()
        for seed in range(sessions):
            settings = FitSettings(range_un=world.range_un, **UNSEEN)
            results, _ = session_of(world, 1000 + seed, fibres, settings)
            counts.update(named(each) for each in results)
        found[cause] = counts
    return found


def worlds() -> tuple[World, ...]:
    """Return the worlds, the plain one first."""
    single = [replace(CALM, name=name, **change) for name, change in SINGLE.items()]
    pairs = [
        replace(CALM, name=f"{one}, {other}", **(SINGLE[one] | SINGLE[other]))
        for one, other in PAIRS
    ]
    return (CALM, *single, *pairs, replace(REALISTIC, name="mixture"), FRIENDLY, REALISTIC, HARSH)


def mixed(rng: np.random.Generator) -> World:
    """Return a random mixture: each effect in or out, by chance."""
    change: dict[str, object] = {}
    for each in SINGLE.values():
        if rng.uniform() < 0.35:
            change |= each
    return replace(CALM, name="mixture", **change)


@dataclass
class Tally:
    """What the fibres of a world came to."""

    good: int = 0
    inside: int = 0
    off: int = 0
    right: int = 0
    thrown: int = 0
    tried: int = 0
    halves: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    causes: Counter[str] = field(default_factory=Counter)

    def add(self, result: BendingResult, true_n_m2: float) -> None:
        """Count a result."""
        self.tried += 1
        half = half_width_percent(result)
        error = abs(result.ei_n_m2 / true_n_m2 - 1.0) if result.ei_n_m2 > 0.0 else math.inf
        inside = result.ei_low_n_m2 <= true_n_m2 <= result.ei_high_n_m2
        right = inside and half <= 30.0
        self.right += right
        if not result.trusted:
            self.thrown += right
            self.causes.update(str(each) for each in result.flags)
            return
        self.good += 1
        self.inside += inside
        self.off += 100.0 * error > 2.0 * half
        self.halves.append(half)
        self.errors.append(100.0 * error)


def span_of(push: Push, fibre: Fibre) -> Span:
    """Return a push as the analysis is handed it, with the shape that the image shows."""
    line = fibre.line(fibre.shown_deg)
    rising = np.diff(line[:, 0]) > 0.0
    last = len(line) if rising.all() else int(rising.argmin()) + 1
    shape = NaturalShape(line[:last, 0], line[:last, 1], push.place_um)
    return Span(
        nominal_um=push.place_um,
        probe_x_um=push.place_um,
        hold_x_um=0.0,
        probe_um=push.way_um,
        force_un=push.force_un,
        force_std_un=push.std_un,
        time_s=push.time_s,
        loading=push.loading,
        shape=shape,
    )


def gentle_um(fibre: Fibre) -> float:
    """Return how far from the jaws the image shows a fibre that slopes little enough."""
    line = fibre.line(fibre.shown_deg)
    slope = np.abs(np.degrees(np.arctan2(*np.diff(line, axis=0).T[::-1])))
    steep = slope > STEEPEST_DEG
    return float(line[int(steep.argmax()), 0] if steep.any() else line[-1, 0])


def measured(session: Session, fibre: Fibre, settings: FitSettings) -> list[Span]:
    """Return the spans that a procedure would measure, planned as it goes."""
    spans: list[Span] = []
    free, guess = gentle_um(fibre), 5e-11
    while plan := plan_spans(free, guess, FARTHER, done=spans, settings=settings):
        one = [(plan[0].span_um, plan[0].stroke_um)]
        push = pushes(session, fibre, one, first=len(spans))[0]
        spans.append(span_of(push, fibre))
        if len(spans) == 1:
            guess = guess_ei(spans, settings=settings) or guess
    return spans


def session_of(
    world: World, seed: int, fibres: int, settings: FitSettings
) -> tuple[list[BendingResult], list[float]]:
    """Return the results of a sealed session, and then the truth, N m2."""
    rng = np.random.default_rng(seed)
    world = mixed(rng) if world.name == "mixture" else world
    session = Session(world, rng)
    certificate = Certificate(STANDARD_EI * SCALE, 0.02)
    kept: list[MeasuredFibre] = []
    standards: list[MeasuredFibre] = []
    truths = []
    for number in range(fibres):
        part = number / max(fibres - 1, 1)
        session.time_s = 3600.0 * part
        if world.standard and number in (0, fibres // 2, fibres - 1):
            beam = measured(session, Fibre.standard(session), settings)
            standards.append(
                measure_fibre(beam, settings=settings, part=part, certificate=certificate)
            )
        fibre = Fibre.drawn(session)
        try:
            spans = measured(session, fibre, settings)
            kept.append(measure_fibre(spans, settings=settings, part=part))
        except BendingError:
            continue
        truths.append(fibre.true_ei(max(each.nominal_um for each in spans)) * SCALE)
    results = fit_campaign(kept, standards=standards, settings=settings)
    return list(results), truths


def of_world(world: World, sessions: int, fibres: int) -> Tally:
    """Return what a world's sessions come to."""
    tally, settings = Tally(), FitSettings(**UNSEEN)
    for seed in range(sessions):
        for result, true in zip(*session_of(world, seed, fibres, settings), strict=True):
            tally.add(result, true)
    return tally


def measure(quick: bool = False, only: str = "") -> list[Figure]:
    """Return the figures of one run."""
    figures, began_s, fibres = [], time.process_time(), 0
    chosen = [each for each in worlds() if only in each.name]
    for world in chosen[:1] if quick else chosen:
        tally = of_world(world, 1 if quick else SESSIONS, 3 if quick else FIBRES)
        fibres += tally.tried
        figures += _figures(world, tally)
    if not quick and not only:
        for cause, counts in confusion(2, 16).items():
            missed = 100.0 * (1.0 - counts[str(cause)] / max(sum(counts.values()), 1))
            figures.append(Figure(NAME, f"cause not named first: {cause}", missed, "%", 20.0))
    cost_ms = 1e3 * (time.process_time() - began_s) / max(fibres, 1)
    return [*figures, Figure(NAME, "processor time a fibre, simulation included", cost_ms, "ms")]


def _figures(world: World, tally: Tally) -> list[Figure]:
    name, good = world.name, max(tally.good, 1)
    cover = 100.0 * tally.inside / good
    error = 196.0 * math.sqrt(max(cover / 100.0 * (1.0 - cover / 100.0), 0.02) / good)
    low = max(0.0, LEAST_COVER - cover)
    return [
        Figure(NAME, f"{name}: good of tried", 100.0 * tally.good / max(tally.tried, 1), "%"),
        Figure(NAME, f"{name}: intervals that hold the truth", cover, "%"),
        Figure(NAME, f"{name}: binomial error of that", error, "%"),
        Figure(NAME, f"{name}: that below {LEAST_COVER:g} %", low, "%", error),
        Figure(NAME, f"{name}: good and off by twice", 100.0 * tally.off / good, "%", OFF_PERCENT),
        Figure(
            NAME,
            f"{name}: right and thrown away",
            100.0 * tally.thrown / max(tally.right, 1),
            "%",
            THROWN_PERCENT,
        ),
        Figure(NAME, f"{name}: half width, p50", percentile(tally.halves or [math.nan], 50), "%"),
        Figure(NAME, f"{name}: error, p50", percentile(tally.errors or [math.nan], 50), "%"),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
