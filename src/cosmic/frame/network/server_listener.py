"""Lets clients in and notices when they are gone (thesis 5.2.1, Fig. 5.6)."""

import logging
import secrets
from collections.abc import Callable, Mapping
from threading import Event, Lock
from typing import Final

from typing_extensions import override

from cosmic.frame.errors import CosmicError, ProtocolError
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.log_folding import flush_folded
from cosmic.frame.network.addresses import (
    asks,
    client_liveliness,
    client_of,
    greetings,
    session_events,
)
from cosmic.frame.network.caller import Access
from cosmic.frame.network.connection_handler import Client, ConnectionHandler
from cosmic.frame.network.delivery import Backlog, InboxReader
from cosmic.frame.network.direct_line import FramedSocket
from cosmic.frame.network.direct_listener import DirectListener
from cosmic.frame.network.errors import CallRefused
from cosmic.frame.network.messages import Order, read_request, refusal_of
from cosmic.frame.network.outbox import Outbox
from cosmic.frame.network.refusals import Refusals
from cosmic.frame.network.station import Station, checked_name
from cosmic.frame.network.transport import Presence, Rule
from cosmic.frame.network.wire import Question, Wire, WithLine
from cosmic.frame.threads import WorkerThread

logger = logging.getLogger(__name__)

LOOK_EVERY_S: Final = 0.05
SILENCE_LIMIT_S: Final = 5.0
"""A session of which nothing was heard for so long has ended, whatever its heartbeat says."""
CLIENTS_LIMIT: Final = 32
OF_ONE_NAME: Final = 16
"""One client alone cannot keep all others out."""
_JOBS_LIMIT: Final = 1024


