"""What MiCo offers to other processes: hosted under the name "mico" on a `Station`."""

from typing import Final

from cosmic.frame.errors import MoveCancelled, NotAvailable, refusal
from cosmic.frame.network.caller import JOG_LIMIT_S, MOVE_LIMIT_S
from cosmic.frame.network.remote import remote
from cosmic.frame.network.station import Station
from cosmic.frame.operation import Task
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.api.application_base import WAY_BUDGET_S
from cosmic.mico.api.group import GroupMovement
from cosmic.mico.api.station_checks import finite, one_line
from cosmic.mico.api.station_orders import Ordered
from cosmic.mico.api.station_settings import SettingsSide
from cosmic.mico.api.station_ways import WaySearch
from cosmic.mico.api.station_words import (
    MicoFacts,
    MicoPicture,
    MicoStatus,
    SentMotion,
)
from cosmic.mico.api.ways import Way
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.motion.orders import Jog, Order, Steer

LONGEST_SEARCH_S: Final = 60.0
"""For how long a client may have a way looked for; other long operations wait for it."""


class MicoStationSide(SettingsSide):
    """Carries out what other processes ask of MiCo, and tells them how it is; any thread.

    What moves, and what changes how things move, needs the lease. A stop, a halt and a question
    need none. Positions are in gate coordinates.
    """

    def on_hosted(self, station: Station) -> None:
        """Tell on this station, and let its lease decide who moves."""
        self._station = station
        self._manager.lease.join(station.lease)
        self._teller.begin(station)

    def close(self) -> None:
        """Tell nothing more; harmless the second time."""
        self._teller.close()

    # What there is

    @remote(reads=True)
    def facts(self) -> MicoFacts:
        """Return what does not change while MiCo runs."""
        manager, settings = self._manager, self._manager.settings
        configured = {each.name for each in settings.positioner}
        others = []
        for name in manager.names():
            if name not in configured:
                found = manager.device(name).container.positioner(manager.address(name).channel)
                if found is not None:
                    others.append(found.settings.model_dump_json())
        return MicoFacts(
            settings=settings.model_dump_json(),
            others=tuple(others),
            platform=self._application.trajectories.platform,
            controller=manager.controller.name,
            simulated=manager.controller.simulated,
            rate=manager.clock.rate,
            checks=self._application.collision is not None,
        )

    @remote(reads=True)
    def scene(self) -> SceneModel:
        """Return what is watched for collisions, and what it looks like."""
        return self._model().model

    @remote(reads=True)
    def picture(self) -> MicoPicture:
        """Return everything that a window begins with."""
        return self._teller.picture()

    @remote
    def check(self, motions: dict[str, SentMotion], consent: bool = False) -> MoveVerdict:
        """Return the gate's answer, without moving."""
        return self._manager.check(motions, consent=consent)

    @remote(reads=True)
    def nearest(self, positions: dict[str, float]) -> Approach | None:
        """Return the nearest pair of bodies with the axes at `positions`."""
        return self._model().nearest(positions)

    # Moving

    @remote(moves=True)
    def order(
        self,
        axis: str,
        number: int,
        motion: SentMotion,
        consent: bool = False,
        follows: int = 0,
        source: str = "",
    ) -> Ordered:
        """Have an axis make a motion; a refusal is how it ends."""
        return self._order(axis, number, motion, consent=consent, follows=follows, source=source)

    @remote(moves=True, limit_s=JOG_LIMIT_S)
    def jog(
        self, axis: str, number: int, motion: Jog | Steer, consent: bool = False, source: str = ""
    ) -> Ordered:
        """Begin to move on and on, while `renew` or `steer` comes."""
        if isinstance(motion, Steer) and not 0.0 < motion.dead_man_s <= MOVE_LIMIT_S:
            text = (
                f"{axis}: a dead-man time is at most {MOVE_LIMIT_S:g} s, not {motion.dead_man_s:g}"
            )
            raise refusal(refuse(Reason.LIMIT, text, axis=axis, limit=MOVE_LIMIT_S, unit="s"))
        return self._order(axis, number, motion, consent=consent, source=source)

    @remote(moves=True, at_once=True, limit_s=JOG_LIMIT_S)
    def renew(self, axis: str, number: int) -> None:
        """Keep a jog alive."""
        order = self._orders.find(self._key(number))
        if order is not None:
            self._manager.device(axis).renew_jog(order)

    @remote(moves=True, at_once=True, limit_s=JOG_LIMIT_S)
    def steer(self, axis: str, number: int, velocity: float) -> None:
        """Keep a steered movement alive at another speed."""
        order = self._orders.find(self._key(number))
        if order is not None:
            self._manager.device(axis).steer_jog(order, finite(velocity, f"{axis}: a speed"))

    def _order(
        self,
        axis: str,
        number: int,
        motion: SentMotion | Jog,
        *,
        consent: bool,
        source: str,
        follows: int = 0,
    ) -> Ordered:
        manager, key = self._manager, self._key(number)
        before = self._orders.newest((key[0], follows), axis) if follows else None
        order = Order(
            manager.address(axis).channel,
            motion,
            manager.lease.local_token,
            self._source(source),
            consent,
            follows=before.movement if before is not None else None,
            guard=manager.lease.guard(),
        )
        self._orders.keep(key, axis, order)
        self._log(f"{axis}: {motion}", source)
        manager.device(axis).submit(order)
        return Ordered(GroupMovement({axis: order.movement}), self._teller)

    @remote(moves=True)
    def order_together(
        self,
        motions: dict[str, SentMotion],
        numbers: dict[str, int],
        consent: bool = False,
        linked: bool = True,
        match_arrival: bool = False,
        follows: dict[str, int] | None = None,
        source: str = "",
    ) -> Ordered:
        """Decide several movements together and start them back to back, or none of them."""
        token = self._key(0)[0]
        before = {
            axis: self._orders.newest((token, number), axis).movement
            for axis, number in (follows or {}).items()
        }
        self._log(f"{motions}", source)
        orders = self._manager.order_together(
            motions,
            source=self._source(source),
            consent=consent,
            linked=linked,
            match_arrival=match_arrival,
            follows=before if follows else None,
        )
        group = GroupMovement.of(orders)
        for axis, order in orders.items():
            try:
                self._orders.keep((token, numbers.get(axis, 0)), axis, order)
            except MoveCancelled:
                group.cancel()
        return Ordered(group, self._teller)

    @remote(moves=True)
    def undo(self, number: int, numbers: dict[str, int]) -> Ordered:
        """Take back the movement with that number in the history."""
        history = self._application.undo
        entry = next((each for each in history.entries if each.number == number), None)
        if entry is None:
            raise NotAvailable("there is nothing to undo any more: something moved since")
        newest = history.newest(entry.group)
        if newest.number != number:
            raise NotAvailable(f"{entry.group} has moved since; look again what undo takes back")
        self._log(f"undo of {', '.join(entry.before)}", "")
        orders = history.order(entry)
        for axis, order in orders.items():
            self._orders.keep(self._key(numbers.get(axis, 0)), axis, order)
        group = GroupMovement.of(orders)
        group.add_callback(lambda ended: history.drop(entry) if ended.success else None)
        return Ordered(group, self._teller)

    # Stopping

    @remote(at_once=True)
    def stop(self, reason: str = "stop") -> MicoStatus:
        """Stop every axis and stay stopped; anybody may."""
        self._manager.stop(f"{one_line(reason)} (from {self._who()})")
        return self._teller.status()

    @remote(at_once=True)
    def halt(self, axis: str, up_to: int = 0, why: str = "stopped") -> None:
        """Stop one axis past every queue; anybody may."""
        self._orders.void(self._key(0)[0], axis, up_to)
        self._manager.device(axis).halt(self._manager.address(axis).channel, one_line(why))

    @remote(at_once=True)
    def withdraw(self, numbers: list[int]) -> None:
        """Give up some of one's own orders, begun or not."""
        for number in numbers:
            order = self._orders.withdraw(self._key(number))
            if order is not None:
                order.movement.cancel()

    @remote(moves=True)
    def reset_stop(self) -> MicoStatus:
        """Allow motion again; the holder of the lease may, and the station's own operator."""
        self._log("reset of the stop", "")
        self._manager.reset_stop()
        return self._teller.status()

    # What takes long

    @remote(moves=True)
    def rescan(self) -> Task:
        """Look again for the hardware."""
        self._log("rescan", "")
        return self._application.rescan()

    @remote
    def find_way(self, targets: dict[str, float], budget_s: float = WAY_BUDGET_S) -> WaySearch:
        """Look for a way round what is in between, for at most a minute."""
        if not 0.0 < budget_s <= LONGEST_SEARCH_S:
            raise NotAvailable(f"a way is looked for during at most {LONGEST_SEARCH_S:g} s")
        return WaySearch(self._application, targets, budget_s)

    @remote(moves=True)
    def follow_way(self, way: Way) -> Task:
        """Go a way that was found."""
        self._log(f"a way of {len(way.waypoints)} parts", "")
        return self._application.follow_way(way, self._source(""))
