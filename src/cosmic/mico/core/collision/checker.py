"""The place where a collision model plugs into the gate (thesis 6.1.2, Fig. 6.5)."""

from abc import abstractmethod
from typing import Protocol

from typing_extensions import override

from cosmic.frame.verdict import MoveVerdict, Reason
from cosmic.mico.core.collision.answer import Spans

NO_MODEL_TEXT = "no collision model"


class CollisionChecker(Protocol):
    """Decides whether the volume that some axes may sweep is clear of everything."""

    @property
    @abstractmethod
    def available(self) -> bool:
        """False where there is no model, which windows say loudly."""

    @abstractmethod
    def check(self, spans: Spans, *, advice: bool = True) -> MoveVerdict:
        """Check where all axes may be, those about to move, in flight and at rest; any thread.

        An exception counts as a refusal. Without `advice` a refusal does not say how far the
        axis could go, which takes longer to find out than that it cannot.
        """

    def check_promptly(self, spans: Spans) -> MoveVerdict | None:
        """Answer as `check` where that takes a few milliseconds at most; None where it may not.

        A refusal is said without haste: None leaves it to `check`, as a checker may always do.
        """

    @abstractmethod
    def start(self) -> None:
        """Make it ready to answer; returns when it is, or has failed and answers no."""

    @abstractmethod
    def close(self) -> None:
        """Give everything back; harmless the second time."""


class NoCollisionModel(CollisionChecker):
    """Lets everything pass and says so."""

    @property
    @override
    def available(self) -> bool:
        return False

    @override
    def check(self, spans: Spans, *, advice: bool = True) -> MoveVerdict:
        return MoveVerdict(allowed=True, reason=Reason.ALLOWED, text=f"allowed; {NO_MODEL_TEXT}")

    @override
    def check_promptly(self, spans: Spans) -> MoveVerdict | None:
        return self.check(spans)

    @override
    def start(self) -> None:
        """Do nothing: there is nothing to start."""

    @override
    def close(self) -> None:
        """Do nothing: nothing was started."""
