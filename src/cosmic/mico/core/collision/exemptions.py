"""What the operator leaves out of collision detection for a while: axes and contacts."""

import logging
from collections.abc import Callable, Iterator, Sequence, Set
from contextlib import contextmanager
from threading import Lock

from cosmic.frame.errors import NotAvailable, UnknownAxisError
from cosmic.frame.events import Event, Unsubscribe
from cosmic.mico.core.collision.model import BodyPair, Contact, pair_of

logger = logging.getLogger(__name__)


def _nobody(_axes: Set[str], _pairs: Set[BodyPair]) -> None:
    """Nothing moves where nobody listens."""


class Exemptions:
    """Keeps which axes are taken out and which contacts are allowed; any thread.

    Parameters
    ----------
    contacts : sequence of Contact
        Those that the scene describes.
    axes : sequence of str
        Names of all axes that can be taken out.
    """

    def __init__(self, contacts: Sequence[Contact], axes: Sequence[str]) -> None:
        self._contacts = tuple(contacts)
        self._axes = tuple(axes)
        self._guard = Lock()
        self._taken_out: frozenset[str] = frozenset()
        self._allowed: frozenset[str] = frozenset()
        self._uses: dict[str, list[object]] = {contact.name: [] for contact in contacts}
        self._ignored: frozenset[BodyPair] = frozenset()
        self._changed: Event[[]] = Event()
        self.on_watched_again: Callable[[Set[str], Set[BodyPair]], None] = _nobody
        """Told which axes, and which pairs of bodies, are watched again, in that thread."""
        self.revision = 0
        """How often something was watched again."""

    def watch_again(self, axes: Set[str], pairs: Set[BodyPair]) -> None:
        """Count that something is watched again, then tell; what is decided meanwhile is void."""
        with self._guard:
            self.revision += 1
        self.on_watched_again(axes, pairs)

    # Axes taken out (MiCoCL.13)

    @property
    def taken_out(self) -> frozenset[str]:
        """Axes whose movements are not checked."""
        return self._taken_out

    def take_out(self, axis: str, *, source: str = "script") -> None:
        """Check movements of `axis` no longer; other axes still keep clear of its bodies.

        Raises
        ------
        UnknownAxisError
            The platform has no such axis.
        """
        if self._set_taken_out(axis, out=True):
            logger.warning(
                "%s was taken out of collision detection by %s: its movements are NOT checked",
                axis,
                source,
            )
            self._changed.emit()

    def take_in(self, axis: str, *, source: str = "script") -> None:
        """Check movements of `axis` again.

        Raises
        ------
        UnknownAxisError
            The platform has no such axis.
        """
        if self._set_taken_out(axis, out=False):
            self.watch_again({axis}, frozenset())
            logger.info("%s was taken into collision detection again by %s", axis, source)
            self._changed.emit()

    def _set_taken_out(self, axis: str, *, out: bool) -> bool:
        if axis not in self._axes:
            raise UnknownAxisError(axis, self._axes)
        with self._guard:
            before = self._taken_out
            self._taken_out = before | {axis} if out else before - {axis}
            return self._taken_out != before

    # Contacts that are meant

    @property
    def allowed_contacts(self) -> frozenset[str]:
        """Names of the contacts of the scene that are allowed now."""
        return self._allowed

    @property
    def ignored_pairs(self) -> frozenset[BodyPair]:
        """The pairs of bodies of the contacts allowed."""
        return self._ignored

    def allow_contact(self, name: str, *, source: str = "script") -> None:
        """Leave the pairs of a contact of the scene aside until it is forbidden.

        Raises
        ------
        NotAvailable
            The scene describes no such contact.
        """
        self._use(name, name, source)

    def forbid_contact(self, name: str, *, source: str = "script") -> None:
        """Watch the pairs of a contact again, whoever allowed it.

        Raises
        ------
        NotAvailable
            The scene describes no such contact.
        """
        self._end_uses(name, None, source)

    @contextmanager
    def contact(self, name: str, *, source: str = "script") -> Iterator[None]:
        """Leave the pairs of a contact aside during a ``with`` block; may be nested.

        Raises
        ------
        NotAvailable
            The scene describes no such contact.
        """
        use = object()
        self._use(name, use, source)
        try:
            yield
        finally:
            self._end_uses(name, use, source)

    def _use(self, name: str, use: object, source: str) -> None:
        with self._guard:
            uses = self._uses_of(name)
            if use not in uses:
                uses.append(use)
            changed = self._renew_allowed()
        if changed:
            logger.info("the contact %r was allowed by %s", name, source)
            self._changed.emit()

    def _end_uses(self, name: str, use: object | None, source: str) -> None:
        with self._guard:
            uses = self._uses_of(name)
            uses[:] = [] if use is None else [each for each in uses if each != use]
            before = self._ignored
            changed = self._renew_allowed()
            watched = before - self._ignored
        if watched:
            self.watch_again(frozenset(), watched)
        if changed:
            logger.info("the contact %r was forbidden again by %s", name, source)
            self._changed.emit()

    def _uses_of(self, name: str) -> list[object]:
        if name not in self._uses:
            known = ", ".join(self._uses) or "none"
            raise NotAvailable(f"the scene describes no contact {name!r}; it knows: {known}")
        return self._uses[name]

    def _renew_allowed(self) -> bool:
        before = self._allowed
        self._allowed = frozenset(name for name, uses in self._uses.items() if uses)
        self._ignored = frozenset(
            pair_of(*pair)
            for contact in self._contacts
            if contact.name in self._allowed
            for pair in contact.pairs
        )
        return self._allowed != before

    # Who is told

    def subscribe(self, callback: Callable[[], object]) -> Unsubscribe:
        """Call `callback` when axes are taken out or in, or contacts allowed or forbidden.

        Called in the thread of the change. Returns the function that ends it.
        """
        return self._changed.subscribe(callback)
