"""What this process is told of the MiCo of a station, where commands go there instead."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from PySide6.QtCore import QObject, Signal
from typing_extensions import override

from cosmic.frame.errors import NotAvailable, ProtocolError
from cosmic.frame.network.errors import CallRefused
from cosmic.mico.api.remote_line import CommandLine
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.callback import CollisionCallbackBase
from cosmic.mico.core.collision.exemptions import Exemptions
from cosmic.mico.core.collision.model import BodyPair, SceneModel, pair_of
from cosmic.mico.core.motion.links import Link, LinkTable
from cosmic.mico.core.motion.orders import Order
from cosmic.mico.core.motion.stop_latch import StopLatch, StopState
from cosmic.mico.core.motion.undo import UndoEntry
from cosmic.mico.core.poses import Pose, PoseBook


@dataclass(frozen=True, slots=True)
class RemoteController:
    """What is known of the controller at a station."""

    name: str = "a controller of another station"
    simulated: bool = False


class RemoteLatch(StopLatch):
    """The stop of a station, as it was last told."""

    def show(self, state: StopState) -> None:
        """Take what was told."""
        with self._lock:
            before, self._state = self._state, state
        if state != before:
            self.announce()


class RemoteLinks(LinkTable):
    """The links of a station."""

    def __init__(self, line: CommandLine) -> None:
        super().__init__()
        self._line = line

    @override
    def add(self, first: str, second: str, ratio: float = 1.0) -> Link:
        self._line.do("link", {"first": first, "second": second, "ratio": ratio})
        return Link(first, second, ratio)

    @override
    def remove(self, axis: str) -> bool:
        linked = bool(self.companions(axis))
        self._line.do("unlink", {"axis": axis})
        return linked

    def show(self, links: tuple[Link, ...]) -> None:
        """Take what was told."""
        with self._lock:
            if links == self._links:
                return
            self._set(links)
        self._changed.emit()


class RemoteCollision(Exemptions):
    """The collision model of a station: what is left out of it, and how close things are."""

    def __init__(self, line: CommandLine) -> None:
        super().__init__((), ())
        self._line = line
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
        self._line.do("watch_axis", {"axis": axis, "watched": False})

    @override
    def take_in(self, axis: str, *, source: str = "script") -> None:
        self._line.do("watch_axis", {"axis": axis, "watched": True})

    @contextmanager
    @override
    def contact(self, name: str, *, source: str = "script") -> Iterator[None]:
        self._allow(name, allowed=True)
        try:
            yield
        finally:
            self._allow(name, allowed=False)

    @override
    def allow_contact(self, name: str, *, source: str = "script") -> None:
        self._allow(name, allowed=True)

    @override
    def forbid_contact(self, name: str, *, source: str = "script") -> None:
        self._allow(name, allowed=False)

    def _allow(self, name: str, *, allowed: bool) -> None:
        self._line.do("set_contact", {"name": name, "allowed": allowed})

    def nearest(self, positions: Mapping[str, float]) -> Approach | None:
        """Return the nearest pair; raises `CosmicError` without an answer."""
        if self._refused:  # a program that may only look; asking again and again changes nothing
            raise CallRefused(self._refused)
        try:
            found = self._line.call("nearest", {"positions": dict(positions)})
        except CallRefused as exc:
            self._refused = str(exc)
            raise
        if not (found is None or isinstance(found, Approach)):
            raise ProtocolError(f"the station does not say what is nearest: {found!r:.80}")
        return found

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


class RemotePoses(PoseBook):
    """The named poses of a station."""

    def __init__(self, line: CommandLine) -> None:
        super().__init__()
        self._line = line

    @override
    def put(self, pose: Pose) -> None:
        arguments = {"name": pose.name, "positions": dict(pose.positions)}
        self._line.do("put_pose", arguments)

    @override
    def remove(self, name: str) -> None:
        self._line.do("remove_pose", {"name": name})

    def show(self, poses: Iterable[Pose]) -> None:
        """Take what was told."""
        with self._guard:
            self._poses = {pose.name: pose for pose in poses}


class RemoteUndo(QObject):
    """What can be taken back at a station.

    Signals
    -------
    changed()
        There is more or less to be taken back; in any thread.
    """

    changed = Signal()

    def __init__(self, order: Callable[[UndoEntry], dict[str, Order]]) -> None:
        super().__init__()
        self._order = order
        self._entries: tuple[UndoEntry, ...] = ()

    @property
    def entries(self) -> tuple[UndoEntry, ...]:
        """What can be taken back, the newest first."""
        return self._entries

    def newest(self, group: str | None = None) -> UndoEntry:
        """Return what is to be taken back first; raises `NotAvailable`."""
        for entry in self._entries:
            if group in (None, entry.group):
                return entry
        raise NotAvailable(f"there is nothing to undo{f' of {group}' if group else ''}")

    def order(self, entry: UndoEntry) -> dict[str, Order]:
        """Begin to move back; raises `MoveRefused`, and the entry stays."""
        return self._order(entry)

    def drop(self, entry: UndoEntry) -> None:
        """Do nothing: the station forgets it by itself."""

    def show(self, entries: tuple[UndoEntry, ...]) -> None:
        """Take what was told."""
        if entries != self._entries:
            self._entries = entries
            self.changed.emit()
