"""Measure the map from stage to image, and the table's rotation centre, from points tracked."""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.frame.arrays import Floats
from cosmic.frame.errors import CosmicError
from cosmic.vico.core.pixel_map import Pair, PixelMap, as_matrix, as_pair, straightened

FEWEST_POINTS: Final = 4
LARGEST_RMS_PX: Final = 0.5
OUTLIER_PX: Final = 1.5
OUTLIER_SHARE: Final = 0.25
SMALLEST_SPREAD_PX: Final = 15.0
NARROWEST: Final = 0.1
LARGEST_ANISOTROPY: Final = 0.05
MOST_TRIPLES: Final = 400
SURE_PX: Final = 0.1
"""Standard deviation below which all sightings count alike."""
BENT_PART: Final = 0.03
"""By what part of its distance a lens may move a corner of the image."""
BENT_PARTS: Final = (0.0, -0.04, -0.02, -0.01, 0.01, 0.02, 0.04)
FEWEST_BENT: Final = 7
"""Points from which that can be told."""
ROUNDS: Final = 4
STD_TIMES: Final = 4.0
"""By so much what an edge's scatter says is too small where something lies across it."""

FEWEST_ANGLES: Final = 5
SMALLEST_TURN_DEG: Final = 30.0
LARGEST_RMS_UM: Final = 3.0
LARGEST_CENTRE_STD_UM: Final = 2.0
SMALLEST_RADIUS_UM: Final = 100.0


class CalibrationRefused(CosmicError):  # noqa: N818 - reads as what happened
    """What was measured does not make a calibration; the text says why and what to do."""


@dataclass(frozen=True, slots=True)
class Sighting:
    """Where the thing that is tracked was seen while the stages stood somewhere.

    Attributes
    ----------
    platform_um : (float, float)
        By the stages' encoders.
    image_px : (float, float)
        On the whole sensor, unbinned; see `PixelMap`.
    label : str
        How an outlier is named; empty: by its number, from 1.
    std_px : float
        Standard deviation of a coordinate in the image; what is less sure counts less.
    """

    platform_um: Pair
    image_px: Pair
    label: str = ""
    std_px: float = 0.0


@dataclass(frozen=True, slots=True)
class MapFit:
    """A map with what is left over.

    Attributes
    ----------
    rms_px, max_px : float
        Distance between where the points used were seen and where the map says.
    outliers : tuple of str
        Sightings left out, each with how far off it is.
    """

    map: PixelMap
    rms_px: float
    max_px: float
    outliers: tuple[str, ...] = ()


def fit_map(
    sightings: Sequence[Sighting],
    *,
    limit_px: float = LARGEST_RMS_PX,
    axis_px: Pair | None = None,
) -> MapFit:
    """Fit the map from stage to image.

    Parameters
    ----------
    axis_px : (float, float) or None
        The middle of the sensor, about which a lens bends the image; None: it is taken to be
        straight.

    Raises
    ------
    CalibrationRefused
        Too few points, too close together or on a line; too many outliers; residual above
        `limit_px` RMS, where unsure sightings count less; the two axes are seen at different
        scales.
    """
    points = np.array([each.platform_um for each in sightings], dtype=np.float64).reshape(-1, 2)
    seen = np.array([each.image_px for each in sightings], dtype=np.float64).reshape(-1, 2)
    if not (np.isfinite(points).all() and np.isfinite(seen).all()):
        raise CalibrationRefused("calibration: a point or a pixel is not a number; track again")
    _check_points(points, seen)
    weights = _weights(sightings)
    kept = _inliers(points, seen, weights, axis_px)
    left_out = np.flatnonzero(~kept).tolist()
    fitted, residuals_px = _least_squares(points[kept], seen[kept], weights[kept], axis_px)
    off_px = np.linalg.norm(fitted.to_px(points) - seen, axis=1)
    outliers = tuple(
        f"{sightings[i].label or f'point {i + 1}'}: {off_px[i]:.1f} px off" for i in left_out
    )
    if len(left_out) > OUTLIER_SHARE * len(sightings) or kept.sum() < FEWEST_POINTS:
        raise CalibrationRefused(
            f"calibration: {len(left_out)} of {len(sightings)} points do not fit the others "
            f"({'; '.join(outliers)}); check that the right object was tracked and is in focus"
        )
    _check_points(points[kept], seen[kept])
    rms_px = math.sqrt(float(np.average(residuals_px**2, weights=weights[kept])))
    _check_map(fitted, rms_px, limit_px)
    return MapFit(fitted, rms_px, float(residuals_px.max()), outliers)


