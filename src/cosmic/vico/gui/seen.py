"""What the widgets show of machine vision.

Places in a picture are x, y in pixels of the frame they were read in (its ROI and binning), with
(0, 0) in the middle of the upper left pixel.
"""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from cosmic.vico.core.picture import Picture

Pixel = tuple[float, float]
Points = npt.NDArray[np.float64]


class FibreSeen(Protocol):
    """A fibre as machine vision found it; shape of the public `Fibre`."""

    @property
    @abstractmethod
    def centre_line_px(self) -> Points:
        """Shape (n, 2), x and y."""

    @property
    @abstractmethod
    def ends_px(self) -> Points:
        """Shape (2, 2), x and y."""

    @property
    @abstractmethod
    def length_px(self) -> float:
        """Along the centre line."""

    @property
    @abstractmethod
    def width_px(self) -> float:
        """Mean width."""

    @property
    @abstractmethod
    def curl(self) -> float:
        """Contour length by projected length, minus one."""

    @property
    @abstractmethod
    def certain(self) -> bool:
        """False where it may be something else; `doubts` then says why."""

    @property
    @abstractmethod
    def doubts(self) -> Sequence[str]:
        """Why it is not certain."""


class TipSeen(Protocol):
    """The tip of a gripper or of the probe in the picture."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Whose it is, such as "left"."""

    @property
    @abstractmethod
    def place_px(self) -> Pixel:
        """Where it is."""

    @property
    @abstractmethod
    def certain(self) -> bool:
        """False where it was not found for sure."""


class Analysis(Protocol):
    """What the chain of algorithms found in one picture."""

    @property
    @abstractmethod
    def picture(self) -> Picture:
        """The picture it was found in, with the scale in force then."""

    @property
    @abstractmethod
    def fibres(self) -> Sequence[FibreSeen]:
        """The fibres found."""

    @property
    @abstractmethod
    def tips(self) -> Sequence[TipSeen]:
        """The tips found."""


class Algorithm(Protocol):
    """One link of the chain."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What `CameraPort.switch` takes, and what the operator reads."""

    @property
    @abstractmethod
    def description(self) -> str:
        """What it does, in one line."""

    @property
    @abstractmethod
    def on(self) -> bool:
        """It is run on the pictures."""

    @property
    @abstractmethod
    def problem(self) -> str:
        """Why it found nothing to say or failed; empty when all is well."""

    @property
    @abstractmethod
    def failing(self) -> bool:
        """It fails, and is tried again."""
