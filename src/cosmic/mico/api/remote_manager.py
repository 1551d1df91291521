"""The axes of a station, with the face of a `DeviceManager`."""

import logging
from collections.abc import Callable, Mapping
from functools import partial

from typing_extensions import override

from cosmic.frame.errors import (
    CosmicError,
    MoveRefused,
)
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.api.remote_axes import RemoteAxes
from cosmic.mico.api.remote_device import follow
from cosmic.mico.api.remote_foresight import foreseen
from cosmic.mico.api.remote_line import may_wait_here
from cosmic.mico.core.motion.group_start import GroupStart
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.orders import Motion, MoveTo, Order
from cosmic.mico.core.motion.undo import UndoEntry

logger = logging.getLogger(__name__)


class KnownStart(GroupStart):
    """The common start of axes at a station, which tells how it went."""

    def __init__(self, count: int) -> None:
        super().__init__(count, lambda _started: None)

    def note(self, skew_ms: float | None) -> None:
        """Take what was told."""
        self._skew_ms = skew_ms


class RemoteManager(RemoteAxes):
    """Sends what is commanded to the station whose axes it shows; any thread."""

    def check(self, motions: Mapping[str, Motion], *, consent: bool = False) -> MoveVerdict:
        """Return what the gate of the station says, without moving anything.

        Where this thread must not wait (a window), return what can be said without collisions;
        the gate of the station decides each movement in any case.
        """
        for name in motions:
            self.address(name)
        if not may_wait_here():
            return foreseen(motions, self, consent=consent)
        try:
            said = self._line.call("check", {"motions": dict(motions), "consent": consent})
        except MoveRefused as exc:
            return exc.verdict
        except CosmicError as exc:
            return refuse(Reason.NO_ANSWER, f"the station does not answer: {exc}")
        if not isinstance(said, MoveVerdict):
            return refuse(Reason.NO_ANSWER, f"the station answers {said!r:.80}")
        return said

    def order_together(
        self,
        motions: Mapping[str, Motion],
        *,
        source: str,
        consent: bool = False,
        linked: bool = True,
        match_arrival: bool = False,
        follows: Mapping[str, Movement] | None = None,
    ) -> dict[str, Order]:
        """Have `motions` decided together and started back to back, or none of them.

        Where this thread must not wait, a refusal is how the movements end; otherwise raises as
        `DeviceManager.order_together`.
        """
        names = dict(motions)
        for name in motions:
            self.address(name)
        if linked:
            for name, motion in motions.items():
                for other in self.links.companions(name):
                    names.setdefault(other, motion)
        arguments: dict[str, object] = {
            "motions": dict(motions),
            "consent": consent,
            "linked": linked,
            "match_arrival": match_arrival,
            "source": source,
        }
        if follows is not None:
            arguments["follows"] = {
                name: self._line.number_of(each) for name, each in follows.items()
            }
        return self._together("order_together", names, arguments, source=source)

    @override
    def _order_undo(self, entry: UndoEntry) -> dict[str, Order]:
        motions = {
            name: MoveTo(where, self.state(name).unit) for name, where in entry.before.items()
        }
        return self._together("undo", motions, {"number": entry.number}, source="undo")

    def _together(
        self,
        function: str,
        motions: Mapping[str, Motion],
        arguments: dict[str, object],
        *,
        source: str,
    ) -> dict[str, Order]:
        start = KnownStart(len(motions)) if len(motions) > 1 else None
        orders = {
            name: Order(self.address(name).channel, motion, "", source, start=start)
            for name, motion in motions.items()
        }
        for order in orders.values():
            self._line.note_number(order.movement, order.number)
            order.movement.on_cancel(partial(self._line.withdraw, order.number))
        arguments["numbers"] = {name: order.number for name, order in orders.items()}

        def send() -> None:
            ongoing = self._line.call(function, arguments)
            follow(orders, ongoing, self.take_event, start.note if start is not None else None)

        if may_wait_here():
            try:
                self._line.run(send)
            except MoveRefused as exc:
                self.group_refused.emit(exc.verdict)
                raise
        else:
            self._line.post(lambda: self._send_or_fail(send, orders))
        return orders

    def _send_or_fail(self, send: Callable[[], None], orders: Mapping[str, Order]) -> None:
        try:
            send()
        except CosmicError as exc:
            for order in orders.values():
                order.movement.fail(exc)
            if isinstance(exc, MoveRefused):
                self.group_refused.emit(exc.verdict)

    def stop(self, reason: str = "stop") -> None:
        """Stop every axis of the station, past every queue; needs no lease.

        Raises
        ------
        StationAway, StationTimeout
            It did not get there; in a thread that must not wait, the policy is told instead.
        """
        self._line.at_once("stop", {"reason": reason})
        logger.warning("stop: %s", reason)

    def reset_stop(self) -> None:
        """Allow motion again; only the holder of the lease may, and the station's operator."""
        self._line.do("reset_stop", {})