class ServerListener(WorkerThread):
    """Makes a `ConnectionHandler` for each client of a station.

    Start it, and call `shut_down` in a ``finally``: a wire that stays open goes on answering.

    Parameters
    ----------
    wire : Wire
        Becomes the listener's own; closed with it.
    access : mapping or callable
        What a client of a name may do; a name that is missing may do nothing. With certificates
        the name is proven.
    """

    def __init__(
        self,
        station: Station,
        wire: Wire,
        access: Callable[[str], Access | None] | Mapping[str, Access] = lambda _: Access.MOVE,
    ) -> None:
        super().__init__(f"{station.name} listens", station.policy)
        self._station = station
        self._wire = wire
        self._access = access.get if isinstance(access, Mapping) else access
        self._outbox = Outbox(station.name, secrets.token_hex(8), wire, station.policy)
        self._lock = Lock()
        self._handlers: dict[str, ConnectionHandler] = {}
        self._gone: Backlog[str] = Backlog(Rule.ALL)
        self._calls: dict[str, JobQueue] = {}
        self._refusals = Refusals(station.clock)
        self._woken = Event()
        self._remove: list[Callable[[], None]] = []
        self._readers: list[WorkerThread] = []
        self._direct: DirectListener | None = None
        self._leaving: list[ConnectionHandler] = []
        self._shut = False

    @property
    def clients(self) -> list[str]:
        """The clients that are here: name, slash, number."""
        with self._lock:
            return list(self._handlers)

    @override
    def run_body(self) -> None:
        name, policy = self._station.name, self._station.policy
        self._direct = self._made_direct()
        questions = InboxReader(
            f"{name} hears", policy, self._wire.questions(greetings(name)), self._greet
        )
        watched = InboxReader(
            f"{name} watches",
            policy,
            self._wire.watch_liveliness(client_liveliness(name)),
            self._on_liveliness,
        )
        self._readers = [questions, watched, *([self._direct] if self._direct else [])]
        self._remove = [
            self._station.bus.tap(self._outbox.publish, self._outbox.wants),
            self._station.lease.subscribe(lambda _: self._end_motion_without_lease()),
        ]
        for reader in self._readers:
            reader.start()
        try:
            while not self.end_requested:
                self._woken.wait(LOOK_EVERY_S)
                self._woken.clear()
                self._look()
        finally:
            self._end_all()

    @override
    def request_end(self) -> None:
        super().request_end()
        self._woken.set()

    def shut_down(self) -> None:
        """Tell every client that the station is gone, end every thread and close the wire."""
        self.request_end()
        self.join()
        with self._lock:
            shut, self._shut = self._shut, True
        if not shut:
            self._end_all()
            self._outbox.close()
            self._wire.close()

    def _end_all(self) -> None:
        for remove in self._remove:
            remove()
        for reader in self._readers:
            reader.request_end()
        for reader in self._readers:
            reader.join()
        for key in self.clients:
            self._end(key, "the station closes")
        for handler in self._leaving:
            handler.join_direct()
        with self._lock:
            queues, self._calls = list(self._calls.values()), {}
        for calls in queues:
            calls.request_end()
        for calls in queues:
            calls.join()
        self._remove, self._readers = [], []

    # Greetings, in the thread "hears"

    def _greet(self, question: Question) -> None:
        key = client_of(question.key)
        try:
            self._let_in(key, question)
        except CosmicError as exc:
            logger.warning("%s refused %.80r: %s", self._station.name, key, exc)
            message = refusal_of(self._station.clock.now_s(), exc)
            self._refusals.answer(key.partition("/")[0], question, message)

    def _let_in(self, key: str, question: Question) -> None:
        if read_request(question.message).order is not Order.HELLO:
            raise ProtocolError("a client has to greet first")
        name, _, number = key.partition("/")
        try:  # also that no session hears what others ask: an address may stand for many
            checked_name(name)
            checked_name(number)
        except ValueError as exc:
            raise ProtocolError(f"a client without a name and a number of its own: {exc}") from exc
        access = self._access(name)
        if access is None:
            raise CallRefused(f"{name} is not on the list of those who may connect")
        with self._lock:
            if key in self._handlers:
                raise CallRefused("this session is here already")
            if len(self._handlers) >= CLIENTS_LIMIT or self.end_requested:
                raise CallRefused(f"{CLIENTS_LIMIT} clients are here already")
            if sum(each.client.name == name for each in self._handlers.values()) >= OF_ONE_NAME:
                raise CallRefused(f"{name} is here {OF_ONE_NAME} times already")
            handler = self._handlers[key] = self._made_handler(Client(key, name, access))
        handler.start()
        self._station.note_client(key, Presence(name, here=True))
        handler.greet(question, self._direct.port if self._direct is not None else 0)

    def _made_handler(self, client: Client) -> ConnectionHandler:
        name = self._station.name
        return ConnectionHandler(
            client,
            self._station,
            self._wire.questions(asks(name, client.key)),
            self._outbox,
            self._wire.outlet(session_events(name, client.key), Rule.ALL),
            self._run_in,
        )

    # Direct lines, in the thread "connects"

    def _made_direct(self) -> DirectListener | None:
        if not isinstance(self._wire, WithLine):
            return None
        name = f"{self._station.name} connects"
        try:
            return DirectListener(name, self._wire.line, self._station.policy, self._attach)
        except OSError as exc:
            logger.warning("%s: calls use the slower connection: %s", self._station.name, exc)
            return None

    def _attach(
        self, key: str, token: str, proven: str | None, urgent: bool, framed: FramedSocket
    ) -> None:
        with self._lock:
            handler = self._handlers.get(key)
        if handler is None:
            raise CallRefused("the session is unknown: connect again")

        def lost() -> None:
            if urgent:  # its process has ended, or a line was cut: the session may go on
                handler.lose_motion(f"the line to {handler.client.name} was lost")

        handler.attach(token, proven, framed, lost)

    def _run_in(self, application: str, job: Callable[[], None]) -> None:
        with self._lock:
            if self.end_requested:
                raise CallRefused("the station closes")
            if application not in self._calls:
                name = f"{self._station.name} calls {application}"
                self._calls[application] = JobQueue(name, self._station.policy)
            calls = self._calls[application]
        if calls.waiting >= _JOBS_LIMIT:
            raise CallRefused(f"too many calls wait for {application} already")
        calls.submit(job, f"a call of {application}")

    # Signs of life, in the thread "watches"

    def _on_liveliness(self, liveliness: tuple[str, bool]) -> None:
        key, here = liveliness
        if here:
            return
        client = client_of(key)
        handler = self._handlers.get(client)
        if handler is not None:
            handler.lose_motion(f"{handler.client.name} is gone")  # at once, in this thread
            self._gone.put(client)
            self._woken.set()

    # Housekeeping, in the listener's own thread

    def _look(self) -> None:
        flush_folded()  # of a flood that has ended nobody else may tell for long
        self._station.lease.poll()
        self._refusals.answer_due()
        while len(self._gone):
            self._end(self._gone.take(), "its heartbeat has stopped")
        self._leaving = [each for each in self._leaving if not each.ended]
        with self._lock:
            silent = [
                key for key, each in self._handlers.items() if each.silent_s > SILENCE_LIMIT_S
            ]
        for key in silent:
            self._end(key, f"silent for {SILENCE_LIMIT_S:g} s")

    def _end(self, key: str, why: str) -> None:
        with self._lock:
            handler = self._handlers.pop(key, None)
        if handler is not None:
            handler.close(why)
            self._leaving.append(handler)
            self._station.note_client(key, Presence(handler.client.name, here=False, why=why))

    def _end_motion_without_lease(self) -> None:
        with self._lock:
            handlers = list(self._handlers.values())
        for each in handlers:
            each.check_motion()
