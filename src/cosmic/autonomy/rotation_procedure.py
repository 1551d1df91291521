"""Measuring about which point the table turns: a fibre on it is followed from angle to angle."""

from collections.abc import Callable
from datetime import UTC, datetime
from typing import Final

import numpy as np

from cosmic.autonomy.calibrations import Calibrations
from cosmic.autonomy.moving import Mover
from cosmic.frame.arrays import Floats
from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.frame.operation import Task
from cosmic.mico.api.mico import Mico
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.core.calibration import RotationCentre
from cosmic.vico.core.calibration_fit import CalibrationRefused, RotationFit, fit_rotation
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.pixel_map import PixelMap
from cosmic.vico.core.vision.algorithms import grey
from cosmic.vico.core.vision.fibre import Fibre
from cosmic.vico.core.vision.fibre_tracking import FibreTracker

IMAGE_S: Final = 5.0
ANGLES_DEG: Final = (-24.0, -16.0, -8.0, 0.0, 8.0, 16.0, 24.0)
"""From where the table stands."""
REACH_PART: Final = 0.12
"""Of the image's width: how far a fibre may go from one angle to the next."""
MARGIN_PX: Final = 10.0


class RotationProcedure:
    """One measurement of the rotation centre; run in ViCo's thread."""

    def __init__(
        self,
        vico: VicoApplication,
        mico: Mico,
        calibrations: Calibrations,
        plate_map: Callable[[CameraImage], PixelMap],
        camera: str,
        axis: str,
    ) -> None:
        self._unit = vico.unit(camera)
        self._clock = vico.clock
        self._calibrations = calibrations
        self._plate_map = plate_map
        self._camera = camera
        self._axis = axis
        self._mover = Mover(mico, {axis: "deg"}, vico.clock)
        self._source = f"rotation centre of {axis}"

    def run(self, task: Task) -> None:
        """Measure, keep, and turn back."""
        try:
            if self._axis not in self._mover.positions():
                raise NotAvailable(f"{self._axis}: its angle is unknown: initialise the platform")
            begun = self._mover.remember()[self._axis]
            try:
                fit = self._measure(task, begun)
            finally:
                self._mover.go_back(task, self._source)
            now = datetime.now(UTC).replace(microsecond=0)
            self._calibrations.set_rotation(self._camera, RotationCentre(self._axis, fit, now))
            x_um, y_um = fit.centre_um
            text = f"x {x_um:.1f}, y {y_um:.1f} µm, known to {fit.std_um:.1f} µm"
            task.report(1.0, text)
            task.finish()
        except CosmicError as exc:
            task.fail(exc)

    def _measure(self, task: Task, begun_deg: float) -> RotationFit:
        # Said before anything turns: without a map nothing could be told.
        self._plate_map(self._image(self._clock.now_s()))
        tracker: FibreTracker | None = None
        angles: list[float] = []
        lines: list[Floats] = []
        for number, away_deg in enumerate(ANGLES_DEG):
            task.report(number / len(ANGLES_DEG), f"angle {number + 1} of {len(ANGLES_DEG)}")
            since_s = self._mover.go({self._axis: begun_deg + away_deg}, task, self._source)
            image = self._image(since_s)
            found = _fibres(image)
            if tracker is None:
                tracker = FibreTracker(reach_px=REACH_PART * image.data.shape[1])
                fibre = _nearest(found, image)
                tracker.start(fibre)
            else:
                track = tracker.follow(found)
                # One with a doubt will do: what does not turn along shows in the residual.
                if track.fibre is None:
                    raise CalibrationRefused(
                        f"rotation centre: the fibre was lost at {away_deg:+g} degrees: "
                        f"{track.reason}; choose a point with one clear fibre near the middle"
                    )
                fibre = track.fibre
            angles.append(self._angle(image))
            points = self._plate_map(image).to_um(_points(fibre))
            lines.append(_in_order(points, lines[-1] if lines else points))
        return _best(angles, lines)

    def _image(self, since_s: float) -> CameraImage:
        return self._unit.thread.next_image(since_s, IMAGE_S)

    def _angle(self, image: CameraImage) -> float:
        seen = image.circumstances.positions.get(self._axis)
        return self._mover.positions()[self._axis] if seen is None else seen


def _fibres(image: CameraImage) -> list[Fibre]:
    # Imported here: it loads OpenCV and scipy.
    from cosmic.vico.core.vision.finding import find_fibres

    return find_fibres(grey(image.data))


def _nearest(fibres: list[Fibre], image: CameraImage) -> Fibre:
    """Return the fibre nearest to the middle that is seen whole; clear ones first."""
    height, width = image.data.shape[:2]
    far = np.array([width - 1.0, height - 1.0]) - MARGIN_PX
    whole = [
        each for each in fibres if (each.ends_px > MARGIN_PX).all() and (each.ends_px < far).all()
    ]
    if not whole:
        raise NotAvailable(
            "rotation centre: there is no whole fibre on the image; bring one near its middle, "
            "and focus"
        )
    middle = 0.5 * np.array([width - 1.0, height - 1.0])
    return min(
        [each for each in whole if each.certain] or whole,
        key=lambda each: float(np.linalg.norm(each.centre_line_px.mean(axis=0) - middle)),
    )


def _points(fibre: Fibre) -> Floats:
    """Return both ends and the middle of the line."""
    line = fibre.centre_line_px
    return np.vstack([fibre.ends_px, line[len(line) // 2]])


def _in_order(points: Floats, before: Floats) -> Floats:
    """Return the points with the ends in the order they had at the angle before."""
    turned = points[[1, 0, 2]]
    nearer = np.linalg.norm(points - before) <= np.linalg.norm(turned - before)
    return points if nearer else turned


def _best(angles: list[float], lines: list[Floats]) -> RotationFit:
    """Return the surest circle of those that both ends and the middle go round."""
    fits: list[RotationFit] = []
    refusals: list[CalibrationRefused] = []
    for index in range(3):
        points = [(float(each[index][0]), float(each[index][1])) for each in lines]
        try:
            fits.append(fit_rotation(angles, points))
        except CalibrationRefused as exc:
            refusals.append(exc)
    if not fits:
        raise refusals[0]
    return min(fits, key=lambda each: each.std_um)
