"""What joins pixels and platform; whoever hosts micromanipulation as well provides it."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Protocol

from cosmic.frame.operation import Task
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.vision.tool_types import ExpectedTool

Pixel = tuple[float, float]


@dataclass(frozen=True, slots=True)
class CalibrationShown:
    """One map from platform to image that is in force.

    Attributes
    ----------
    zoom_counts, height_um : float
        Where it was measured; the height is that of the tool's tip on the platform.
    residual_px : float
        RMS distance between where the tip was seen and where the map says.
    measured : datetime
        With its time zone.
    """

    camera: str
    tool: str
    zoom_counts: float
    height_um: float
    scale_um_px: float
    residual_px: float
    measured: datetime


@dataclass(frozen=True, slots=True)
class RotationShown:
    """About which point on the platform an axis turns the plate.

    Attributes
    ----------
    std_um : float
        Standard deviation of the centre, in the direction that is known least.
    residual_um : float
        RMS distance from the circle.
    """

    axis: str
    centre_um: tuple[float, float]
    std_um: float
    residual_um: float
    measured: datetime


class CoordinateTransform(Protocol):
    """Calibrations in use, how they are measured, and what can be moved to a point in an image.

    Any thread. Pixels are those of the image they were read in, its ROI and binning.
    """

    @abstractmethod
    def scale_um_px(self, camera: str, zoom_counts: float | None) -> float | None:
        """Return the calibrated size of an unbinned pixel; None where it was not calibrated."""

    @abstractmethod
    def problem(self, image: CameraImage) -> str:
        """Return why pixels of `image` cannot be told as points; empty when they can."""

    @abstractmethod
    def platform_um(self, image: CameraImage, point_px: Pixel) -> tuple[float, float]:
        """Return x and y on the platform of what lies on the sample plate at a pixel.

        Raises
        ------
        NotAvailable
            Not calibrated there; the text says what to do.
        """

    def expected_bodies(self, image: CameraImage) -> Mapping[str, ExpectedTool]:  # noqa: ARG002
        """Return where tools should be on an image, to some pixels; those not known are missing."""
        return {}

    @property
    @abstractmethod
    def targets(self) -> Sequence[str]:
        """What can be moved, such as "left"."""

    @abstractmethod
    def move_to(self, image: CameraImage, point_px: Pixel, what: str) -> str:
        """Begin to move the tip of `what` over a pixel and say what was begun; returns at once.

        Raises
        ------
        MoveRefused
            The gate says no.
        NotAvailable
            Not calibrated for that tool.
        """

    @abstractmethod
    def calibrate_stage(self, tool: str, camera: str) -> Task:
        """Begin to measure the map from platform to image by moving a tool.

        Raises
        ------
        ConfigError
            There is no such tool or camera.
        NotAvailable
            Another long operation is under way.
        """

    @abstractmethod
    def find_rotation_centre(self, camera: str) -> Task:
        """Begin to measure about which point the plate turns; raises as `calibrate_stage`."""

    @property
    @abstractmethod
    def calibrated(self) -> Sequence[CalibrationShown]:
        """The maps in force, by camera, tool, zoom and height."""

    @abstractmethod
    def rotation_centre(self, camera: str) -> RotationShown | None:
        """Return the rotation centre as a camera saw it last; None before."""
