"""Records such as a campaign makes, from simulated pushes and drawn images."""

import math
from functools import cache

import numpy as np

from cosmic.autonomy.bending.fit import fit_bending
from cosmic.autonomy.bending.plan import plan_spans
from cosmic.autonomy.bending.result import BendingResult
from cosmic.autonomy.bending.span import Span
from cosmic.autonomy.campaign.records import (
    CampaignInfo,
    FibreImage,
    FibreRecord,
    OperationRecord,
    Outcome,
    Pose,
    Series,
    Shape,
)
from oracles.bent_fibre import Rig

INFO = CampaignInfo(
    name="quick",
    procedure="bend test",
    sample="three-dry",
    recipe_text='procedure = "bend test"\n',
    started="2026-03-02T09:30:00+01:00",
    description="A quick look",
    seed=7,
    rate=20.0,
    versions={"cosmic": "0.1.0", "numpy": "2.4.6"},
)

OPERATIONS = {
    "survey": 2.1,
    "approach": 2.4,
    "close": 1.1,
    "lift": 3.9,
    "push": 11.0,
    "release": 4.2,
}


@cache
def measured(ei_n_m2: float = 5e-11, seed: int = 0) -> tuple[tuple[Span, ...], BendingResult]:
    """Return the spans of one fibre and what was fitted to them."""
    rig = Rig.drawn(ei_n_m2, np.random.default_rng(seed))
    spans = tuple(rig.push(p.span_um, p.stroke_um) for p in plan_spans(1200.0, ei_n_m2))
    return spans, fit_bending(spans)


def image(seed: int = 0, size: tuple[int, int] = (240, 320)) -> FibreImage:
    """Return an image of a bow, dark on light."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[: size[0], : size[1]].astype(float)
    bow = size[0] / 2 + 30.0 * np.sin(x / size[1] * math.pi + seed)
    inside = (np.abs(y - bow) < 5.0) & (x > 40) & (x < size[1] - 40)
    grey = np.where(inside, 70.0, 165.0) + 3.0 * rng.standard_normal(size)
    pixels = grey.astype(np.uint8)
    region = (40, int(bow.min()) - 5, size[1] - 80, int(np.ptp(bow)) + 10)
    return FibreImage("before grasp", pixels, 12.0, 7.6, 0.58, 0.0, 50.0, region)


def good(
    number: int, *, ei_n_m2: float = 5e-11, seed: int = 0, began_s: float = 0.0
) -> FibreRecord:
    """Return the record of a fibre that was measured."""
    rng = np.random.default_rng(seed)
    spans, result = measured(ei_n_m2, seed)
    steps, now = [], began_s
    for name, typical in OPERATIONS.items():
        took = typical * float(np.exp(0.15 * rng.standard_normal()))
        steps.append(OperationRecord(name, now, now + took))
        now += took
    times = np.linspace(began_s, now, 60)
    return FibreRecord(
        number,
        Outcome.GOOD if result.trusted else Outcome.DOUBTFUL,
        began_s,
        now,
        found=Pose(300.0 * number, -150.0, 12.0),
        left=Pose(-9000.0, 0.0, 0.0),
        shape=Shape(1180.0 + 40.0 * float(rng.standard_normal()), 6.0, 31.0, 0.06),
        peak_force_un=max(each.peak_un for each in result.spans),
        bending=result,
        spans=spans,
        images=(image(seed),),
        operations=tuple(steps),
        series=(
            Series("left.x", "um", times, np.cumsum(rng.standard_normal(60))),
            Series("force", "uN", times, rng.standard_normal(60)),
        ),
    )


def failed(number: int, cause: str = "missed grasp", *, began_s: float = 0.0) -> FibreRecord:
    """Return the record of a fibre that could not be measured."""
    return FibreRecord(
        number,
        Outcome.FAILED,
        began_s,
        began_s + 14.0,
        found=Pose(300.0 * number, 400.0, -40.0),
        shape=Shape(1500.0, 8.0, 28.0, 0.2),
        cause=cause,
        text="the fibre did not follow the jaws in 4 tries: look at its image",
        attempts=4,
        images=(image(number),),
        operations=(
            OperationRecord("approach", began_s, began_s + 2.0),
            OperationRecord("close", began_s + 2.0, began_s + 3.0, 1, cause, "try 1"),
            OperationRecord("close", began_s + 5.0, began_s + 6.0, 2, cause, "try 2"),
        ),
    )