def _check_points(points: Floats, seen: Floats) -> None:
    if len(points) < FEWEST_POINTS:
        raise CalibrationRefused(
            f"calibration: {len(points)} points, at least {FEWEST_POINTS} are needed"
        )
    asked = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    if not asked[1] > NARROWEST * asked[0]:
        raise CalibrationRefused(
            "calibration: the stage moved along a line only; move in both directions"
        )
    # Of the image itself, so that a thing that did not move with the stage is caught as well.
    spread_px = np.linalg.svd(seen - seen.mean(axis=0), compute_uv=False)[1] / math.sqrt(len(seen))
    if not spread_px >= SMALLEST_SPREAD_PX:
        raise CalibrationRefused(
            f"calibration: the points spread over {spread_px:.1f} px across, "
            f"{SMALLEST_SPREAD_PX:g} px are needed; move further, and check that the tracked "
            "object moves with the stage"
        )


def _check_map(fitted: PixelMap, rms_px: float, limit_px: float) -> None:
    if not rms_px <= limit_px:
        raise CalibrationRefused(
            f"calibration: residual of {rms_px:.2f} px RMS, at most {limit_px:g} px are accepted; "
            "focus, wait until the stage is stationary before each image, and measure again"
        )
    if not fitted.anisotropy <= LARGEST_ANISOTROPY:
        raise CalibrationRefused(
            f"calibration: one direction is seen {100.0 * fitted.anisotropy:.0f} % larger than "
            "the other; check that both axes reached their targets"
        )


def _weights(sightings: Sequence[Sighting]) -> Floats:
    """Return how much each sighting counts; 1 for those that are sure."""
    std_px = STD_TIMES * np.array([each.std_px for each in sightings], dtype=np.float64)
    return np.asarray(SURE_PX**2 / (SURE_PX**2 + std_px**2))


def _least_squares(
    points: Floats, seen: Floats, weights: Floats, axis_px: Pair | None
) -> tuple[PixelMap, Floats]:
    """Return the map and how far each point is from it, px."""
    axis, bend = axis_px or (0.0, 0.0), 0.0
    fitted = _straight_map(points, seen, weights, axis, bend)
    for _ in range(ROUNDS if axis_px is not None and len(points) >= FEWEST_BENT else 0):
        bend += _more_bend(fitted, points, seen, weights)
        fitted = _straight_map(points, straightened(seen, axis, bend), weights, axis, bend)
    error = fitted.to_px(points) - seen
    return fitted, np.asarray(np.linalg.norm(error, axis=1))


def _straight_map(
    points: Floats, seen: Floats, weights: Floats, axis_px: Pair, bend_px2: float
) -> PixelMap:
    """Return the map of what was put straight."""
    centre_um = weights @ points / weights.sum()
    centre_px = weights @ seen / weights.sum()
    away, root = points - centre_um, np.sqrt(weights)[:, None]
    solution = np.linalg.lstsq(root * away, root * (seen - centre_px), rcond=None)[0]
    error = away @ solution - (seen - centre_px)
    # Two coordinates a point; six numbers of the map are taken from them.
    freedom = max(1, 2 * len(points) - 6)
    return PixelMap(
        as_matrix(solution.T),
        as_pair(centre_um),
        as_pair(centre_px),
        math.sqrt(float(np.sum((root * error) ** 2)) / freedom),
        as_matrix(np.linalg.inv((root * away).T @ (root * away))),
        len(points),
        axis_px,
        bend_px2,
    )


