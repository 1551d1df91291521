"""What the parts of the workplace ask of it."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from typing import Protocol

from cosmic.frame.arrays import Floats
from cosmic.twin.kinematics import Point
from cosmic.twin.tools import Tool

Record = Callable[..., None]


class Surroundings(Protocol):
    """Where everything is at one look; what is costly is computed when it is asked for."""

    tools: Mapping[str, Tool]
    time_s: float

    @abstractmethod
    def plate(self) -> Floats:
        """Return `world_from_plate`, shape (4, 4), um."""

    @abstractmethod
    def anchor(self, name: str) -> Point:
        """Return a tip, as `Workspace.tips` names it."""
