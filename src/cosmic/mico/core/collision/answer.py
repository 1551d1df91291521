"""What the collision gate answers, as plain data; without Qt."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from cosmic.mico.core.collision.model import BodyPair

INSIDE_TEXT: Final = "closer than the margin already; they may only move apart"


@dataclass(frozen=True)
class Approach:
    """Two bodies at a pose: how far apart, and where.

    Attributes
    ----------
    distance_um : float
        Gap between the two; 0 when they touch or overlap.
    places_um : two tuples of float
        The two points nearest to each other, in world coordinates.
    pose : mapping of float
        Position of every axis, in its unit.
    """

    bodies: BodyPair
    distance_um: float
    places_um: tuple[tuple[float, float, float], tuple[float, float, float]]
    margin_um: float = 0.0
    pose: Mapping[str, float] = field(default_factory=dict)

    @property
    def place_um(self) -> tuple[float, float, float]:
        """The middle between the two points."""
        (ax, ay, az), (bx, by, bz) = self.places_um
        return (ax + bx) / 2.0, (ay + by) / 2.0, (az + bz) / 2.0


@dataclass(frozen=True)
class SweepAnswer:
    """What the gate found in the volume swept.

    Attributes
    ----------
    clear : bool
        No pair can come closer than its margin.
    approach : Approach or None
        Where a pair does, when it is not clear; else the nearest that was looked at, if any.
    reason : str
        Why there is no answer, when there is none; then `clear` is False.
    """

    clear: bool
    approach: Approach | None = None
    reason: str = ""
