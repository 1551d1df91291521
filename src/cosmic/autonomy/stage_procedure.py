"""Measuring the map from platform to image: a tool goes to positions, its tip is looked for."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from typing import Final, TypeVar

import cv2
import numpy as np

from cosmic.autonomy.calibrations import Calibrations
from cosmic.autonomy.moving import Mover
from cosmic.autonomy.tools import axis_targets, tip_um
from cosmic.frame.arrays import ByteMask, Floats
from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.operation import Task
from cosmic.mico.api.mico import Mico
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.core.calibration import Plane
from cosmic.vico.core.calibration_fit import CalibrationRefused, MapFit, Sighting, fit_map
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.tool_settings import ToolSettings
from cosmic.vico.core.vision.algorithms import grey
from cosmic.vico.core.vision.tips import find_gripper, find_probe
from cosmic.vico.core.vision.tool_types import ExpectedTool, GripperTips, NotSeen
from cosmic.vico.hw.interface import CameraSettings, Pixels

T = TypeVar("T")

LEAST_CHANGE: Final = 15.0
"""Grey levels of 255 that count as a change at least."""
CHANGE_SHARE: Final = 0.5
"""Of the largest change."""
BROAD: Final = 0.6
"""Narrower than this part of the tool's width is no tool: fibres, edges, noise."""


def uncovered(before: Pixels, after: Pixels, width_px: float) -> ByteMask:
    """Return where a dark tool stood before and does not afterwards, without what is narrow."""
    scale = 1.0 if before.dtype == np.uint8 else 255.0 / max(1.0, float(before.max()))
    change = cv2.blur(scale * (after.astype(np.float32) - before.astype(np.float32)), (3, 3))
    level = max(LEAST_CHANGE, CHANGE_SHARE * float(np.percentile(change, 99.99)))
    size = max(3, round(BROAD * width_px))
    mask = (change > level).astype(np.uint8)
    opened = cv2.morphologyEx(mask, cv2.MORPH_OPEN, np.ones((size, size), np.uint8))
    return np.asarray(opened, dtype=np.uint8)


def middle(mask: ByteMask) -> Floats | None:
    """Return the middle of what is marked, x and y; None where nothing is.

    Of a gripper the jaws' ends are marked, each as a patch: what lies between their middles counts.
    """
    count, _, stats, centres = cv2.connectedComponentsWithStats(mask)
    areas = stats[1:count, cv2.CC_STAT_AREA]
    if not areas.size:
        return None
    large = centres[1:count][areas > 0.5 * areas.max()]
    return np.asarray(large.mean(axis=0), dtype=np.float64)


IMAGE_S: Final = 5.0
SEARCH_PART: Final = 0.8
"""Of the tool's width: how far it moves at once while it is looked for."""
REACH_PX: Final = 40.0
GRID: Final = 3
LARGEST_PART: Final = 0.25
"""Of the image: how far the grid reaches to each side."""
UNSURE_PX: Final = 0.1
"""A tip that is seen less surely is looked at again beside: a fibre may lie across its front."""
BESIDE: Final = ((0.0, 0.0), (-1.2, 0.9), (-1.2, -0.9))
"""Where it is looked at, one after the other: ahead and aside, in widths of the tool."""


@dataclass(frozen=True, slots=True)
class TipMap:
    """A first idea of the map: where the tip is seen at a position, and what moves do."""

    position_um: Floats
    tip_px: Floats
    px_um: Floats

    def px(self, position_um: Floats) -> Floats:
        """Return where the tip is seen at a position, shape (2,)."""
        return np.asarray(self.tip_px + self.px_um @ (position_um - self.position_um))

    def um(self, point_px: Floats) -> Floats:
        """Return where the tip is that is seen at a pixel, shape (2,)."""
        return np.asarray(self.position_um + np.linalg.solve(self.px_um, point_px - self.tip_px))


@dataclass(frozen=True, slots=True)
class TipSeen:
    """The tip on an image: where, and the standard deviation of a coordinate; its pixels."""

    point_px: Floats
    std_px: float


