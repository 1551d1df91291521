"""Bending stiffness of simulated fibres: how far off it is, and whether the interval says so.

The fibres are integrated step by step and measured with all the errors that are foreseen (noise,
drift, gain, clamp, place of contact, sensor giving way, a fibre that clings to the probe); see
tests/oracles/bent_fibre.py. Beside three spans stands what one span alone would say.
"""

import time

import numpy as np
from tests.oracles.bent_fibre import Rig

from benchmarks.figures import Figure, main, percentile
from cosmic.autonomy.bending.fit import fit_bending
from cosmic.autonomy.bending.plan import plan_spans

NAME = "bending"
STIFFNESSES_N_M2 = (1e-13, 3e-13, 1e-12, 5e-12, 5e-11, 2e-10)
GOAL_FROM_N_M2 = 1e-12
MEDIAN_PERCENT, P90_PERCENT = 5.0, 10.0
LEAST_COVER, MOST_COVER = 90.0, 99.0
GUESS_SPREAD_LN = 0.2
FREE_UM = 1200.0


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    figures, began_s, draws = [], time.process_time(), 4 if quick else 1500
    for ei_n_m2 in STIFFNESSES_N_M2:
        figures += _of(ei_n_m2, draws)
    fits = 2 * draws * len(STIFFNESSES_N_M2)
    cost_ms = 1e3 * (time.process_time() - began_s) / fits
    return [*figures, Figure(NAME, "processor time a fibre, simulation included", cost_ms, "ms")]


def _of(ei_n_m2: float, draws: int) -> list[Figure]:
    rng, three, one = np.random.default_rng(11), [], []
    covered = trusted = 0
    for _ in range(draws):
        rig = Rig.drawn(ei_n_m2, rng)
        guess = ei_n_m2 * float(np.exp(GUESS_SPREAD_LN * rng.standard_normal()))
        plan = plan_spans(FREE_UM, guess)
        spans = [rig.push(each.span_um, each.stroke_um) for each in plan]
        found, alone = fit_bending(spans), fit_bending(spans[1:2])
        three.append(100.0 * abs(found.ei_n_m2 / ei_n_m2 - 1.0))
        one.append(100.0 * abs(alone.ei_n_m2 / ei_n_m2 - 1.0))
        covered += found.ei_low_n_m2 <= ei_n_m2 <= found.ei_high_n_m2
        trusted += found.trusted
    goal = ei_n_m2 >= GOAL_FROM_N_M2
    cover, of = 100.0 * covered / draws, f"EI {ei_n_m2:.0e} N m2"
    middle, worst = percentile(three, 50), percentile(three, 90)
    beside = 0.5 * (LEAST_COVER + MOST_COVER)
    return [
        Figure(NAME, f"{of}: error, p50", middle, "%", MEDIAN_PERCENT if goal else None),
        Figure(NAME, f"{of}: error, p90", worst, "%", P90_PERCENT if goal else None),
        # A figure is met by being small: the share stands as its way from the middle.
        Figure(NAME, f"{of}: 95 % intervals that hold the truth", cover, "%"),
        Figure(NAME, f"{of}: that share beside {beside:g} %", abs(cover - beside), "%", 4.5),
        Figure(NAME, f"{of}: trusted", 100.0 * trusted / draws, "%"),
        Figure(NAME, f"{of}: error of one span alone, p50", percentile(one, 50), "%"),
        Figure(NAME, f"{of}: error to that of one span", middle / percentile(one, 50), ""),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