def _more_bend(fitted: PixelMap, points: Floats, seen: Floats, weights: Floats) -> float:
    """Return by how much more the lens bends than a map says, a straight map left aside."""
    straight = straightened(fitted.to_px(points), fitted.axis_px, fitted.bend_px2)
    away = straight - fitted.axis_px
    moved = away * (away * away).sum(axis=1, keepdims=True)
    root = np.sqrt(weights)[:, None]
    flat = np.column_stack([np.ones(len(points)), points - fitted.centre_um]) * root
    moved, left = root * moved, root * (seen - fitted.to_px(points))
    moved = moved - flat @ np.linalg.lstsq(flat, moved, rcond=None)[0]
    usual = BENT_PART / math.hypot(*fitted.axis_px) ** 2
    # A lens bends by some per cent at most: what the points do not tell is taken to be none.
    unsure = (SURE_PX / usual) ** 2
    return float(np.sum(moved * left) - unsure * fitted.bend_px2) / float(
        np.sum(moved * moved) + unsure
    )


def _inliers(
    points: Floats, seen: Floats, weights: Floats, axis_px: Pair | None
) -> npt.NDArray[np.bool_]:
    """Return which sightings agree with most of the others (least median of squares)."""
    best_px, kept = math.inf, np.ones(len(points), dtype=np.bool_)
    for straight in _straight_fits(seen, axis_px):
        for triple in _triples(len(points)):
            corners = np.column_stack([points[triple], np.ones(3)])
            if abs(np.linalg.det(corners)) < 1e-6 * max(1.0, float(np.ptp(points)) ** 2):
                continue
            affine = np.linalg.solve(corners, straight[triple])
            off_px = np.linalg.norm(
                np.column_stack([points, np.ones(len(points))]) @ affine - straight, axis=1
            )
            middle_px = float(np.median(off_px))
            if middle_px < best_px:
                best_px, kept = middle_px, off_px <= max(2.0 * OUTLIER_PX, 4.0 * middle_px)
    for _ in range(3):
        if kept.sum() < FEWEST_POINTS:
            return kept
        fitted, near_px = _least_squares(points[kept], seen[kept], weights[kept], axis_px)
        off_px = np.linalg.norm(fitted.to_px(points) - seen, axis=1)
        limit_px = max(OUTLIER_PX, 4.0 * float(np.median(near_px)))
        kept = off_px <= limit_px
    return kept


def _straight_fits(seen: Floats, axis_px: Pair | None) -> list[Floats]:
    """Return what was seen, put straight for lenses that bend by different amounts."""
    if axis_px is None:
        return [seen]
    corner = math.hypot(*axis_px) ** 2
    return [straightened(seen, axis_px, part / corner) for part in BENT_PARTS]


def _triples(count: int) -> Iterator[list[int]]:
    total = math.comb(count, 3)
    if total <= MOST_TRIPLES:
        yield from (list(each) for each in itertools.combinations(range(count), 3))
        return
    rng = np.random.default_rng(0)
    for _ in range(MOST_TRIPLES):
        yield rng.choice(count, size=3, replace=False).tolist()


@dataclass(frozen=True, slots=True)
class RotationFit:
    """About which point the table turns.

    Attributes
    ----------
    rms_um, max_um : float
        How far the points seen are from the circle, at the angle each was seen at.
    std_um : float
        Standard deviation of the centre, in the direction that is known least.
    sense : int
        1 where a growing angle turns from the platform's x towards its y; -1 the other way.
    """

    centre_um: Pair
    radius_um: float
    rms_um: float
    max_um: float
    std_um: float
    sense: int
    angles: int