class StageProcedure:
    """One calibration of a camera by one tool; run in ViCo's thread."""

    def __init__(
        self,
        vico: VicoApplication,
        mico: Mico,
        calibrations: Calibrations,
        tool: ToolSettings,
        camera: str,
    ) -> None:
        self._unit = vico.unit(camera)
        self._calibrations = calibrations
        self._tool = tool
        self._camera = camera
        self._mover = Mover(mico, {tool.x_axis: "um", tool.y_axis: "um"}, vico.clock)
        self._clock = vico.clock
        self._source = f"calibration of {camera}"

    def run(self, task: Task) -> None:
        """Measure, keep, and go back where the tool was."""
        try:
            plane = self.around(task, self._measure)
            self._calibrations.add_plane(self._camera, self._tool.name, plane)
            task.report(1.0, _said(plane.fit))
            task.finish()
        except CosmicError as exc:
            task.fail(exc)

    def around(self, task: Task, measure: Callable[[Task, Floats], T]) -> T:
        """Return what `measure` finds from where the tip is now, and go back; raises as it does."""
        begun = self._position()
        self._mover.remember()
        try:
            return measure(task, begun)
        finally:
            self._mover.go_back(task, self._source)

    @property
    def ahead(self) -> Floats:
        """Where the tool points, shape (2,), of length 1."""
        return np.asarray(np.array(self._tool.forward) / math.hypot(*self._tool.forward))

    def first_idea(self, task: Task, begun: Floats) -> TipMap:
        """Find the tip, and return about where it is seen at a position."""
        return self._search(task, self._image(self._clock.now_s()), begun[:2])

    def move(self, task: Task, position_um: Floats) -> None:
        """Move the tip to a position of the platform, shape (2,)."""
        self._go(task, position_um)

    def _measure(self, task: Task, begun: Floats) -> Plane:
        first = self._image(self._clock.now_s())
        guess = self._search(task, first, begun[:2])
        positions = self._grid(guess, first)
        sightings = []
        for number, position in enumerate(positions, start=1):
            task.report(number / (len(positions) + 1), f"position {number} of {len(positions)}")
            seen = self._surest(task, position, guess)
            if seen is not None:
                sightings.append(seen)
        zoom = self._zoom(first)
        after = self._image(self._clock.now_s())
        if abs(self._zoom(after) - zoom) > 0.5:
            raise CalibrationRefused(
                "calibration: the zoom changed during the measurement; leave it and try again"
            )
        fit = fit_map(sightings, axis_px=self._axis_px())
        return Plane(zoom, float(begun[2]), fit, datetime.now(UTC).replace(microsecond=0))

    def _axis_px(self) -> tuple[float, float] | None:
        """Return the middle of the whole sensor; None where the camera does not tell its size."""
        info = self._unit.thread.info
        if info is None or not all(info.sensor_px):
            return None
        width, height = info.sensor_px
        return 0.5 * (width - 1), 0.5 * (height - 1)

    # Where things are

    def _position(self) -> Floats:
        tip = tip_um(self._tool, self._mover.positions())
        if tip is None:
            raise NotAvailable(
                f"{self._tool.name}: its position is unknown; initialise the platform"
            )
        return np.array(tip)

    def _image(self, since_s: float) -> CameraImage:
        return self._unit.thread.next_image(since_s, IMAGE_S)

    def _zoom(self, image: CameraImage) -> float:
        if not self._unit.config.behind_lens:
            return 0.0
        zoom = image.circumstances.zoom_counts
        if zoom is None:
            raise NotAvailable("the zoom is not known; home the lens, then try again")
        return zoom

    # The first idea

    def _search(self, task: Task, first: CameraImage, position_um: Floats) -> TipMap:
        """Find the tip by drawing it back twice, then what a step aside does."""
        self._zoom(first)
        scale = first.circumstances.scale_um_px
        if scale is None:
            raise NotAvailable(
                f"{self._camera}: the approximate pixel size is unknown; set scale_um_px"
            )
        task.report(0.02, f"looking for {self._tool.shown}")
        step_um = SEARCH_PART * self._tool.width_um * self.ahead
        images = [first]
        for times in (1, 2):
            since_s = self._go(task, position_um - times * step_um)
            images.append(self._image(since_s))
        greys = [grey(each.data) for each in images]
        strips = [
            middle(uncovered(one, other, self._tool.width_um / scale))
            for one, other in pairwise(greys)
        ]
        if strips[0] is None or strips[1] is None:
            raise NotAvailable(self._unseen("nothing moved in the image as the tool did"))
        back_px = strips[1] - strips[0]
        guess = self._similar(
            position_um - 2.0 * step_um, strips[1] + 0.5 * back_px, step_um, back_px
        )
        seen = self._look(images[-1], guess, guess.position_um, REACH_PX)
        if isinstance(seen, NotSeen):
            raise NotAvailable(self._unseen(seen.reason))
        return self._aside(task, guess, seen.point_px, step_um)

    def _aside(self, task: Task, guess: TipMap, tip_px: Floats, step_um: Floats) -> TipMap:
        """Learn what a step aside does: no idea of the camera's handedness is taken for granted."""
        aside_um = np.array([-step_um[1], step_um[0]])
        position = guess.position_um + aside_um
        image = self._image(self._go(task, position))
        moved_px = float(np.linalg.norm(guess.px_um @ step_um))
        at = TipMap(position, tip_px, guess.px_um)
        seen = self._look(image, at, position, moved_px + REACH_PX)
        if isinstance(seen, NotSeen):
            raise NotAvailable(self._unseen(seen.reason))
        both_um = np.column_stack([step_um, aside_um])
        both_px = np.column_stack([guess.px_um @ step_um, seen.point_px - tip_px])
        return TipMap(guess.position_um, tip_px, both_px @ np.linalg.inv(both_um))

    @staticmethod
    def _similar(position: Floats, tip_px: Floats, step_um: Floats, back_px: Floats) -> TipMap:
        """Return a map that turns and stretches, from what a step back did; y is up, rows down."""
        one = complex(*(-back_px)) / complex(step_um[0], -step_um[1])
        turn = np.array([[one.real, -one.imag], [one.imag, one.real]])
        return TipMap(position, tip_px, turn @ np.array([[1.0, 0.0], [0.0, -1.0]]))

    # Positions

    def _grid(self, guess: TipMap, first: CameraImage) -> Sequence[Floats]:
        """Return positions at which the tip and enough of the tool are on the image, to and fro."""
        height, width = first.data.shape[:2]
        scale_px_um = math.sqrt(abs(float(np.linalg.det(guess.px_um))))
        jaw_px = self._tool.width_um * scale_px_um
        gap_px = max(0.0, self._mover.positions().get(self._tool.gap_axis, 0.0)) * scale_px_um
        forward = guess.px_um @ np.array(self._tool.forward)
        forward = forward / np.linalg.norm(forward)
        back, ahead = 5.0 * jaw_px + REACH_PX, 2.0 * jaw_px + REACH_PX
        aside = 0.5 * gap_px + 2.5 * jaw_px + REACH_PX
        low, high = np.empty(2), np.empty(2)
        for axis, size in enumerate((width, height)):
            along, across = abs(forward[axis]), abs(forward[1 - axis])
            behind, before = (back, ahead) if forward[axis] > 0.0 else (ahead, back)
            low[axis] = behind * along + aside * across
            high[axis] = size - 1.0 - before * along - aside * across
        if not (high - low >= 4.0 * REACH_PX).all():
            raise NotAvailable(f"{self._tool.shown} is too large on this image; zoom out")
        half = np.minimum(LARGEST_PART * np.array([width, height]), 0.5 * (high - low))
        centre = np.clip(guess.tip_px, low + half, high - half)
        steps = np.linspace(-1.0, 1.0, GRID)
        rows = [
            [guess.um(centre + half * (x, y)) for x in (steps if i % 2 == 0 else steps[::-1])]
            for i, y in enumerate(steps)
        ]
        return [position for row in rows for position in row]

    def _surest(self, task: Task, position_um: Floats, guess: TipMap) -> Sighting | None:
        """Look for the tip at a position, and where it is seen unsurely beside it as well.

        Returns the surest sighting; None where it was not seen.
        """
        found: list[Sighting] = []
        aside = np.array([-self.ahead[1], self.ahead[0]])
        for far_ahead, far_aside in BESIDE:
            away_um = self._tool.width_um * (far_ahead * self.ahead + far_aside * aside)
            seen = self.sight(task, position_um + away_um, guess)
            if seen is not None:
                found.append(seen)
                if seen.std_px <= UNSURE_PX:
                    break
        return min(found, key=lambda each: each.std_px, default=None)

    def sight(self, task: Task, position_um: Floats, guess: TipMap) -> Sighting | None:
        """Move the tip to a position and look for it; None where it was not seen."""
        image = self._image(self._go(task, position_um))
        stood = tip_um(self._tool, image.circumstances.positions) or tuple(self._position())
        seen = self._look(image, guess, np.array(stood[:2]), REACH_PX)
        if isinstance(seen, NotSeen):
            return None
        sensor, binning = self._on_sensor(seen.point_px, image)
        point_px = float(sensor[0]), float(sensor[1])
        return Sighting((stood[0], stood[1]), point_px, std_px=seen.std_px * binning)

    def _look(
        self, image: CameraImage, guess: TipMap, position_um: Floats, reach_px: float
    ) -> TipSeen | NotSeen:
        """Return where the tip is seen, in the image's pixels."""
        tip = guess.px(position_um)
        forward = guess.px_um @ np.array(self._tool.forward)
        scale_px_um = math.sqrt(abs(float(np.linalg.det(guess.px_um))))
        gap_um = max(0.0, image.circumstances.positions.get(self._tool.gap_axis, 0.0))
        wanted = ExpectedTool(
            (float(tip[0]), float(tip[1])),
            (float(forward[0]), float(forward[1])),
            self._tool.width_um * scale_px_um,
            gap_um * scale_px_um if self._tool.gap_axis else 0.0,
            reach_px,
        )
        find = find_gripper if self._tool.gap_axis else find_probe
        found = find(grey(image.data), wanted)
        if isinstance(found, NotSeen):
            return found
        at = found.hold_px if isinstance(found, GripperTips) else found.tip_px
        return TipSeen(np.array(at), found.std_px)

    def _on_sensor(self, point_px: Floats, image: CameraImage) -> tuple[Floats, int]:
        """Return a position in unbinned pixels of the whole sensor, and the binning."""
        settings = self._unit.thread.settings
        if settings is None:
            raise NotAvailable(f"{image.camera}: the camera was lost")
        return whole_sensor_px(point_px, settings), settings.binning

    def _go(self, task: Task, position_um: Floats) -> float:
        x_um, y_um = position_um.tolist()
        return self._mover.go(axis_targets(self._tool, x_um, y_um), task, self._source)

    def _unseen(self, reason: str) -> str:
        return (
            f"{self._tool.shown} was not found: {reason}; bring its tip into the image, focus on "
            "it, and light it evenly"
        )


def whole_sensor_px(point_px: Floats, settings: CameraSettings) -> Floats:
    """Return a position of an image in unbinned pixels of the whole sensor."""
    corner = np.array([settings.roi.x_px, settings.roi.y_px], dtype=np.float64)
    return np.asarray((point_px + corner) * settings.binning + 0.5 * (settings.binning - 1))


def _said(fit: MapFit) -> str:
    left_out = f", {len(fit.outliers)} left out" if fit.outliers else ""
    return (
        f"{fit.map.scale_um_px:.4g} µm a pixel, residual {fit.rms_px:.2f} px at "
        f"{fit.map.points} positions{left_out}"
    )
