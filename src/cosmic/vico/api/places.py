"""What joins pixels and platform; whoever hosts micromanipulation as well provides it."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Protocol

from cosmic.vico.core.picture import Picture

Pixel = tuple[float, float]


class Places(Protocol):
    """Calibrations in use, and what can be moved to a place in a picture; any thread.

    Pixels are those of the picture they were read in, its ROI and binning.
    """

    @abstractmethod
    def scale_um_px(self, camera: str, zoom_counts: float | None) -> float | None:
        """Return the calibrated size of an unbinned pixel; None where it was not calibrated."""

    @abstractmethod
    def problem(self, picture: Picture) -> str:
        """Return why pixels of `picture` cannot be told as places; empty when they can."""

    @abstractmethod
    def platform_um(self, picture: Picture, place_px: Pixel) -> tuple[float, float]:
        """Return x and y on the platform of what lies on the sample plate at a pixel.

        Raises
        ------
        NotAvailable
            Not calibrated there; the text says what to do.
        """

    @property
    @abstractmethod
    def targets(self) -> Sequence[str]:
        """What can be moved, such as "left"."""

    @abstractmethod
    def move_to(self, picture: Picture, place_px: Pixel, what: str) -> str:
        """Begin to move the tip of `what` over a pixel and say what was begun; returns at once.

        Raises
        ------
        MoveRefused
            The gate says no.
        NotAvailable
            Not calibrated for that tool.
        """
