"""About which point the plate turns, by a fibre that is followed from angle to angle."""

from collections.abc import Generator, Sequence
from typing import Final

import numpy as np
from typing_extensions import override

from cosmic.autonomy.calibrating.calibrated import Calibrated
from cosmic.autonomy.calibrating.registry import CalibrationEntry
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.plate import Candidate, PlateFrame
from cosmic.autonomy.handling.prepare import TABLE, clear_image
from cosmic.autonomy.handling.sight import SeenFibre, box_around, find_seen
from cosmic.autonomy.procedures.operation import OperationFailed, Steps, Yielded
from cosmic.frame.arrays import Floats
from cosmic.frame.errors import NotAvailable
from cosmic.vico.core.calibration_fit import CalibrationRefused, RotationFit, fit_rotation
from cosmic.vico.core.image import CameraImage

STEP_DEG: Final = 20.0
ANGLES: Final = 6
MARGIN_UM: Final = 200.0
SAME_LENGTH: Final = 0.03
MOST_FIBRES: Final = 3
"""How many fibres are followed, one after the other, until one has led to a centre."""


class FindRotationCentre(Calibrated):
    """One fibre is followed while the table turns: only where it should be is looked at."""

    name = "find the rotation centre"
    key = TABLE

    @override
    def measure(self, work: HandlingContext) -> Steps:
        settings = work.settings.calibration
        if not settings.rotation_centre:
            x, y = work.calibration.frame.centre_um
            values = {"centre_x_um": x, "centre_y_um": y}
            self.kept(
                work, 0.0, "um", settings.rotation_std_um, values=values, how="taken as it is"
            )
            return
        if not work.shared.candidates:
            raise OperationFailed("no fibre", "no fibre on the plate is clear enough to follow")
        yield from clear_image(work)
        begun = work.table_deg
        why = ""
        for candidate in to_follow(work.shared.candidates):
            try:
                fit = yield from _followed(work, candidate, begun)
            except (NotAvailable, CalibrationRefused) as exc:
                why = str(exc)
                continue
            _put_in_force(work, PlateFrame(fit.centre_um))
            x, y = fit.centre_um
            values = {"centre_x_um": x, "centre_y_um": y, "residual_um": fit.rms_um}
            how = f"a fibre followed to {fit.angles} angles"
            self.kept(work, fit.std_um, "um", settings.rotation_std_um, values=values, how=how)
            return
        raise NotAvailable(why)

    @override
    def restore(self, work: HandlingContext, entry: CalibrationEntry) -> None:
        centre_um = entry.values["centre_x_um"], entry.values["centre_y_um"]
        _put_in_force(work, PlateFrame(centre_um))


def to_follow(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the fibres that are followed, one after the other: certain ones, near the centre."""
    return sorted(candidates, key=lambda each: (each.doubted, float(np.hypot(*each.position_um))))[
        :MOST_FIBRES
    ]


def _followed(
    work: HandlingContext, candidate: Candidate, begun_deg: float
) -> Generator[Yielded, object, RotationFit]:
    angles: list[float] = []
    lines: list[Floats] = []
    for wanted_deg in angles_about(begun_deg, work.settings.grasp.largest_turn_deg):
        yield work.go({work.table: wanted_deg})
        image = yield work.image()
        assert isinstance(image, CameraImage)
        angle = work.table_deg
        wanted = work.calibration.frame.on_platform(candidate.line_um, angle)
        seen = _nearest(work, image, wanted, candidate.length_um)
        if seen is None:
            raise NotAvailable(f"the fibre was lost at {angle:.0f} degrees")
        angles.append(angle)
        lines.append(_in_order(seen.line_um, wanted))
    return best_circle(angles, lines)


def angles_about(begun_deg: float, largest_deg: float) -> list[float]:
    """Return the angles to look at: about where the table stands, and within its travel."""
    first = begun_deg - STEP_DEG * (ANGLES // 2 - 1)
    last = largest_deg - STEP_DEG * (ANGLES - 1)
    first = max(min(first, last), -largest_deg)
    return [first + STEP_DEG * number for number in range(ANGLES)]


def _nearest(
    work: HandlingContext, image: CameraImage, wanted: Floats, length_um: float
) -> SeenFibre | None:
    mapped = work.mapped(image)
    box = box_around(mapped.to_px(wanted), MARGIN_UM / mapped.scale_um_px, image)
    fitting = [
        each
        for each in find_seen(image, mapped, box)
        if abs(each.length_um - length_um) <= SAME_LENGTH * length_um
    ]
    middle = wanted.mean(axis=0)
    return min(
        fitting,
        key=lambda each: float(np.linalg.norm(each.line_um.mean(axis=0) - middle)),
        default=None,
    )


def _in_order(line: Floats, wanted: Floats) -> Floats:
    """Return both ends and the middle of a line, the end first that should be first."""
    points = line[[0, -1, len(line) // 2]]
    turned = points[[1, 0, 2]]
    ends = wanted[[0, -1]]
    nearer = np.linalg.norm(points[:2] - ends) <= np.linalg.norm(turned[:2] - ends)
    return points if nearer else turned


def best_circle(angles_deg: list[float], lines: list[Floats]) -> RotationFit:
    """Return the surest circle of those that both ends and the middle go round.

    Raises
    ------
    CalibrationRefused
        None of them is good enough.
    """
    fits: list[RotationFit] = []
    refusal = CalibrationRefused("rotation centre: no fibre was followed")
    for index in range(3):
        points = [(float(each[index][0]), float(each[index][1])) for each in lines]
        try:
            fits.append(fit_rotation(angles_deg, points))
        except CalibrationRefused as exc:
            refusal = exc
    if not fits:
        raise refusal
    return min(fits, key=lambda each: each.std_um)


def _put_in_force(work: HandlingContext, frame: PlateFrame) -> None:
    """Take a new centre; what was seen on the plate before lies a little elsewhere in its frame."""
    # Seen at the angle of the survey, points were right on the platform, whatever the centre.
    old, angle = work.calibration.frame, work.shared.survey_deg

    def again(line: Floats) -> Floats:
        return frame.on_plate(old.on_platform(line, angle), angle)

    work.calibration.frame = frame
    work.shared.lines_um = [again(each) for each in work.shared.lines_um]
    work.shared.candidates = [each.moved(again(each.line_um)) for each in work.shared.candidates]
    if (standard := work.shared.standard) is not None:
        work.shared.standard = standard.moved(again(standard.line_um))
    work.shared.skipped = [each.moved(again(each.line_um)) for each in work.shared.skipped]
