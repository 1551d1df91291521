"""What core sees of the MiCo of a station: as it was told last; commands go there."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from typing_extensions import override

from cosmic.frame.errors import NotAvailable
from cosmic.frame.network.errors import CallRefused
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.callback import CollisionCallbackBase
from cosmic.mico.core.collision.exemptions import Exemptions
from cosmic.mico.core.collision.model import BodyPair, SceneModel, pair_of
from cosmic.mico.core.motion.links import Link, LinkTable
from cosmic.mico.core.motion.stop_latch import StopLatch, StopState


@dataclass(frozen=True, slots=True)
class ControllerElsewhere:
    """What is known of the controller at a station."""

    name: str = "a controller of another station"
    simulated: bool = False


class LatchElsewhere(StopLatch):
    """The stop of a station, as it was last told."""

    def show(self, state: StopState) -> None:
        """Take what was told."""
        with self._lock:
            before, self.state = self.state, state
        if state != before:
            self.announce()


class LinksElsewhere(LinkTable):
    """The links of a station."""

    def __init__(self, mico: Mico) -> None:
        super().__init__()
        self._mico = mico

    @override
    def add(self, first: str, second: str, ratio: float = 1.0) -> Link:
        self._mico.add_link(first, second, ratio)
        return Link(first, second, ratio)

    @override
    def remove(self, axis: str) -> bool:
        linked = bool(self.companions(axis))
        self._mico.remove_links(axis)
        return linked

    def show(self, links: tuple[Link, ...]) -> None:
        """Take what was told."""
        with self._lock:
            if links == self._links:
                return
            self._set(links)
        self._changed.emit()


class CollisionElsewhere(Exemptions):
    """The collision model of a station: what is left out of it, and how close things are."""

    def __init__(self, mico: Mico) -> None:
        super().__init__((), ())
        self._mico = mico
        self._refused = ""
        self.model: SceneModel | None = None

    @property
    def available(self) -> bool:
        """False while nothing is checked for collisions, as far as is known here."""
        return self.model is not None

    def learn(self, model: SceneModel | None) -> None:
        """Take note of the scene; None: there is none."""
        with self._guard:
            self.model = model
            self._contacts = model.contacts if model is not None else ()
            self._note_ignored()
        self._changed.emit()

    def _note_ignored(self) -> None:
        self._ignored = frozenset(
            pair_of(*pair)
            for contact in self._contacts
            if contact.name in self._allowed
            for pair in contact.pairs
        )

    @override
    def take_out(self, axis: str, *, source: str = "script") -> None:
        self._mico[axis].watch(False, source=source)

    @override
    def take_in(self, axis: str, *, source: str = "script") -> None:
        self._mico[axis].watch(True, source=source)

    @contextmanager
    @override
    def contact(self, name: str, *, source: str = "script") -> Iterator[None]:
        self._mico.set_contact(name, allowed=True, source=source)
        try:
            yield
        finally:
            self._mico.set_contact(name, allowed=False, source=source)

    @override
    def allow_contact(self, name: str, *, source: str = "script") -> None:
        self._mico.set_contact(name, allowed=True, source=source)

    @override
    def forbid_contact(self, name: str, *, source: str = "script") -> None:
        self._mico.set_contact(name, allowed=False, source=source)

    def nearest(self, positions: Mapping[str, float]) -> Approach | None:
        """Return the nearest pair; raises `CosmicError` without an answer."""
        if self._refused:  # a program that may only look; asking again and again changes nothing
            raise CallRefused(self._refused)
        try:
            return self._mico.nearest(dict(positions))
        except CallRefused as exc:
            self._refused = str(exc)
            raise

    def set_callback(
        self,
        bodies: BodyPair,
        callback: CollisionCallbackBase | None,  # noqa: ARG002 - the shape of CollisionManager
    ) -> None:
        """Raise `NotAvailable`: a function cannot travel."""
        raise NotAvailable(
            f"{bodies[0]} and {bodies[1]}: a response of its own can be set at the station only"
        )

    def show(self, taken_out: Iterable[str], contacts: Iterable[str]) -> None:
        """Take what was told."""
        with self._guard:
            before = self._taken_out, self._allowed
            self._taken_out, self._allowed = frozenset(taken_out), frozenset(contacts)
            changed = before != (self._taken_out, self._allowed)
            self._note_ignored()
        if changed:
            self._changed.emit()
