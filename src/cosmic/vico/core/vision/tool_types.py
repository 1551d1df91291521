"""Where a tool is expected on the image, and what was seen of it."""

import math
from dataclasses import dataclass, replace

from cosmic.frame.errors import ConfigError

Pair = tuple[float, float]


@dataclass(frozen=True, slots=True)
class ExpectedTool:
    """Where a tool should be, from the stages and the calibration.

    Attributes
    ----------
    tip_px : (float, float)
        Middle of the front; of a gripper, between its jaws.
    forward : (float, float)
        Direction in the image from its body out over the tip; made a unit vector.
    width_px : float
        Of the probe, or of one jaw.
    gap_px : float
        Between the jaws; 0 for a probe.
    step_px : float
        How much further the second jaw reaches than the first.
    reach_px : float
        How far off all this may be.
    shut : bool
        It is a gripper whose jaws touch, or all but: one body as wide as both, without a gap.
    scale_um_px : float or None
        Size of a pixel at its height; None where nobody knows.
    """

    tip_px: Pair
    forward: Pair
    width_px: float
    gap_px: float = 0.0
    reach_px: float = 40.0
    step_px: float = 0.0
    shut: bool = False
    scale_um_px: float | None = None

    @property
    def grips(self) -> bool:
        """Whether it is a gripper."""
        return self.shut or self.gap_px > 0.0

    @property
    def half_px(self) -> float:
        """From its middle to its side."""
        return 0.5 * self.gap_px + self.width_px * (1.0 if self.gap_px > 0.0 else 0.5)

    def with_jaws_shut(self) -> "ExpectedTool":
        """Return what a gripper looks like whose gap is too narrow to be seen."""
        width_px = 2.0 * self.width_px + self.gap_px
        return replace(self, width_px=width_px, gap_px=0.0, step_px=0.0, shut=True)

    def __post_init__(self) -> None:
        """Refuse what cannot be looked for."""
        length = math.hypot(*self.forward)
        numbers = (*self.tip_px, self.width_px, self.gap_px, self.reach_px, self.step_px, length)
        if not all(math.isfinite(each) for each in numbers):
            raise ConfigError("tool tips: a point or a size expected is not a number")
        if not (length > 0.0 and self.width_px >= 6.0 and self.gap_px >= 0.0 < self.reach_px):
            raise ConfigError(
                f"tool tips: a width of {self.width_px:g} px, a gap of {self.gap_px:g} px and a "
                f"reach of {self.reach_px:g} px cannot be looked for; zoom in to 6 px or more"
            )
        x, y = self.forward
        object.__setattr__(self, "forward", (x / length, y / length))


@dataclass(frozen=True, slots=True)
class NotSeen:
    """Why a tool was not found."""

    reason: str


@dataclass(frozen=True, slots=True)
class ToolEnd:
    """The end of a probe or of one jaw.

    Attributes
    ----------
    tip_px : (float, float)
        Middle of the front, between the points of half the contrast.
    corners_px : two of (float, float)
        Where the front meets the sides; of a jaw the inner one first.
    std_px : float
        Standard deviation of a coordinate of the tip.
    """

    tip_px: Pair
    corners_px: tuple[Pair, Pair]
    forward: Pair
    width_px: float
    std_px: float
    doubts: tuple[str, ...] = ()

    @property
    def certain(self) -> bool:
        """Whether it can be relied on; `doubts` says why not."""
        return not self.doubts


@dataclass(frozen=True, slots=True)
class GripperTips:
    """Both jaws of a gripper.

    Attributes
    ----------
    hold_px : (float, float)
        Middle between the inner corners.
    jaws : two of ToolEnd
        The first is the one to the left of the direction the gripper points to, on the screen.
    """

    hold_px: Pair
    gap_px: float
    gap_std_px: float
    std_px: float
    jaws: tuple[ToolEnd, ToolEnd]
    doubts: tuple[str, ...] = ()

    @property
    def certain(self) -> bool:
        """Whether it can be relied on; `doubts` says why not."""
        return not self.doubts
