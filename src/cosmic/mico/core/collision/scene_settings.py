"""The TOML file of a scene: which files describe it, and what URDF and SRDF cannot say."""

from typing import Annotated

from pydantic import Field

from cosmic.frame.config import StrictModel

Pair = Annotated[tuple[str, str], Field(strict=False)]
Pairs = Annotated[tuple[Pair, ...], Field(strict=False, min_length=1)]
NotNegative = Annotated[float, Field(ge=0.0)]
Positive = Annotated[float, Field(gt=0.0)]


class DriveSettings(StrictModel):
    """Which axis moves a joint: joint = offset + factor * position.

    The factor is um/um, or degrees per degree; `_um` belongs to prismatic joints, `_deg` to those
    that turn.
    """

    axis: str
    joint: str
    factor: float = 1.0
    offset_um: float | None = None
    offset_deg: float | None = None
    overshoot_um: NotNegative | None = None
    overshoot_deg: NotNegative | None = None
    uncertainty_um: NotNegative | None = None
    uncertainty_deg: NotNegative | None = None


class MarginSettings(StrictModel):
    """Two bodies that keep another distance than the usual one."""

    bodies: Pair
    margin_um: NotNegative


class ContactSettings(StrictModel):
    """An operation during which some pairs may touch."""

    operation: str
    pairs: Pairs
    reason: Annotated[str, Field(min_length=1)]


class ToolFrameSettings(StrictModel):
    """The working point of a tool: `tip_um` in the frame of `link`, turned against it."""

    name: Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
    link: str
    tip_um: Annotated[tuple[float, float, float], Field(strict=False)] = (0.0, 0.0, 0.0)
    rpy_deg: Annotated[tuple[float, float, float], Field(strict=False)] = (0.0, 0.0, 0.0)


class SizeLimits(StrictModel):
    """What is taken for a mistake because of its size."""

    largest_body_um: Positive = 1e6
    smallest_body_um: Positive = 1.0
    scene_radius_um: Positive = 2e6
    file_bytes: Annotated[int, Field(gt=0)] = 64 * 1024 * 1024
    piece_faces: Annotated[int, Field(ge=4)] = 5000
    view_faces: Annotated[int, Field(ge=1)] = 30000


class SceneSettings(StrictModel):
    """The whole file; other files are named relative to it."""

    urdf: str
    srdf: str
    margin_um: NotNegative
    drive: Annotated[tuple[DriveSettings, ...], Field(strict=False)]
    margin: Annotated[tuple[MarginSettings, ...], Field(strict=False)] = ()
    contact: Annotated[tuple[ContactSettings, ...], Field(strict=False)] = ()
    park: dict[str, float] = Field(default_factory=dict)
    detour: dict[str, float] = Field(default_factory=dict)
    tool: Annotated[tuple[ToolFrameSettings, ...], Field(strict=False)] = ()
    plate: str = ""
    exchange: dict[str, str] = Field(default_factory=dict)
    sha256: dict[str, str] = Field(default_factory=dict)
    limits: SizeLimits = SizeLimits()
