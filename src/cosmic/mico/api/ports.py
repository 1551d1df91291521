"""What scripts and windows use of MiCo beside its axes, whether it is here or at a station."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from typing import Protocol

from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.callback import CollisionCallbackBase
from cosmic.mico.core.collision.model import BodyPair, SceneModel


class CollisionPort(Protocol):
    """The collision model: a `CollisionManager` here, or what is told of one at a station."""

    @property
    @abstractmethod
    def available(self) -> bool:
        """False while nothing is checked for collisions."""

    @property
    @abstractmethod
    def model(self) -> SceneModel | None:
        """The scene; None where it is not known in this process."""

    @property
    @abstractmethod
    def taken_out(self) -> frozenset[str]:
        """Axes whose movements are not checked."""

    @property
    @abstractmethod
    def ignored_pairs(self) -> frozenset[BodyPair]:
        """The pairs of bodies of the contacts allowed."""

    @property
    @abstractmethod
    def allowed_contacts(self) -> frozenset[str]:
        """Names of the contacts of the scene that are allowed now."""

    @abstractmethod
    def take_out(self, axis: str, *, source: str = "script") -> None:
        """Check movements of `axis` no longer."""

    @abstractmethod
    def take_in(self, axis: str, *, source: str = "script") -> None:
        """Check movements of `axis` again."""

    @abstractmethod
    def contact(self, name: str, *, source: str = "script") -> AbstractContextManager[None]:
        """Leave the pairs of a contact aside during a ``with`` block."""

    @abstractmethod
    def nearest(self, positions: Mapping[str, float]) -> Approach | None:
        """Return the pair nearest to each other; raises `CosmicError` without an answer."""

    @abstractmethod
    def set_callback(self, bodies: BodyPair, callback: CollisionCallbackBase | None) -> None:
        """Let a pair of bodies have its own response to a contact."""

    @abstractmethod
    def subscribe(self, callback: Callable[[], object]) -> Callable[[], None]:
        """Call `callback` when something was taken out or in, or a contact changed."""
