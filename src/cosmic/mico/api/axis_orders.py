"""What one axis is ordered to do, where its device is."""

from collections import OrderedDict
from threading import Lock
from typing import Final

from cosmic.frame.errors import CosmicError, MoveCancelled
from cosmic.frame.network.caller import caller_token, current_call, source_of
from cosmic.mico.api.axis_numbers import finite
from cosmic.mico.api.group_movement import GroupMovement, LinkedMovement
from cosmic.mico.core.motion.device_commander import DeviceCommander
from cosmic.mico.core.motion.manager import DeviceManager
from cosmic.mico.core.motion.messages import Order
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import Motion, MoveBy, MoveTo

_KEPT: Final = 512


class AxisOrders:
    """Gives the orders of one axis to its device, and knows those of other stations by key.

    A station names an order by a key of its own, so that it can renew a jog, or have a movement
    follow another one, before any answer has come back. Any thread.
    """

    def __init__(self, name: str, manager: DeviceManager, commander: DeviceCommander) -> None:
        self._name = name
        self._manager = manager
        self._channel = manager.address(name).channel
        self._commander = commander
        self._lock = Lock()
        self._kept: OrderedDict[tuple[str, str], Order | Movement] = OrderedDict()

    def begin(
        self,
        motion: Motion,
        *,
        consent: bool,
        follows: Movement | None = None,
        alone: bool = False,
        source: str = "",
    ) -> Movement:
        """Begin a motion in gate coordinates, with the axes linked to it unless `alone`."""
        linked = isinstance(motion, MoveTo | MoveBy) and self._manager.links.companions(self._name)
        if linked and not alone:
            return self._begin_linked(motion, consent=consent, follows=follows, source=source)
        return self.give(motion, consent=consent, follows=follows, source=source).movement

    def _begin_linked(
        self, motion: Motion, *, consent: bool, follows: Movement | None, source: str
    ) -> LinkedMovement:
        """Move this axis and those linked to it; a refusal fails the movement."""
        whole = LinkedMovement(self._name)
        before = follows.parts if isinstance(follows, LinkedMovement) else None
        try:
            orders = self._manager.groups.order_together(
                {self._name: motion},
                source=source_of(source or self._commander.source),
                consent=consent,
                follows=before,
            )
        except CosmicError as exc:
            whole.fail(exc)
            return whole
        whole.begin(GroupMovement.of(orders))
        return whole

    def give(
        self,
        motion: Motion,
        *,
        consent: bool,
        follows: Movement | None = None,
        source: str = "",
    ) -> Order:
        """Have this axis alone do something, whoever's call it is, and return the order."""
        if current_call() is None:
            return self._commander.order(
                self._channel, motion, consent=consent, follows=follows, source=source
            )
        order = Order(
            self._channel,
            motion,
            self._manager.lease.local_token,
            source_of(source),
            consent,
            follows=follows,
            guard=self._manager.lease.guard(),
        )
        self._manager.device(self._name).submit(order)
        return order

    def renew(self, order: Order, velocity: float | None = None) -> None:
        """Keep a jog alive; one that is steered at another signed velocity."""
        if velocity is None:
            self._commander.renew_jog(order)
        else:
            self._commander.steer_on(order, finite(velocity, f"{self._name}: a speed"))

    # By key

    def keep(self, key: str, order: Order | Movement) -> None:
        """Remember an order under the key that its caller gave it."""
        with self._lock:
            self._kept[caller_token(), key] = order
            while len(self._kept) > _KEPT:
                self._kept.popitem(last=False)

    def kept_jog(self, key: str) -> Order | None:
        """Return a jog; None where it was forgotten, or never came."""
        found = self._kept.get((caller_token(), key))
        return found if isinstance(found, Order) else None

    def kept_movement(self, key: str) -> Movement:
        """Return a movement that another one follows.

        Raises
        ------
        MoveCancelled
            It was forgotten long ago: something else came since.
        """
        found = self._kept.get((caller_token(), key))
        if found is None:
            raise MoveCancelled("a newer command came first")
        return found.movement if isinstance(found, Order) else found
