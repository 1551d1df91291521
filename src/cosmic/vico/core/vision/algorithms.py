"""The algorithms that come with ViCo, as links of the chain."""

import logging
from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Final, cast

import cv2

from cosmic.frame.errors import ConfigError, PluginError
from cosmic.frame.plugins import Kind, NoOptions, make
from cosmic.vico.core.focus import FocusMeasure, sharpness
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.vision.chain import (
    ALGORITHMS,
    Algorithm,
    AnalysisBackend,
    Chain,
    Results,
    Unavailable,
    algorithm,
)
from cosmic.vico.core.vision.fibre import Fibre
from cosmic.vico.core.vision.fibre_tracking import FibreTracker
from cosmic.vico.core.vision.tool_tips import Expect, find_tool, tip_seen
from cosmic.vico.core.vision.tool_types import ExpectedTool
from cosmic.vico.core.vision.tracking import TemplateTracker
from cosmic.vico.hw.interface import Pixels, Roi

if TYPE_CHECKING:
    from cosmic.vico.core.vision.held_tracking import HeldFibreTracker

logger = logging.getLogger(__name__)

NO_TOOL: Final = "no tool is expected on the image: calibrate with it, and bring it there"

NO_GRIPPER: Final = "no gripper is expected on the image: calibrate with it, and bring it there"


BUILT_IN: Final = ("focus", "fibres", "fibre track", "place track", "tools", "tips")
"""The algorithms that every chain begins with, in the order in which they run."""

_NO_OPTIONS: Final[Mapping[str, Mapping[str, object]]] = {}


class Missing:
    """In place of an algorithm that cannot be loaded; its result is why.

    Attributes
    ----------
    name : str
        What the camera names.
    """

    def __init__(self, name: str, reason: str) -> None:
        self.name = name
        self._reason = reason

    def run(self, image: CameraImage, results: Results) -> object:  # noqa: ARG002
        """Say why there is nothing."""
        return Unavailable(self._reason)


def make_chain(
    named: Iterable[str] = (),
    options: Mapping[str, Mapping[str, object]] = _NO_OPTIONS,
    *,
    off: Iterable[str] = (),
) -> Chain:
    """Return a chain of the built-in algorithms, of those named and of those registered since.

    Parameters
    ----------
    named : iterable of str
        Algorithms that are in it besides the built-in ones, which other packages bring.
    options : mapping of str to mapping
        Settings of algorithms, by name.

    Raises
    ------
    ConfigError
        Two have one name, `off` names one that is not there, nothing has a name among `named`, or
        the options of one are wrong.
    """
    registered = ALGORITHMS.names
    brought = [each for each in named if each not in BUILT_IN and each not in registered]
    made = [_made(each, options.get(each, {})) for each in (*BUILT_IN, *brought)]
    return ALGORITHMS.chain(made, off=off)


def _made(name: str, options: Mapping[str, object]) -> Algorithm:
    try:
        found: Algorithm = make(Kind.ANALYSIS, name, None, options)
    except PluginError as exc:
        logger.error("%s", exc)
        return Missing(name, str(exc))
    return found


def grey(data: Pixels) -> Pixels:
    """Return an image without its colours."""
    return data if data.ndim == 2 else cast("Pixels", cv2.cvtColor(data, cv2.COLOR_RGB2GRAY))


class Sharpness:
    """How sharp the image is; the result is a float.

    Attributes
    ----------
    region : Roi or None
        Where; None: the whole image. Any thread may set it.
    """

    name = "focus"

    def __init__(self) -> None:
        self.region: Roi | None = None
        self.measure = FocusMeasure.VARIANCE

    def run(self, image: CameraImage, results: Results) -> object:  # noqa: ARG002
        """Measure it."""
        try:
            return sharpness(image.data, self.region, self.measure)
        except ConfigError as exc:
            return Unavailable(str(exc))


class FindFibres:
    """Every fibre on the image; the result is a tuple of `Fibre`.

    Attributes
    ----------
    expect : callable or None
        Tells from an image where the tools should be on it: what lies there is no fibre.
    """

    name = "fibres"

    def __init__(self) -> None:
        self.expect: Expect | None = None

    def run(self, image: CameraImage, results: Results) -> object:  # noqa: ARG002
        """Find them."""
        # Not at the top: it loads OpenCV and scipy, which a window without it need not.
        from cosmic.vico.core.vision.finding import find_fibres
        from cosmic.vico.core.vision.tool_bodies import without_tools

        found = find_fibres(grey(image.data))
        tools = self.expect(image) if self.expect is not None else {}
        return without_tools(found, tools.values())


