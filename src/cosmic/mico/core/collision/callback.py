"""`CollisionCallbackBase`: what is to happen when two bodies would touch (thesis Fig. 6.6)."""

from abc import ABC, abstractmethod
from enum import StrEnum
from typing import Final

from typing_extensions import override

from cosmic.frame.plugins import Backend, NoOptions
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.checker import Spans


class Response(StrEnum):
    """The two answers to a contact."""

    REFUSE = "refuse"
    IGNORE = "ignore"


class CollisionCallbackBase(ABC):
    """Decides on a movement that would bring two bodies closer than their margin; any thread.

    Called under the gate's lock: it must return at once and may not move anything.
    """

    @abstractmethod
    def on_contact(self, approach: Approach, spans: Spans) -> Response:
        """Return whether the movement is refused or this pair does not matter this time.

        Parameters
        ----------
        approach : Approach
            The pair, with the pose at which it would be too close.
        spans : mapping of AxisSpan
            Where all axes may be during the movement.
        """


class RefuseContact(CollisionCallbackBase):
    """Refuses every contact."""

    @override
    def on_contact(self, approach: Approach, spans: Spans) -> Response:
        return Response.REFUSE


ContactBackend = Backend[None, CollisionCallbackBase]
"""What an entry point of the group ``cosmic.contacts`` leads to."""


def _make_refuse(_options: NoOptions, _context: None) -> CollisionCallbackBase:
    return RefuseContact()


REFUSE: Final = ContactBackend(_make_refuse)
