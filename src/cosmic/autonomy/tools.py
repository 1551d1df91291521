"""Where tools are on the platform, and what they should look like in an image."""

import math
from collections.abc import Mapping

from cosmic.frame.errors import ConfigError
from cosmic.vico.core.pixel_map import PixelMap
from cosmic.vico.core.tool_settings import ToolSettings
from cosmic.vico.core.vision.tool_types import ExpectedTool

Point = tuple[float, float, float]


def tip_um(tool: ToolSettings, positions: Mapping[str, float]) -> Point | None:
    """Return where the tip of a tool is, x, y, z on the platform; None while an axis is unknown."""
    x_um, y_um, z_um = tool.tip_um
    try:
        return (
            x_um + positions[tool.x_axis],
            y_um + positions[tool.y_axis],
            z_um + (positions[tool.z_axis] if tool.z_axis else 0.0),
        )
    except KeyError:
        return None


def axis_targets(tool: ToolSettings, x_um: float, y_um: float) -> dict[str, float]:
    """Return where its axes stand with its tip over a position on the platform."""
    return {tool.x_axis: x_um - tool.tip_um[0], tool.y_axis: y_um - tool.tip_um[1]}


def expected(
    tool: ToolSettings,
    mapped: PixelMap,
    tip_xy_um: tuple[float, float],
    positions: Mapping[str, float],
    reach_px: float,
) -> ExpectedTool | None:
    """Return what to look for in an image of that map; None where it is too small there."""
    tip_px = mapped.to_px(tip_xy_um)
    length = math.hypot(*tool.forward)
    ahead = tip_xy_um[0] + tool.forward[0] / length, tip_xy_um[1] + tool.forward[1] / length
    forward_px = mapped.to_px(ahead) - tip_px
    gap_um = max(0.0, positions.get(tool.gap_axis, 0.0)) if tool.gap_axis else 0.0
    try:
        return ExpectedTool(
            (float(tip_px[0]), float(tip_px[1])),
            (float(forward_px[0]), float(forward_px[1])),
            tool.width_um / mapped.scale_um_px,
            gap_um / mapped.scale_um_px,
            reach_px,
            scale_um_px=mapped.scale_um_px,
        )
    except ConfigError:
        return None
