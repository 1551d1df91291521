"""The collision model as scripts and windows see it: ``rig.mico.collision``."""

import math
from abc import abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

from PySide6.QtCore import QObject, Qt
from typing_extensions import override

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import NotAvailable
from cosmic.frame.events import Unsubscribe
from cosmic.frame.plan_shape import DataKeys, Readings, number_key, unix_now_s
from cosmic.frame.plan_signal import PlanSignal
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.callback import CollisionCallbackBase
from cosmic.mico.core.collision.clearance_watch import ClearanceWatch
from cosmic.mico.core.collision.collision_manager import CollisionManager
from cosmic.mico.core.collision.model import SceneModel, pair_of


class Watchable(Protocol):
    """An axis that can be taken out of collision detection."""

    @abstractmethod
    def watch(self, on: bool, *, source: str = "script") -> None:
        """Check its movements for collisions, or no longer."""


class WatchedPlatform(Protocol):
    """What `Mico` declares of collisions, here or at a station."""

    @property
    @abstractmethod
    def away(self) -> str:
        """Why the station cannot be reached; empty while it can, and here."""

    @property
    @abstractmethod
    def taken_out(self) -> tuple[str, ...]:
        """Axes taken out of collision detection."""

    @property
    @abstractmethod
    def allowed_contacts(self) -> tuple[str, ...]:
        """Contacts that are allowed now."""

    @abstractmethod
    def __getitem__(self, name: str) -> Watchable:
        """Return an axis; raises `UnknownAxisError`."""

    @abstractmethod
    def positions(self) -> dict[str, float] | None:
        """Return where every axis is; None while one is not known."""

    @abstractmethod
    def nearest(self, positions: dict[str, float]) -> Approach | None:
        """Return the nearest pair of bodies with the axes at `positions`."""

    @abstractmethod
    def set_contact(self, name: str, *, allowed: bool, source: str = "script") -> None:
        """Let the bodies of an operation touch, or watch them again."""


@checked_class
class Collision:
    """What is watched, what may touch, and how close things are; any thread.

    Parameters
    ----------
    model : CollisionManager or None
        Where it is checked, when that is here.
    source : str
        Who commands through this object, for the log.
    """

    def __init__(
        self,
        platform: WatchedPlatform,
        scene: SceneModel,
        model: CollisionManager | None,
        source: str,
    ) -> None:
        self._platform = platform
        self._scene = scene
        self._model = model
        self._source = source

    @property
    def scene(self) -> SceneModel:
        """The bodies, joints and pairs that are watched."""
        return self._scene

    def clearance(self) -> Approach:
        """Return the nearest pair of watched bodies where they stand now.

        Raises
        ------
        NotAvailable
            The position of some axis is not known, as of all at a station that is away, or no two
            bodies of the scene are watched.
        CosmicError
            The collision model does not answer.
        """
        positions = self._platform.positions()
        if positions is None:
            why = self._platform.away or "the position of every axis has to be known for it"
            raise NotAvailable(f"clearance is not known: {why}")
        nearest = self._platform.nearest(positions)
        if nearest is None:
            raise NotAvailable("no two bodies of the scene are watched")
        return nearest

    # What may touch

    @property
    def contacts(self) -> tuple[str, ...]:
        """Names of the operations during which some bodies may touch."""
        return tuple(each.name for each in self._scene.contacts)

    @property
    def allowed_contacts(self) -> frozenset[str]:
        """Those that are allowed now."""
        return frozenset(self._platform.allowed_contacts)

    @contextmanager
    def contact(self, name: str) -> Iterator[None]:
        """Let the bodies of an operation touch while the block runs.

        Raises
        ------
        NotAvailable
            The scene has no operation of that name.
        """
        if self._model is not None:  # which counts blocks within blocks
            with self._model.contact(name, source=self._source):
                yield
            return
        self._platform.set_contact(name, allowed=True, source=self._source)
        try:
            yield
        finally:
            self._platform.set_contact(name, allowed=False, source=self._source)

    def set_callback(self, one: str, other: str, callback: CollisionCallbackBase | None) -> None:
        """Let two bodies have a response of their own; None takes it back.

        Raises
        ------
        NotAvailable
            The scene has no such bodies, or it is checked at another station: a function cannot
            travel.
        """
        for body in (one, other):
            if body not in self._scene.body_number:
                raise NotAvailable(
                    f"there is no body {body!r}; the scene has {', '.join(self._scene.bodies)}"
                )
        if self._model is None:
            text = f"{one} and {other}: a response of its own can be set at the station only"
            raise NotAvailable(text)
        self._model.set_callback(pair_of(one, other), callback)

    # What is watched (MiCoCL.13)

    @property
    def unwatched(self) -> frozenset[str]:
        """Axes taken out of collision detection."""
        return frozenset(self._platform.taken_out)

    def take_out(self, axis: str) -> None:
        """Let an axis move without being checked for collisions; loud in window and log.

        Raises
        ------
        UnknownAxisError
            There is no such axis.
        """
        self._platform[axis].watch(False, source=self._source)

    def take_in(self, axis: str) -> None:
        """Check the movements of an axis for collisions again."""
        self._platform[axis].watch(True, source=self._source)


class LiveClearance(PlanSignal):
    """``rig.mico.live_clearance``: how far the nearest bodies are apart, as axes move; any thread.

    Bluesky's monitors and suspenders take it. Where it is not known, a suspender is told minus
    infinity, so that it suspends, and a reading is NaN.
    """

    parent: None = None
    name = "clearance_um"

    def __init__(self, watch: ClearanceWatch) -> None:
        self._watch = watch

    @override
    def get(self) -> float:
        """Return the distance in um; minus infinity while it is not known."""
        nearest = self._watch.latest
        return -math.inf if nearest is None else nearest.distance_um

    def read(self) -> Readings:
        """Return the distance as a bluesky reading; NaN while it is not known."""
        nearest = self._watch.latest
        value = math.nan if nearest is None else nearest.distance_um
        return {self.name: {"value": value, "timestamp": unix_now_s()}}

    def describe(self) -> DataKeys:
        """Return what `read` returns, in bluesky's terms."""
        return {self.name: number_key("collision model", "um")}

    @override
    def _on_news(self, listener: Callable[[], object]) -> Unsubscribe:
        direct = Qt.ConnectionType.DirectConnection
        connection = self._watch.changed.connect(lambda _nearest: listener(), direct)

        def unsubscribe() -> None:
            QObject.disconnect(connection)

        return unsubscribe
