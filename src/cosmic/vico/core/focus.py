"""How sharp an image is, and where along a sweep it is sharpest."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Final

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.frame.errors import ConfigError
from cosmic.vico.hw.interface import Frame, FrameStatus, Pixels, Roi

ROUGHEST: Final = 0.5
LEAST_SIGNIFICANCE: Final = 3.0


def around_peak(sweep: Sequence[tuple[float, float]], least: float) -> list[tuple[float, float]]:
    """Return the run of points about the best that are at least `least`, and five at least."""
    best = int(np.argmax([measure for _, measure in sweep]))
    first = last = best
    while first > 0 and sweep[first - 1][1] >= least:
        first -= 1
    while last < len(sweep) - 1 and sweep[last + 1][1] >= least:
        last += 1
    return list(sweep[min(first, max(0, best - 2)) : max(last, best + 2) + 1])


def rough(sweep: Sequence[tuple[float, float]]) -> bool:
    """Return whether neighbours differ as noise does (von Neumann's ratio, 1 for pure noise)."""
    measures = np.array([measure for _, measure in sweep])
    return bool(np.mean(np.diff(measures) ** 2) > ROUGHEST * 2.0 * measures.var(ddof=1))


def vertex(points: Sequence[tuple[float, float]]) -> tuple[float, float] | None:
    """Return the top of the parabola through the logarithms and its standard deviation.

    None where the points make none.
    """
    positions, measures = np.array(points, dtype=np.float64).T
    if len(positions) < 4 or measures.min() <= 0.0:
        return None
    middle, width = positions.mean(), np.ptp(positions)
    design = np.vander((positions - middle) / width, 3)
    inverse = np.linalg.pinv(design.T @ design)
    curve = inverse @ design.T @ np.log(measures)
    error = np.log(measures) - design @ curve
    second, first = float(curve[0]), float(curve[1])
    covariance = inverse * float(error @ error) / (len(positions) - 3)
    if not second < -LEAST_SIGNIFICANCE * math.sqrt(float(covariance[0, 0])):
        return None
    slope = np.array([first / (2.0 * second**2), -1.0 / (2.0 * second), 0.0])
    std = math.sqrt(float(slope @ covariance @ slope))
    return float(middle - width * first / (2.0 * second)), float(width * std)


Grey = npt.NDArray[np.integer[Any] | np.floating[Any]]

SMALLEST_REGION_PX: Final = 16
LEAST_CONTRAST: Final = 0.03
PEAK_SHARE: Final = 0.4
MOST_POSITIONS: Final = 400
NOISE_TIMES: Final = 6.0
FINE_REACH: Final = 1.5
MOST_SWEEPS: Final = 3


class FocusMeasure(StrEnum):
    """How sharpness is measured; each is independent of how bright the lamp is."""

    VARIANCE = "normalised variance"
    TENENGRAD = "Tenengrad"
    LAPLACIAN = "Laplacian"


def sharpness(
    data: Pixels, region: Roi | None = None, measure: FocusMeasure = FocusMeasure.VARIANCE
) -> float:
    """Return how sharp an image is in `region`; larger is sharper.

    Half the size is looked at: it costs a quarter and holds less of the camera's noise. A black
    image gives 0.

    Raises
    ------
    ConfigError
        The region lies not within the image, or is smaller than 16 px.
    """
    part = data if region is None else _cut(data, region)
    grey = cv2.cvtColor(part, cv2.COLOR_RGB2GRAY) if part.ndim == 3 else part
    half = cv2.resize(grey, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    mean = float(cv2.mean(half)[0])
    if mean <= 0.0:
        return 0.0
    return _power(half, measure) / mean**2


def _power(half: Grey, measure: FocusMeasure) -> float:
    if measure is FocusMeasure.VARIANCE:
        return float(cv2.meanStdDev(half)[1][0, 0]) ** 2
    if measure is FocusMeasure.LAPLACIAN:
        return float(cv2.meanStdDev(cv2.Laplacian(half, cv2.CV_32F))[1][0, 0]) ** 2
    across, down = (cv2.Sobel(half, cv2.CV_32F, x, 1 - x) for x in (1, 0))
    return float(cv2.norm(across, cv2.NORM_L2SQR) + cv2.norm(down, cv2.NORM_L2SQR)) / half.size


def _cut(data: Pixels, region: Roi) -> Pixels:
    height, width = data.shape[:2]
    right, bottom = region.x_px + region.width_px, region.y_px + region.height_px
    inside = 0 <= region.x_px < right <= width and 0 <= region.y_px < bottom <= height
    if not (inside and min(region.width_px, region.height_px) >= SMALLEST_REGION_PX):
        raise ConfigError(
            f"focus: the region {region.width_px} x {region.height_px} px at {region.x_px}, "
            f"{region.y_px} must lie within the image of {width} x {height} px and be at least "
            f"{SMALLEST_REGION_PX} px wide and high"
        )
    return data[region.y_px : bottom, region.x_px : right]


def fresh(frame: Frame, since_s: float) -> bool:
    """Return whether `frame` is whole and was exposed from `since_s` on, platform time.

    After a movement only such frames show what it led to: those before wait in the driver.
    """
    return frame.status is FrameStatus.COMPLETE and frame.exposed_s >= since_s


class FocusFault(StrEnum):
    """Why a sweep found no focus."""

    FLAT = "the sharpness is the same everywhere"
    AT_END = "sharpest at the end of the range"
    NOISE = "the curve is too noisy"
    NO_MEASURE = "an image could not be measured"


@dataclass(frozen=True, slots=True)
class FocusAnswer:
    """What a sweep found.

    Attributes
    ----------
    position, std : float or None
        Where it is sharpest and how sure that is, in the drive's own unit; None with a fault.
    text : str
        For the operator, with what to do when there is a fault.
    curve : tuple of (float, float)
        Position and sharpness, in the order measured.
    """

    position: float | None
    std: float | None
    fault: FocusFault | None
    text: str
    curve: tuple[tuple[float, float], ...]


class FocusSearch:
    """Finds the sharpest position: a coarse sweep, a fine one at its peak, a parabola.

    The caller moves the drive to `target`, waits for a frame that is `fresh`, and gives
    `add` the position reached and the sharpness, until `answer` is there. Each sweep goes upwards;
    come to the answer from below as well, so that the drive's play is the same.

    Parameters
    ----------
    low, high : float
        The range, in the drive's own unit.
    coarse_step : float
        At most the depth of field, or the peak falls between two positions.
    frames : int
        Taken at each position; from two on their scatter tells how noisy the measure is.

    Raises
    ------
    ConfigError
        A step or range that makes no sweep.
    """

    def __init__(
        self, low: float, high: float, *, coarse_step: float, fine_step: float, frames: int = 1
    ) -> None:
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise ConfigError(f"focus: the range {low:g} to {high:g} is none")
        if not 0.0 < fine_step <= coarse_step <= (high - low) / 3.0:
            raise ConfigError(
                f"focus: the steps {coarse_step:g} and {fine_step:g} must be above 0, the fine "
                f"one the smaller, and the coarse one at most a third of {high - low:g}"
            )
        positions = (high - low) / coarse_step + 2.0 * FINE_REACH * coarse_step / fine_step
        if not (positions <= MOST_POSITIONS and frames >= 1):
            raise ConfigError(
                f"focus: {positions:.0f} positions with {frames} frames each; at most "
                f"{MOST_POSITIONS} with at least one are made"
            )
        self._low, self._high = low, high
        self._coarse_step, self._fine_step, self._frames = coarse_step, fine_step, frames
        self._sweeps = 0
        self._coarse: list[tuple[float, float]] = []
        self._curve: list[tuple[float, float]] = []
        self._here: list[tuple[float, float]] = []
        self._variances: list[float] = []
        self._answer: FocusAnswer | None = None
        self._begin(low, high, coarse_step)

    @property
    def target(self) -> float | None:
        """Where to measure next; None when there is an answer."""
        return None if self._answer is not None else self._targets[0]

    @property
    def answer(self) -> FocusAnswer | None:
        """What was found; None while it goes on."""
        return self._answer

    def add(self, position: float, measure: float) -> None:
        """Take the sharpness of one fresh frame at `position`, as the drive says where it is."""
        if self._answer is not None:
            return
        if not (math.isfinite(position) and math.isfinite(measure) and measure >= 0.0):
            self._fail(FocusFault.NO_MEASURE, f"at {position:g} the sharpness was {measure:g}")
            return
        self._here.append((position, measure))
        if len(self._here) < self._frames:
            return
        points, measures = zip(*self._here, strict=True)
        if self._frames > 1:
            self._variances.append(float(np.var(measures, ddof=1)))
        self._sweep.append((float(np.mean(points)), float(np.mean(measures))))
        self._curve.append(self._sweep[-1])
        self._here.clear()
        self._targets.pop(0)
        if not self._targets:
            self._evaluate()

    def _begin(self, low: float, high: float, step: float) -> None:
        count = math.ceil((high - low) / step - 1e-9) + 1
        self._targets: list[float] = np.linspace(low, high, count).tolist()
        self._sweep: list[tuple[float, float]] = []
        self._sweeps += 1

    def _evaluate(self) -> None:
        if not self._coarse:
            self._coarse = self._sweep
            if not self._rises():
                self._fail(FocusFault.FLAT, "light it, put something with edges in the region")
                return
            self._refine(max(self._sweep, key=lambda each: each[1])[0])
            return
        index = int(np.argmax([measure for _, measure in self._sweep]))
        point = self._sweep[index][0]
        if 0 < index < len(self._sweep) - 1:
            self._fit(point)
        elif min(point - self._low, self._high - point) < self._fine_step:
            self._fail(FocusFault.AT_END, f"widen the range beyond {point:g}")
        elif self._sweeps < MOST_SWEEPS:
            self._refine(point)
        else:
            self._fail(FocusFault.NOISE, "its peak moves from sweep to sweep; light it better")

    def _rises(self) -> bool:
        measures = [measure for _, measure in self._coarse]
        height = max(measures) - min(measures)
        noise = math.sqrt(float(np.mean(self._variances)) / self._frames) if self._variances else 0
        return height > max(LEAST_CONTRAST * max(measures), NOISE_TIMES * noise)

    def _refine(self, around: float) -> None:
        reach = FINE_REACH * self._coarse_step
        low, high = max(self._low, around - reach), min(self._high, around + reach)
        self._begin(low, high, self._fine_step)

    def _fit(self, best: float) -> None:
        """Fit a parabola to the logarithm of the upper part of the fine sweep."""
        floor = min(measure for _, measure in self._coarse)
        peak = max(measure for _, measure in self._sweep)
        near = around_peak(self._sweep, peak - PEAK_SHARE * (peak - floor))
        found = vertex(near)
        if found is None or not found[1] <= self._coarse_step or rough(self._sweep):
            self._fail(FocusFault.NOISE, "there is no clear peak; light it better, average frames")
            return
        position, std = found
        if not near[0][0] <= position <= near[-1][0]:
            self._fail(FocusFault.NOISE, f"its peak lies away from {best:g}; search again there")
            return
        text = f"sharpest at {position:.4g} ± {std:.2g}"
        self._answer = FocusAnswer(position, std, None, text, tuple(self._curve))

    def _fail(self, fault: FocusFault, advice: str) -> None:
        self._answer = _faulty(tuple(self._curve), fault, advice)


def peak_of(sweep: Sequence[tuple[float, float]]) -> FocusAnswer:
    """Return where one sweep through a known focus is sharpest; five points are the fewest.

    With `FocusFault.AT_END` the position is that end, for the next sweep to be made about it.
    """
    curve = tuple(sweep)
    index = max(range(len(curve)), key=lambda each: curve[each][1])
    least, most = min(each for _, each in curve), curve[index][1]
    if not most - least > LEAST_CONTRAST * most:
        return _faulty(curve, FocusFault.FLAT, "light it, put something with edges in view")
    if index in (0, len(curve) - 1):
        advice = f"search about {curve[index][0]:g}"
        return replace(_faulty(curve, FocusFault.AT_END, advice), position=curve[index][0])
    near = around_peak(curve, most - PEAK_SHARE * (most - least))
    found = vertex(near)
    if found is None or rough(curve) or not near[0][0] <= found[0] <= near[-1][0]:
        return _faulty(curve, FocusFault.NOISE, "there is no clear peak; light it better")
    return FocusAnswer(*found, None, f"sharpest at {found[0]:.4g} ± {found[1]:.2g}", curve)


def _faulty(curve: tuple[tuple[float, float], ...], fault: FocusFault, advice: str) -> FocusAnswer:
    return FocusAnswer(None, None, fault, f"no focus found: {fault.value}; {advice}", curve)
