"""The algorithms that come with ViCo, as links of the chain."""

from collections.abc import Iterable
from typing import cast

import cv2

from cosmic.frame.errors import ConfigError
from cosmic.vico.core.focus import FocusMeasure, sharpness
from cosmic.vico.core.picture import Picture
from cosmic.vico.core.vision.chain import ALGORITHMS, Chain, Results, Unavailable, algorithm
from cosmic.vico.hw.interface import Pixels, Roi


def make_chain(*, off: Iterable[str] = ()) -> Chain:
    """Return a chain of the built-in algorithms and of those registered since.

    Raises
    ------
    ConfigError
        Two have one name, or `off` names one that is not there.
    """
    return ALGORITHMS.chain(off=off)


def grey(data: Pixels) -> Pixels:
    """Return a picture without its colours."""
    return data if data.ndim == 2 else cast("Pixels", cv2.cvtColor(data, cv2.COLOR_RGB2GRAY))


@algorithm
class Sharpness:
    """How sharp the picture is; the result is a float.

    Attributes
    ----------
    region : Roi or None
        Where; None: the whole picture. Any thread may set it.
    """

    name = "focus"

    def __init__(self) -> None:
        self.region: Roi | None = None
        self.measure = FocusMeasure.VARIANCE

    def run(self, picture: Picture, results: Results) -> object:  # noqa: ARG002
        """Measure it."""
        try:
            return sharpness(picture.data, self.region, self.measure)
        except ConfigError as exc:
            return Unavailable(str(exc))


@algorithm
class FindFibres:
    """Every fibre on the picture; the result is a tuple of `Fibre`."""

    name = "fibres"

    def run(self, picture: Picture, results: Results) -> object:  # noqa: ARG002
        """Find them."""
        # Not at the top: it loads scikit-image and scipy, which a window without it need not.
        from cosmic.vico.core.vision.finding import find_fibres

        return tuple(find_fibres(grey(picture.data)))
