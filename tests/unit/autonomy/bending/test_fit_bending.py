"""Bending stiffness from simulated pushes, against an independent model."""

import numpy as np

from cosmic.autonomy.bending.fit import fit_bending
from cosmic.autonomy.bending.plan import plan_spans
from oracles.bent_fibre import Rig


def test_a_dry_fibre_is_measured_within_a_few_percent() -> None:
    rig = Rig(5e-11, np.random.default_rng(3))
    spans = [rig.push(p.span_um, p.stroke_um) for p in plan_spans(1200.0, 5e-11)]
    found = fit_bending(spans)
    assert abs(found.ei_n_m2 / 5e-11 - 1.0) < 0.05
    assert found.ei_low_n_m2 < 5e-11 < found.ei_high_n_m2
    assert found.trusted, found.reasons
