"""The station is in this process: a direct call, no socket, no copy."""

import secrets
from collections.abc import Callable, Mapping
from threading import Lock

from typing_extensions import override

from cosmic.frame.network.caller import Access, Caller
from cosmic.frame.network.errors import CommandExpired, StationAway
from cosmic.frame.network.station import Station
from cosmic.frame.network.transport import (
    CALL_TIMEOUT_S,
    Presence,
    PresenceListener,
    Receiver,
    Rule,
    Subscription,
    Transport,
)


class InProcessTransport(Transport):
    """The default where everything runs in one process.

    Arguments and results are handed on as they are; they are checked as they would be from
    elsewhere, and exceptions are the same.

    Parameters
    ----------
    name : str or None
        None is the station's own operator, who holds the lease while nobody else does; any other
        has to take it.
    """

    def __init__(
        self, station: Station, name: str | None = None, access: Access = Access.MOVE
    ) -> None:
        self._station = station
        lease = station.lease
        self._caller = (
            Caller(
                lease.state.holder if lease.state.local else station.name,
                lease.local_token,
                access,
                local=True,
            )
            if name is None
            else Caller(name, secrets.token_hex(16), access, local=True)
        )
        self._lock = Lock()
        self._subscriptions: list[Subscription] = []
        self._listeners: tuple[PresenceListener, ...] = ()
        self._closed = False

    @override
    def call(
        self,
        application: str,
        function: str,
        arguments: Mapping[str, object] | None = None,
        *,
        timeout_s: float = CALL_TIMEOUT_S,
    ) -> object:
        self._check_open()
        clock = self._station.clock
        until_s = clock.now_s() + timeout_s

        def still_wanted() -> None:
            if not clock.now_s() <= until_s:
                raise CommandExpired(
                    f"{application}.{function} had to wait longer than {timeout_s:g} s "
                    "for other calls and was not carried out"
                )

        invoker = self._station.invoker(application)
        return invoker.invoke(
            self._caller, function, arguments or {}, still_wanted, wait_s=timeout_s
        )

    @override
    def publish(self, topic: str, payload: object) -> None:
        self._check_open()
        self._station.publish_shared(self._caller.name, topic, payload)

    @override
    def subscribe(self, topic: str, rule: Rule, receiver: Receiver) -> Subscription:
        self._check_open()
        made = self._station.bus.subscribe(topic, rule, receiver)
        with self._lock:
            self._subscriptions.append(made)
        return made

    @override
    def presence(self, listener: PresenceListener) -> Callable[[], None]:
        with self._lock:
            self._listeners = (*self._listeners, listener)
        listener(self._presence())

        def remove() -> None:
            with self._lock:
                self._listeners = tuple(each for each in self._listeners if each is not listener)

        return remove

    @override
    def take_lease(self) -> None:
        self._check_open()
        if self._caller.token == self._station.lease.local_token:
            self._station.lease.take_over()
        else:
            self._station.lease.take(self._caller.name, self._caller.token, in_process=True)

    @override
    def release_lease(self) -> None:
        if self._caller.token == self._station.lease.local_token:
            self._station.lease.offer()
        else:
            self._station.lease.release(self._caller.token)

    @override
    def close(self) -> None:
        with self._lock:
            if self._closed:
                return
            self._closed = True
            subscriptions, self._subscriptions = self._subscriptions, []
        self._station.lease.release(self._caller.token, f"{self._caller.name} has closed")
        for each in subscriptions:
            each.close()
        for listener in self._listeners:
            listener(self._presence())

    def _presence(self) -> Presence:
        why = "the connection is closed" if self._closed else ""
        return Presence(self._station.name, here=not self._closed, why=why)

    def _check_open(self) -> None:
        if self._closed:
            raise StationAway(f"{self._station.name}: the connection is closed")