def fit_rotation(
    angles_deg: Sequence[float],
    points_um: Sequence[Pair],
    *,
    limit_um: float = LARGEST_RMS_UM,
    limit_std_um: float = LARGEST_CENTRE_STD_UM,
) -> RotationFit:
    """Fit the circle on which a thing on the table goes round; angles by the table's encoder.

    Raises
    ------
    CalibrationRefused
        Fewer than five angles, too small a turn, a thing that hardly moves, a residual above
        `limit_um` RMS, or a centre less sure than `limit_std_um`.
    """
    angles = np.radians(np.asarray(angles_deg, dtype=np.float64))
    points = np.asarray(points_um, dtype=np.float64).reshape(-1, 2)
    _check_angles(angles, points)
    found = min((_circle(angles, points, sense) for sense in (1, -1)), key=lambda each: each.rms_um)
    if not found.radius_um >= SMALLEST_RADIUS_UM:
        raise CalibrationRefused(
            f"rotation centre: the tracked object moves on a radius of {found.radius_um:.0f} "
            "um, at least "
            f"{SMALLEST_RADIUS_UM:g} um are needed; choose another object and check that it "
            "turns with the table"
        )
    if not found.rms_um <= limit_um:
        raise CalibrationRefused(
            f"rotation centre: residual of {found.rms_um:.1f} um RMS, at most {limit_um:g} um are "
            "accepted; check that the tracked object is fixed to the table and that the "
            "scale is right"
        )
    if not found.std_um <= limit_std_um:
        raise CalibrationRefused(
            f"rotation centre: known to {found.std_um:.1f} um only, {limit_std_um:g} um are "
            "needed; turn further, or take more angles"
        )
    return found


def _check_angles(angles: Floats, points: Floats) -> None:
    if len(angles) != len(points):
        raise CalibrationRefused(
            f"rotation centre: {len(angles)} angles and {len(points)} points; one point an angle"
        )
    if not (np.isfinite(angles).all() and np.isfinite(points).all()):
        raise CalibrationRefused("rotation centre: an angle or a point is not a number")
    different = len(np.unique(np.round(np.degrees(angles))))
    if different < FEWEST_ANGLES:
        raise CalibrationRefused(
            f"rotation centre: {different} angles, at least {FEWEST_ANGLES} are needed, "
            "a degree or more apart"
        )
    turn_deg = float(np.degrees(np.ptp(angles)))
    if not turn_deg >= SMALLEST_TURN_DEG:
        raise CalibrationRefused(
            f"rotation centre: a turn of {turn_deg:.0f} degrees, at least "
            f"{SMALLEST_TURN_DEG:g} are needed"
        )


def _circle(angles: Floats, points: Floats, sense: int) -> RotationFit:
    """Fit centre and spoke; that the angles are known makes it linear, and surer than a circle."""
    cosine, sine = np.cos(angles), sense * np.sin(angles)
    ones, zeros = np.ones_like(angles), np.zeros_like(angles)
    design = np.concatenate(
        [
            np.column_stack([ones, zeros, cosine, -sine]),
            np.column_stack([zeros, ones, sine, cosine]),
        ]
    )
    solution = np.linalg.lstsq(design, points.T.reshape(-1), rcond=None)[0]
    error = (design @ solution - points.T.reshape(-1)).reshape(2, -1)
    off_um = np.linalg.norm(error, axis=0)
    freedom = max(1, 2 * len(angles) - 4)
    covariance = np.linalg.inv(design.T @ design) * float(np.sum(error**2)) / freedom
    return RotationFit(
        as_pair(solution[:2]),
        float(np.hypot(*solution[2:])),
        float(np.sqrt(np.mean(off_um**2))),
        float(off_um.max()),
        float(np.sqrt(np.linalg.eigvalsh(covariance[:2, :2]).max())),
        sense,
        len(angles),
    )
