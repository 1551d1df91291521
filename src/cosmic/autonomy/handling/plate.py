"""Positions on the plate that stay the same while it turns, and the turn that suits a gripper."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cosmic.autonomy.handling.plate_obstacles import ROOM_UM, any_under
from cosmic.autonomy.handling.settings import GraspSettings
from cosmic.frame.arrays import Floats


@dataclass(frozen=True, slots=True)
class PlateFrame:
    """The plate, turning about a position on the platform."""

    centre_um: tuple[float, float] = (0.0, 0.0)

    def on_plate(self, platform_um: Floats, angle_deg: float) -> Floats:
        """Return where positions lie on the plate, which stands at `angle_deg`; shape (n, 2)."""
        return np.asarray((platform_um - np.array(self.centre_um)) @ _turn(angle_deg))

    def on_platform(self, plate_um: Floats, angle_deg: float) -> Floats:
        """Return where positions on the plate are on the platform."""
        return np.asarray(plate_um @ _turn(angle_deg).T + np.array(self.centre_um))


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A fibre on the plate that may be taken up.

    Attributes
    ----------
    line_um : ndarray, shape (n, 2)
        Centre line on the plate.
    length_um, width_um, curl : float
        As seen in the survey; by them it is known again.
    length_std_um, width_std_um, curl_std : float
        Their standard deviations; nan where nobody knows.
    problem : str
        Why it is not taken; empty when it may be.
    doubted : bool
        It is not certain that it is one whole fibre.
    probability : float
        Of one whole fibre, where that is doubted and it is taken; nan elsewhere.
    """

    line_um: Floats
    length_um: float
    width_um: float
    curl: float
    contrast: float
    problem: str = ""
    length_std_um: float = math.nan
    width_std_um: float = math.nan
    curl_std: float = math.nan
    doubted: bool = False
    probability: float = math.nan

    def moved(self, line_um: Floats) -> "Candidate":
        """Return the same fibre on another line."""
        return replace(self, line_um=line_um)

    @property
    def position_um(self) -> tuple[float, float]:
        """Its middle on the plate."""
        x, y = self.line_um.mean(axis=0).tolist()
        return x, y


@dataclass(frozen=True, slots=True, eq=False)
class Reach:
    """How a gripper gets at a candidate.

    Attributes
    ----------
    angle_deg : float
        Where the table is to stand.
    line_um : ndarray, shape (n, 2)
        Where the fibre will be on the platform, from the end that is grasped.
    tip_um : (float, float)
        Where the middle between the jaws' tips goes.
    under : int
        How many other fibres lie under the jaws.
    """

    candidate: Candidate
    angle_deg: float
    line_um: Floats
    tip_um: tuple[float, float]
    under: int = 0


@dataclass(frozen=True, slots=True)
class Jaws:
    """What `reaches` must know of a gripper.

    Attributes
    ----------
    forward : float
        1 or -1: which way along x it points.
    length_um, half_um : float
        Of the jaws behind their tips, and from their middle to the outside, open.
    """

    forward: float = 1.0
    length_um: float = 6000.0
    half_um: float = 260.0

    def cover(
        self, obstacles_um: Sequence[Floats], tip_um: tuple[float, float], settings: GraspSettings
    ) -> bool:
        """Return whether the jaws cover an obstacle on the plate, however far they are open.

        Parameters
        ----------
        obstacles_um : sequence of ndarray, shape (n, 2)
            Corners of convex ones, on the platform.
        """
        aside = self.half_um + 0.5 * (settings.full_um - settings.gap_um) + ROOM_UM
        ahead, behind = self.forward * ROOM_UM, -self.forward * (self.length_um + ROOM_UM)
        x, y = tip_um
        corners = np.array([[x + ahead, y - aside], [x + behind, y + aside]])
        return any_under(obstacles_um, corners.min(axis=0), corners.max(axis=0))


