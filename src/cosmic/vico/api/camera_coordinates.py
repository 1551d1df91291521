"""Points on the platform, as one camera sees them: a part of `CameraHandle`."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Final

from cosmic.frame.arguments import checked_class
from cosmic.frame.declaration import command
from cosmic.frame.errors import NotAvailable
from cosmic.frame.operation import Task
from cosmic.vico.api.coordinate_transform import CalibrationShown, CoordinateTransform, Pixel
from cosmic.vico.api.sent_image import same_point
from cosmic.vico.core.image import CameraImage

WITHIN_UM: Final = 2.0
"""How far two maps may differ for a click still to mean the same point."""


@checked_class
class CameraCoordinates(ABC):
    """What pixels of a camera mean on the platform; any thread."""

    name: str

    @property
    @abstractmethod
    def _transform(self) -> CoordinateTransform | None:
        """What joins pixels and platform."""

    @property
    @abstractmethod
    def _newest(self) -> CameraImage | None:
        """The newest image as it came."""

    @property
    def calibration_problem(self) -> str:
        """Why pixels cannot be told as points on the platform; empty when they can."""
        transform, newest = self._transform, self._newest
        if transform is None:
            return "micromanipulation is not hosted here"
        return transform.problem(newest) if newest is not None else "no image yet"

    def platform_um(self, point_px: Pixel) -> tuple[float, float] | None:
        """Return where on the platform a pixel of the newest image is; None where unknown."""
        transform, newest = self._transform, self._newest
        if transform is None or newest is None or transform.problem(newest):
            return None
        return transform.platform_um(newest, point_px)

    @property
    def targets(self) -> Sequence[str]:
        """What can be moved to a point in the image, such as "left"."""
        transform = self._transform
        return transform.targets if transform is not None else ()

    @property
    def calibrated(self) -> Sequence[CalibrationShown]:
        """The maps from platform to image that are in force for this camera."""
        transform = self._transform
        known = transform.calibrated if transform is not None else ()
        return tuple(each for each in known if each.camera == self.name)

    @command(moves=True)
    def calibrate_stage(self, tool: str) -> Task:
        """Begin to measure such a map by moving a tool; see `Vico.calibrate_stage`."""
        return self._moving.calibrate_stage(tool, self.name)

    @command(moves=True)
    def find_rotation_centre(self) -> Task:
        """Begin to measure about which point the plate turns; see `Vico.find_rotation_centre`."""
        return self._moving.find_rotation_centre(self.name)

    @property
    def _moving(self) -> CoordinateTransform:
        transform = self._transform
        if transform is None:
            raise NotAvailable("micromanipulation is not hosted here: no tool can be moved")
        return transform

    def click_to_move(self, point_px: Pixel, what: str) -> str:
        """Begin to move `what` to a pixel of the newest image, and say what was begun.

        Raises
        ------
        MoveRefused, NotAvailable
            The gate says no, or the point cannot be told.
        """
        transform, newest = self._transform, self._newest
        if transform is None or newest is None:
            raise NotAvailable(self.calibration_problem)
        return transform.move_to(newest, point_px, what)

    @command(moves=True)
    def click(self, point_px: Pixel, point_um: Pixel, what: str) -> str:
        """Move `what` to a pixel of the newest image, which must lie at `point_um`.

        Raises
        ------
        MoveRefused, NotAvailable
            The gate says no, or the image has changed since.
        """
        there_um = self.platform_um(point_px)
        if there_um is None:
            raise NotAvailable(self.calibration_problem)
        if not same_point(there_um, point_um, WITHIN_UM):
            raise NotAvailable("the image has changed since the click; click again")
        return self.click_to_move(point_px, what)

    @command(moves=True, aside=True)
    def click_aside(self, point_px: Pixel, point_um: Pixel, what: str) -> None:
        """As `click`, for a window, which does not wait."""
        self.click(point_px, point_um, what)
