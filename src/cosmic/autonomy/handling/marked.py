"""`MarkedFibre`: a fibre that somebody has pointed at in the image, and how it is chosen."""

import math
from dataclasses import dataclass

import numpy as np
from typing_extensions import override

from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.plate import Candidate, Reach
from cosmic.autonomy.handling.survey import Choose, approaches_of
from cosmic.autonomy.procedures.operation import OperationFailed, Steps
from cosmic.frame.arrays import Floats
from cosmic.frame.errors import NotAvailable
from cosmic.vico.core.image import CameraImage

NOT_MARKED = "not the fibre marked"
NEAR_UM = 150.0
"""How far the middle of a fibre that is seen may be from that of the one marked."""


@dataclass(frozen=True, slots=True, eq=False)
class MarkedFibre:
    """A fibre as it was found on an image.

    Attributes
    ----------
    image : CameraImage
        The image it was found on; its circumstances tell where the table stood.
    line_px : ndarray, shape (n, 2), float64
        Its centre line on that image, x and y.
    """

    image: CameraImage
    line_px: Floats

    def on_platform(self, work: HandlingContext) -> Floats:
        """Return its line on the platform, as it lay when the image was taken.

        Raises
        ------
        NotAvailable
            The image cannot be told as positions; the text says what to do.
        """
        return np.asarray(work.mapped(self.image).to_um(self.line_px), dtype=np.float64)

    def on_plate(self, work: HandlingContext) -> Floats:
        """Return its line on the plate; raises `NotAvailable`."""
        angle = self.image.circumstances.positions.get(work.table)
        if angle is None:
            raise NotAvailable(
                f"the angle of {work.table} was not known when the image was taken; find the "
                "fibres again"
            )
        return work.calibration.frame.on_plate(self.on_platform(work), angle)


def approach_to(work: HandlingContext, marked: MarkedFibre) -> Reach | None:
    """Return how the gripper would get at a marked fibre, before anything is looked at again.

    None where it is out of reach. Raises `NotAvailable` where the image is not calibrated.
    """
    line_um = marked.on_plate(work)
    length_um = float(np.linalg.norm(np.diff(line_um, axis=0), axis=1).sum())
    candidate = Candidate(line_um, length_um, math.nan, 0.0, 0.0)
    return next(iter(approaches_of(work, candidate, work.table_deg)), None)


class ChooseMarked(Choose):
    """The fibre that was marked, known by where it lies on the plate; no other is taken."""

    def __init__(self, marked: MarkedFibre) -> None:
        self._marked = marked

    @override
    def steps(self, work: HandlingContext) -> Steps:
        wanted = self._marked.on_plate(work)
        everything = work.shared.candidates
        near = [each for each in everything if _apart_um(each.line_um, wanted) <= NEAR_UM]
        if not near:
            raise OperationFailed(NOT_MARKED, self._problem(work, wanted))
        chosen = min(near, key=lambda each: _apart_um(each.line_um, wanted))
        work.shared.candidates = [chosen]
        try:
            yield from super().steps(work)
        finally:
            work.shared.candidates = [each for each in everything if each is not chosen]

    @staticmethod
    def _problem(work: HandlingContext, wanted: Floats) -> str:
        for each in work.shared.unsuitable:
            if _apart_um(each.line_um, wanted) <= NEAR_UM:
                return f"the fibre marked cannot be taken: it is {each.problem}"
        return "no fibre lies where it was marked; find the fibres again"

    @override
    def none(self, work: HandlingContext) -> OperationFailed:
        return OperationFailed(
            NOT_MARKED,
            f"{work.settings.gripper} cannot reach the fibre marked at any angle of the table",
        )


def _apart_um(line: Floats, other: Floats) -> float:
    return float(np.linalg.norm(line.mean(axis=0) - other.mean(axis=0)))
