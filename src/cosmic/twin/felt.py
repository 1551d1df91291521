"""What the probe feels, and the truth of the force side at one moment."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from cosmic.twin.fibre_state import FibreState
from cosmic.twin.kinematics import Point


class Push(NamedTuple):
    """What one fibre does to the probe.

    Attributes
    ----------
    fibre : int
        Its number in twin.toml.
    abscissa_um : float
        From the jaws' tip to the probe.
    deflection_um : float
        Of the fibre at the probe.
    along_un, up_un : float
        Load on the probe along the world's x and z.
    """

    fibre: int
    force_un: float
    abscissa_um: float
    deflection_um: float
    along_un: float = 0.0
    up_un: float = 0.0


class Felt(NamedTuple):
    """What the probe feels at one moment.

    Attributes
    ----------
    slack_um : float
        Things may come nearer by so much before anything can happen.
    gap_um : float
        The same of what jaws may open or close.
    """

    pushes: tuple[Push, ...] = ()
    jaw_un: float = 0.0
    slack_um: float = 0.0
    gap_um: float = 0.0

    @property
    def total_un(self) -> float:
        """Force on the probe, positive when it is pushed back."""
        total = self.jaw_un
        for push in self.pushes:
            total += push.force_un
        return total


@dataclass(frozen=True, slots=True)
class Moment:
    """The truth of the force side at one moment.

    Attributes
    ----------
    force_un : float
        On the probe; positive when it is pushed back.
    pushes : tuple of Push
        One for each fibre that touches the probe.
    jaw_un : float
        The part of the force that comes from a jaw.
    tips_um : mapping of str to point
        See `Workspace.tips`.
    """

    time_s: float
    force_un: float
    pushes: tuple[Push, ...]
    jaw_un: float
    tips_um: Mapping[str, Point]
    fibres: tuple[FibreState, ...]
