"""Places on the platform, as one camera sees them: a part of `CameraHandle`."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Final

from cosmic.frame.arguments import checked_class
from cosmic.frame.declaration import command
from cosmic.frame.errors import NotAvailable
from cosmic.frame.operation import Task
from cosmic.vico.api.places import CalibrationShown, Pixel, Places
from cosmic.vico.api.sent_image import same_place
from cosmic.vico.core.image import CameraImage

WITHIN_UM: Final = 2.0
"""How far two maps may differ for a click still to mean the same place."""


@checked_class
class CameraPlaces(ABC):
    """What pixels of a camera mean on the platform; any thread."""

    name: str

    @property
    @abstractmethod
    def _places(self) -> Places | None:
        """What joins pixels and platform."""

    @property
    @abstractmethod
    def _newest(self) -> CameraImage | None:
        """The newest image as it came."""

    @property
    def calibration_problem(self) -> str:
        """Why pixels cannot be told as places on the platform; empty when they can."""
        places, newest = self._places, self._newest
        if places is None:
            return "micromanipulation is not hosted here"
        return places.problem(newest) if newest is not None else "no image yet"

    def platform_um(self, place_px: Pixel) -> tuple[float, float] | None:
        """Return where on the platform a pixel of the newest image is; None where unknown."""
        places, newest = self._places, self._newest
        if places is None or newest is None or places.problem(newest):
            return None
        return places.platform_um(newest, place_px)

    @property
    def targets(self) -> Sequence[str]:
        """What can be moved to a place in the image, such as "left"."""
        places = self._places
        return places.targets if places is not None else ()

    @property
    def calibrated(self) -> Sequence[CalibrationShown]:
        """The maps from platform to image that are in force for this camera."""
        places = self._places
        known = places.calibrated if places is not None else ()
        return tuple(each for each in known if each.camera == self.name)

    @command(moves=True)
    def calibrate_stage(self, tool: str) -> Task:
        """Begin to measure such a map by moving a tool; see `Vico.calibrate_stage`."""
        return self._moving.calibrate_stage(tool, self.name)

    @command(moves=True)
    def find_rotation_centre(self) -> Task:
        """Begin to measure about which place the plate turns; see `Vico.find_rotation_centre`."""
        return self._moving.find_rotation_centre(self.name)

    @property
    def _moving(self) -> Places:
        places = self._places
        if places is None:
            raise NotAvailable("micromanipulation is not hosted here: no tool can be moved")
        return places

    def click_to_move(self, place_px: Pixel, what: str) -> str:
        """Begin to move `what` to a pixel of the newest image, and say what was begun.

        Raises
        ------
        MoveRefused, NotAvailable
            The gate says no, or the place cannot be told.
        """
        places, newest = self._places, self._newest
        if places is None or newest is None:
            raise NotAvailable(self.calibration_problem)
        return places.move_to(newest, place_px, what)

    @command(moves=True)
    def click(self, place_px: Pixel, place_um: Pixel, what: str) -> str:
        """Move `what` to a pixel of the newest image, which must lie at `place_um`.

        Raises
        ------
        MoveRefused, NotAvailable
            The gate says no, or the image has changed since.
        """
        there_um = self.platform_um(place_px)
        if there_um is None:
            raise NotAvailable(self.calibration_problem)
        if not same_place(there_um, place_um, WITHIN_UM):
            raise NotAvailable("the image has changed since the click; click again")
        return self.click_to_move(place_px, what)

    @command(moves=True, aside=True)
    def click_aside(self, place_px: Pixel, place_um: Pixel, what: str) -> None:
        """As `click`, for a window, which does not wait."""
        self.click(place_px, place_um, what)
