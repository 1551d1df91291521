"""What machine vision says about tools and what they hold, in short."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from cosmic.frame.arrays import Floats
from cosmic.frame.renamed import Renamed
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.vision.tips import find_gripper, find_probe, find_shut_gripper
from cosmic.vico.core.vision.tool_types import ExpectedTool, GripperTips, NotSeen, ToolEnd
from cosmic.vico.hw.interface import Pixels

Expect = Callable[[CameraImage], Mapping[str, ExpectedTool]]
Found = GripperTips | ToolEnd | NotSeen


@dataclass(frozen=True, slots=True)
class TipSeen:
    """The tip of a tool on an image.

    Attributes
    ----------
    point_px : (float, float)
        Of a gripper the middle between its jaws' inner corners.
    certain : bool
        It can be relied on; what the link "tools" gives says why not.
    """

    name: str
    point_px: tuple[float, float]
    certain: bool
    place_px = Renamed("point_px")


@dataclass(frozen=True, slots=True, eq=False)
class HeldSeen:
    """A held fibre in short, for the display.

    Attributes
    ----------
    name : str
        Of the gripper.
    line_px : ndarray, shape (n, 2)
        Its free part.
    angle_deg : float
        At the clamp, from the direction of the gripper.
    scale_um_px : float or None
        Size of a pixel at its height, which is not that of the plate; None where nobody knows.
    """

    name: str
    line_px: Floats
    length_px: float
    angle_deg: float
    certain: bool
    scale_um_px: float | None = None


def find_tool(image: Pixels, expected: ExpectedTool) -> Found:
    """Return the tip of a gripper, or of what has no gap."""
    return find_jaws(image, expected) if expected.grips else find_probe(image, expected)


def find_jaws(image: Pixels, expected: ExpectedTool) -> GripperTips | NotSeen:
    """Return the tip of a gripper, open or shut."""
    return (find_shut_gripper if expected.shut else find_gripper)(image, expected)


def tip_seen(name: str, found: object) -> TipSeen | None:
    """Return what was found in short; None where nothing was."""
    if isinstance(found, GripperTips):
        return TipSeen(name, found.hold_px, found.certain)
    return TipSeen(name, found.tip_px, found.certain) if isinstance(found, ToolEnd) else None
