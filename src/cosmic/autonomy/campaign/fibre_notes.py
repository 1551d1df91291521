"""What becomes of a fibre in hand, as the record that is kept of it."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from cosmic.autonomy.campaign.records import (
    FibreRecord,
    OperationRecord,
    Outcome,
    Picture,
    Pose,
    Series,
    Shape,
)
from cosmic.autonomy.handling.plate import Candidate
from cosmic.autonomy.handling.work import FibreInHand
from cosmic.autonomy.procedures.tree import ENDS, OPERATION, NodeEvent
from cosmic.vico.core.picture import Picture as TakenPicture

GEOMETRY: Final = "geometry"
ROOM_PX: Final = 40


def pose_of(candidate: Candidate) -> Pose:
    """Return where a fibre lies on the plate, turned with the line through its ends."""
    x, y = candidate.place_um
    (x0, y0), (x1, y1) = candidate.line_um[0].tolist(), candidate.line_um[-1].tolist()
    return Pose(x, y, math.degrees(math.atan2(y1 - y0, x1 - x0)))


def felt_s(fibre: FibreInHand) -> tuple[float, float] | None:
    """Return from when until when the force was that of this fibre; None: all the time.

    Of two hands one has the probe, and its fibre the force.
    """
    if not fibre.hand:
        return None
    if fibre.probe_from_s is None:
        return math.inf, math.inf
    return fibre.probe_from_s, fibre.probe_until_s or math.inf


def operations_of(events: Sequence[NodeEvent]) -> tuple[OperationRecord, ...]:
    """Return the tries of operations that have ended, in their order."""
    return tuple(
        OperationRecord(
            name=each.name,
            began_s=each.started_s,
            ended_s=each.ended_s,
            attempt=each.attempt,
            cause=each.cause,
            text=each.text,
        )
        for each in events
        if each.kind == OPERATION
        and each.state in ENDS
        and each.started_s is not None
        and each.ended_s is not None
    )


def record_of(
    fibre: FibreInHand,
    number: int,
    *,
    ended_s: float,
    measures: bool,
    pictures: bool,
    events: Sequence[NodeEvent],
    series: tuple[Series, ...],
    interrupted: str = "",
) -> FibreRecord:
    """Return the record of a fibre whose treatment has ended.

    Parameters
    ----------
    number : int
        As the store gave it.
    ended_s : float
        On the platform's clock, for a fibre that does not know.
    measures : bool
        The procedure measures: without a result the fibre is no good one.
    pictures : bool
        Keep its pictures.
    interrupted : str
        Why the treatment was cut off; empty when it was not.
    """
    outcome, cause, text = _outcome(fibre, measures=measures, interrupted=interrupted)
    return FibreRecord(
        number=number,
        outcome=outcome,
        began_s=fibre.found_s,
        ended_s=fibre.done_s or ended_s,
        found=pose_of(fibre.reach.candidate),
        shape=Shape(
            length_um=fibre.length_um,
            length_std_um=fibre.length_std_um,
            width_um=fibre.width_um,
            width_std_um=fibre.width_std_um,
            curl=fibre.curl,
            curl_std=fibre.curl_std,
        ),
        cause=cause,
        text=text,
        attempts=max(fibre.tries, 1),
        peak_force_un=fibre.peak_un,
        bending=fibre.bending,
        spans=tuple(fibre.spans),
        pictures=tuple(
            _picture(name, each, _region_px(fibre, each) if name == GEOMETRY else None)
            for name, each in fibre.pictures.items()
        )
        if pictures
        else (),
        operations=operations_of(events),
        series=series,
    )


def _outcome(fibre: FibreInHand, *, measures: bool, interrupted: str) -> tuple[Outcome, str, str]:
    if interrupted:
        return Outcome.INTERRUPTED, "interrupted", interrupted
    if fibre.failure is not None:
        doubtful = fibre.bending is not None
        outcome = Outcome.DOUBTFUL if doubtful else Outcome.FAILED
        return outcome, fibre.failure.cause, fibre.failure.text
    if measures and (fibre.bending is None or not fibre.bending.trusted):
        reasons = "; ".join(fibre.bending.reasons) if fibre.bending is not None else "no result"
        return Outcome.DOUBTFUL, "not trusted", reasons
    return Outcome.GOOD, "", ""


def _picture(
    name: str, taken: TakenPicture, region_px: tuple[int, int, int, int] | None
) -> Picture:
    def known(value: float | None) -> float:
        return math.nan if value is None else value

    now = taken.circumstances
    return Picture(
        name=name,
        pixels=taken.data,
        taken_s=taken.frame.exposed_s,
        scale_um_px=known(now.scale_um_px),
        zoom=known(now.zoom_counts),
        focus_um=math.nan,
        light_percent=known(now.light_percent),
        region_px=region_px,
    )


def _region_px(fibre: FibreInHand, taken: TakenPicture) -> tuple[int, int, int, int] | None:
    """Return the part of a picture with the fibre in it, with room around it."""
    line = fibre.line_px
    if line is None:
        return None
    height, width = taken.data.shape[:2]
    low = np.clip(np.floor(line.min(axis=0)) - ROOM_PX, 0, None).astype(int)
    high = np.ceil(line.max(axis=0)).astype(int) + ROOM_PX
    right, bottom = min(int(high[0]), width), min(int(high[1]), height)
    return int(low[0]), int(low[1]), right - int(low[0]), bottom - int(low[1])
