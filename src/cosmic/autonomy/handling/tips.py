"""Where the tips of tools are seen, and how far that is from where they should be."""

import math
from dataclasses import dataclass, replace
from typing import Final

from cosmic.autonomy.coordinate_transform import REACH_PX, PlatformTransform
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.plate import PlateFrame
from cosmic.autonomy.handling.sight import map_at
from cosmic.autonomy.tools import expected, tip_um
from cosmic.frame.errors import CosmicError, NotAvailable
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.tool_settings import ToolSettings
from cosmic.vico.core.vision.algorithms import grey
from cosmic.vico.core.vision.tips import find_gripper, find_probe
from cosmic.vico.core.vision.tool_types import GripperTips, NotSeen, ToolEnd

TIMES_STD: Final = 3.0
"""What is less than so many standard deviations is noise."""

Off = tuple[float, float]


@dataclass(frozen=True, slots=True)
class TipOff:
    """How far a tip is seen from where its stages and the map say.

    Attributes
    ----------
    std_um : float
        Of a coordinate: of the tip on the image and of the map there.
    scale_um_px : float
        Of the image.
    certain : bool
        Nothing on the image makes one doubt it, such as a fibre at an edge.
    zoom_counts : float or None
        Where the zoom stood; None: not known, or there is none.
    """

    off_um: Off
    std_um: float
    scale_um_px: float = 0.0
    certain: bool = True
    zoom_counts: float | None = None


def tip_off(work: HandlingContext, image: CameraImage, tool: ToolSettings) -> TipOff:
    """Return how far a tip is from where it should be seen; raises `NotAvailable`."""
    found = see_tip(work, image, tool)
    if isinstance(found, NotSeen):
        raise NotAvailable(f"{tool.shown} was not seen: {found.reason}")
    believed = tip_um(tool, image.circumstances.positions)
    if believed is None:
        raise NotAvailable(f"{tool.name}: its position is unknown")
    mapped = work.mapped(image, believed[2])
    seen_px = found.hold_px if isinstance(found, GripperTips) else found.tip_px
    x, y = mapped.to_um(seen_px).tolist()
    std_um = math.hypot(found.std_px * mapped.scale_um_px, float(mapped.std_um(seen_px)))
    off_um = x - believed[0], y - believed[1]
    zoom = image.circumstances.zoom_counts
    return TipOff(off_um, std_um, mapped.scale_um_px, found.certain, zoom)


def shift_maps(work: HandlingContext, seen: TipOff, *, lens: bool = False) -> None:
    """Have the maps of one zoom, made by the gripper, follow its tip, which is now off by so much.

    Parameters
    ----------
    lens : bool
        The image has moved, as it does with each run of the zoom. Otherwise the tip has: what lies
        on the plate keeps its position there, and the rotation centre goes along.
    """
    off_um = seen.off_um
    positions = work.vision.transform
    if not isinstance(positions, PlatformTransform):
        raise NotAvailable("micromanipulation is not hosted here: there are no maps")
    camera = work.settings.camera or work.vision.first_camera
    by_um = -off_um[0], -off_um[1]
    positions.calibrations.shift(camera, work.gripper.name, by_um, seen.zoom_counts)
    if lens:
        return
    x, y = work.calibration.frame.centre_um
    work.calibration.frame = PlateFrame((x - off_um[0], y - off_um[1]))


def see_tip(
    work: HandlingContext, image: CameraImage, tool: ToolSettings
) -> GripperTips | ToolEnd | NotSeen:
    """Look for a tool's tip where its stages say it is, with the jaws as far open as counted."""
    positions = image.circumstances.positions
    tip = tip_um(tool, positions)
    if tip is None:
        return NotSeen("its position is unknown")
    try:
        mapped = map_at(work.vision.transform, image, tip[2])
    except CosmicError as exc:
        return NotSeen(str(exc))
    wanted = expected(tool, mapped, tip[:2], positions, REACH_PX)
    if wanted is None:
        return NotSeen("it is too small in the image: zoom in")
    if not tool.gap_axis:
        return find_probe(grey(image.data), wanted)
    gap_px = (work.gap_um or 0.0) / mapped.scale_um_px
    return find_gripper(grey(image.data), replace(wanted, gap_px=gap_px))
