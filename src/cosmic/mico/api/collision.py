"""The collision model as scripts and windows see it: ``rig.mico.collision``."""

from contextlib import AbstractContextManager

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import NotAvailable
from cosmic.mico.api.ports import CollisionPort
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.callback import CollisionCallbackBase
from cosmic.mico.core.collision.model import BodyPair, SceneModel, pair_of
from cosmic.mico.core.ports import ManagerPort


@checked_class
class Collision:
    """What is watched, what may touch, and how close things are; any thread.

    Parameters
    ----------
    source : str
        Who commands through this object, for the log.
    """

    def __init__(self, manager: ManagerPort, model: CollisionPort, source: str) -> None:
        self._manager = manager
        self._model = model
        self._source = source

    @property
    def scene(self) -> SceneModel:
        """The bodies, joints and pairs that are watched.

        Raises
        ------
        NotAvailable
            The platform is at another station, and its scene is not known here.
        """
        scene = self._model.model
        if scene is None:
            raise NotAvailable("the scene is not known in this process; ask at its station")
        return scene

    def clearance(self) -> Approach:
        """Return the nearest pair of watched bodies where they stand now.

        Raises
        ------
        NotAvailable
            The position of some axis is not known, or no two bodies of the scene are watched.
        CosmicError
            The collision model does not answer.
        """
        positions = self._manager.positions()
        if positions is None:
            raise NotAvailable("clearance is not known before every axis is referenced")
        nearest = self._model.nearest(positions)
        if nearest is None:
            raise NotAvailable("no two bodies of the scene are watched")
        return nearest

    # What may touch

    @property
    def contacts(self) -> tuple[str, ...]:
        """Names of the operations during which some bodies may touch."""
        return tuple(each.name for each in self.scene.contacts)

    @property
    def allowed_contacts(self) -> frozenset[str]:
        """Those that are allowed now."""
        return self._model.allowed_contacts

    def contact(self, name: str) -> AbstractContextManager[None]:
        """Let the bodies of an operation touch while the block runs.

        Raises
        ------
        NotAvailable
            The scene has no operation of that name.
        """
        return self._model.contact(name)

    def set_callback(self, one: str, other: str, callback: CollisionCallbackBase | None) -> None:
        """Let two bodies have a response of their own; None takes it back.

        Raises
        ------
        NotAvailable
            The scene has no such bodies.
        """
        for body in (one, other):
            if body not in self.scene.body_number:
                raise NotAvailable(
                    f"there is no body {body!r}; the scene has {', '.join(self.scene.bodies)}"
                )
        pair: BodyPair = pair_of(one, other)
        self._model.set_callback(pair, callback)

    # What is watched (MiCoCL.13)

    @property
    def unwatched(self) -> frozenset[str]:
        """Axes taken out of collision detection."""
        return self._model.taken_out

    def take_out(self, axis: str) -> None:
        """Let an axis move without being checked for collisions; loud in window and log.

        Raises
        ------
        UnknownAxisError
            There is no such axis.
        """
        self._model.take_out(axis, source=self._source)

    def take_in(self, axis: str) -> None:
        """Check the movements of an axis for collisions again."""
        self._model.take_in(axis, source=self._source)
