"""The place where a collision model plugs into the gate (thesis 6.1.2, Fig. 6.5)."""

from abc import abstractmethod
from collections.abc import Mapping
from typing import Protocol

from typing_extensions import override

from cosmic.frame.verdict import MoveVerdict, Reason
from cosmic.mico.core.orders import Interval

NO_MODEL_TEXT = "no collision model"


class CollisionChecker(Protocol):
    """Decides whether the volume that some axes may sweep is clear of everything."""

    @property
    @abstractmethod
    def available(self) -> bool:
        """False where there is no model, which windows say loudly."""

    @abstractmethod
    def check(self, swept: Mapping[str, Interval]) -> MoveVerdict:
        """Judge the intervals of all axes, those in flight and those at rest, by axis name.

        Infinite ends stand for the whole travel. An exception counts as a refusal.
        """


class NoCollisionModel(CollisionChecker):
    """Lets everything pass and says so."""

    @property
    @override
    def available(self) -> bool:
        return False

    @override
    def check(self, swept: Mapping[str, Interval]) -> MoveVerdict:
        return MoveVerdict(allowed=True, reason=Reason.ALLOWED, text=f"allowed; {NO_MODEL_TEXT}")