class TrackFibre:
    """One of the fibres found, followed from image to image; the result is a `FibreTrack`."""

    name = "fibre track"

    def __init__(self) -> None:
        self._tracker = FibreTracker()
        self._requested: Fibre | None = None
        self._end = False

    def follow(self, fibre: Fibre) -> None:
        """Follow `fibre` from the next image on; any thread."""
        self._end, self._requested = False, fibre

    def end(self) -> None:
        """Follow none from the next image on; any thread."""
        self._end, self._requested = True, None

    def run(self, image: CameraImage, results: Results) -> object:  # noqa: ARG002
        """Say which it is among the fibres found."""
        requested, self._requested = self._requested, None
        if requested is not None:
            self._tracker.start(requested)
        if self._end:
            self._tracker.end()
        if not self._tracker.followed:
            return Unavailable("no fibre is followed")
        found = results.get("fibres")
        if not isinstance(found, tuple):
            return Unavailable("no fibres were looked for on this image")
        return self._tracker.follow([each for each in found if isinstance(each, Fibre)])


class TrackPoint:
    """A point on the image, followed by how it looks; the result is a `Track`."""

    name = "place track"

    def __init__(self) -> None:
        self._tracker: TemplateTracker | None = None
        self._requested: tuple[float, float] | None = None
        self._end = False

    def follow(self, at_px: tuple[float, float]) -> None:
        """Follow what is there on the next image; any thread."""
        self._end, self._requested = False, at_px

    def end(self) -> None:
        """Follow nothing from the next image on; any thread."""
        self._end, self._requested = True, None

    def run(self, image: CameraImage, results: Results) -> object:  # noqa: ARG002
        """Find it again."""
        data = grey(image.data)
        requested, self._requested = self._requested, None
        if self._end:
            self._tracker = None
        if requested is not None:
            fresh = TemplateTracker()
            try:
                fresh.start(data, requested)
            except ConfigError as exc:
                return Unavailable(str(exc))
            self._tracker = fresh
        if self._tracker is None:
            return Unavailable("no point is followed")
        return self._tracker.follow(data)


class FindTools:
    """Grippers and probe; the result maps each name to `GripperTips`, `ToolEnd` or `NotSeen`.

    Attributes
    ----------
    expected : mapping of str to ExpectedTool
        Where each should be on the next image, from the stages; replaced whole, by any thread.
        One with a gap is a gripper.
    expect : callable or None
        Tells it from each image instead.
    """

    name = "tools"

    def __init__(self) -> None:
        self.expected: Mapping[str, ExpectedTool] = MappingProxyType({})
        self.expect: Expect | None = None

    def run(self, image: CameraImage, results: Results) -> object:  # noqa: ARG002
        """Find those expected."""
        expected = self.expected if self.expect is None else self.expect(image)
        if not expected:
            return Unavailable(
                NO_TOOL
                if self.expect
                else "the expected tool positions are unknown: calibrate first"
            )
        data = grey(image.data)
        return MappingProxyType({name: find_tool(data, tool) for name, tool in expected.items()})


class FindTips:
    """The tips of grippers and probe in short, for the display; a tuple of `TipSeen`.

    What the link "tools" found on the same image is taken where it is on.

    Attributes
    ----------
    expect : callable or None
        Tells from an image where the tools should be on it.
    """

    name = "tips"

    def __init__(self) -> None:
        self.expect: Expect | None = None

    def run(self, image: CameraImage, results: Results) -> object:
        """Find those expected."""
        found = results.get("tools")
        if not isinstance(found, Mapping):
            expected = self.expect(image) if self.expect is not None else {}
            if not expected:
                return Unavailable(NO_TOOL)
            data = grey(image.data)
            found = {name: find_tool(data, tool) for name, tool in expected.items()}
        seen = (tip_seen(name, each) for name, each in found.items())
        return tuple(each for each in seen if each is not None)


@algorithm
class TrackHeldFibres:
    """The free part of the fibre in each gripper; maps each gripper's name to a `HeldTrack`.

    Attributes
    ----------
    expect : callable or None
        Tells from an image where the tools should be on it.
    """

    name = "held fibre"

    def __init__(self) -> None:
        self.expect: Expect | None = None
        self._trackers: dict[str, HeldFibreTracker] = {}

    def run(self, image: CameraImage, results: Results) -> object:  # noqa: ARG002
        """Follow them."""
        from cosmic.vico.core.vision.held_tracking import HeldFibreTracker

        expected = self.expect(image) if self.expect is not None else {}
        grippers = {name: tool for name, tool in expected.items() if tool.grips}
        if not grippers:
            return Unavailable(NO_GRIPPER)
        data = grey(image.data)
        self._trackers = {name: self._trackers.get(name) or HeldFibreTracker() for name in grippers}
        return MappingProxyType(
            {name: self._trackers[name].follow(data, tool) for name, tool in grippers.items()}
        )


def _backend(make_one: Callable[[], Algorithm]) -> AnalysisBackend:
    def made(_options: NoOptions, _context: None) -> Algorithm:
        return make_one()

    return AnalysisBackend(made)


SHARPNESS: Final = _backend(Sharpness)
FIBRES: Final = _backend(FindFibres)
FIBRE_TRACK: Final = _backend(TrackFibre)
POINT_TRACK: Final = _backend(TrackPoint)
TOOLS: Final = _backend(FindTools)
TIPS: Final = _backend(FindTips)