@dataclass(frozen=True, slots=True)
class Neighbours:
    """Everything on the plate that a gripper should not come down on.

    Attributes
    ----------
    lines_um : sequence of ndarray, shape (n, 2)
        Fibres.
    obstacles_um : sequence of ndarray, shape (n, 2)
        Corners of what stands on it, such as a clip.
    """

    lines_um: Sequence[Floats] = field(default_factory=tuple)
    obstacles_um: Sequence[Floats] = field(default_factory=tuple)


def reaches(
    candidate: Candidate,
    frame: PlateFrame,
    jaws: Jaws,
    settings: GraspSettings,
    others: Neighbours,
    angle_now_deg: float,
) -> list[Reach]:
    """Return the ways to take a candidate, the best first: nothing under the jaws, a small turn."""
    found = []
    for line in (candidate.line_um, candidate.line_um[::-1]):
        wanted = 0.0 if jaws.forward > 0.0 else 180.0
        angle = _wrapped(wanted - _direction_deg(line, settings.inside_um))
        turned = frame.on_platform(line, angle)
        tip = along(turned, settings.inside_um)
        reach = Reach(candidate, angle, turned, (float(tip[0]), float(tip[1])))
        obstacles = [frame.on_platform(each, angle) for each in others.obstacles_um]
        if not _in_reach(reach, jaws, settings) or jaws.cover(obstacles, reach.tip_um, settings):
            continue
        under = _under(reach, frame, jaws, settings, others)
        if under is not None:
            found.append(replace(reach, under=under))
    return sorted(found, key=lambda each: (each.under, abs(each.angle_deg - angle_now_deg)))


def along(line: Floats, along_um: float) -> Floats:
    """Return the position so far along a line from its begin."""
    arc_length = arc_lengths(line)
    return np.array(
        [np.interp(along_um, arc_length, line[:, 0]), np.interp(along_um, arc_length, line[:, 1])]
    )


def arc_lengths(line: Floats) -> Floats:
    """Return how far along a line each of its points lies."""
    steps = np.linalg.norm(np.diff(line, axis=0), axis=1)
    return np.concatenate([np.zeros(1), np.cumsum(steps)])


def _direction_deg(line: Floats, inside_um: float) -> float:
    """Return where a fibre points to from where it is grasped: there it must lie along the jaws."""
    tip, near = along(line, 0.0), along(line, 2.0 * inside_um)
    return math.degrees(math.atan2(near[1] - tip[1], near[0] - tip[0]))


def _in_reach(reach: Reach, jaws: Jaws, settings: GraspSettings) -> bool:
    x, y = reach.tip_um
    return (
        x * jaws.forward <= settings.reach_x_um
        and abs(y) <= settings.reach_y_um
        and abs(reach.angle_deg) <= settings.largest_turn_deg
    )


def _under(
    reach: Reach, frame: PlateFrame, jaws: Jaws, settings: GraspSettings, others: Neighbours
) -> int | None:
    """Return how many others lie where the jaws come down; None: one would be grasped as well."""
    x, y = reach.tip_um
    count = 0
    for line in others.lines_um:
        turned = frame.on_platform(line, reach.angle_deg)
        behind = (x - turned[:, 0]) * jaws.forward
        beside = np.abs(turned[:, 1] - y)
        across = beside < jaws.half_um + settings.clear_um
        if (across & (np.abs(behind) < settings.inside_um + settings.clear_um)).any():
            return None
        count += bool((across & (behind > 0.0) & (behind < jaws.length_um)).any())
    return count


def within_um(line: Floats, other: Floats, um: float) -> bool:
    """Return whether two lines have points that are nearer to each other than `um`."""
    # Most lines lie far apart: then so do boxes about them, and no pair of points is looked at.
    apart = np.maximum(line.min(axis=0) - other.max(axis=0), other.min(axis=0) - line.max(axis=0))
    if not (apart < um).all():
        return False
    ahead = line[:, 0, None] - other[None, :, 0]
    aside = line[:, 1, None] - other[None, :, 1]
    return bool((ahead * ahead + aside * aside).min() < um * um)


def _turn(angle_deg: float) -> Floats:
    angle = math.radians(angle_deg)
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin], [sin, cos]])


def _wrapped(angle_deg: float) -> float:
    return math.remainder(angle_deg, 360.0)
