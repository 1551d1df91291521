"""One client of a station: its session, its commands, what it has set in motion."""

import logging
import secrets
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from threading import Lock
from typing import Final

from typing_extensions import override

from cosmic.frame.errors import CosmicError, ProtocolError
from cosmic.frame.network.caller import Access, Caller
from cosmic.frame.network.codec import CALL_LIMIT_BYTES
from cosmic.frame.network.delivery import Inbox, InboxClosed
from cosmic.frame.network.direct_line import FramedSocket, LineLost
from cosmic.frame.network.errors import Busy, CallRefused
from cosmic.frame.network.freshness import SequenceGuard, check_age
from cosmic.frame.network.invoker import FOR_EVER
from cosmic.frame.network.messages import Order, Request, answer, read_request, refusal_of
from cosmic.frame.network.ongoing import Tickets
from cosmic.frame.network.outbox import Outbox
from cosmic.frame.network.station import Station
from cosmic.frame.network.wire import Outlet, Question
from cosmic.frame.threads import WorkerThread

logger = logging.getLogger(__name__)

DIRECT_LINES: Final = 8
"""The most that one client may have."""

Route = Callable[[str, Callable[[], None]], None]


@dataclass(frozen=True, slots=True)
class Client:
    """Who connects.

    Attributes
    ----------
    key : str
        Its name, a slash and its number: its address.
    name : str
        What log and windows show; with certificates it is the one of its certificate.
    access : Access
        What it may do.
    """

    key: str
    name: str
    access: Access


class ConnectionHandler(WorkerThread):
    """Serves one client in a thread of its own (thesis Fig. 5.6, 5.7).

    It checks what comes, carries out what must not wait (a stop, heartbeats), and hands every
    other call to the thread of the application concerned.

    Parameters
    ----------
    questions : Inbox
        What this client asks.
    outlet : Outlet
        Where this client alone hears how its tasks go on.
    route : callable
        `route(application, job)` has the job carried out in the application's thread.
    """

    def __init__(
        self,
        client: Client,
        station: Station,
        questions: Inbox[Question],
        outbox: Outbox,
        outlet: Outlet,
        route: Route,
    ) -> None:
        super().__init__(f"{station.name} serves {client.name}", station.policy)
        self._client = client
        self._station = station
        self._route = route
        self._outlet = outlet
        self._caller = Caller(client.name, secrets.token_hex(16), client.access)
        self._questions = questions
        self._tickets = Tickets(lambda event: outbox.send(outlet, event))
        self._guard = SequenceGuard()
        self._heard_s = station.clock.now_s()
        self._lock = Lock()
        self._direct: list[DirectReader] = []
        self._closed = False

    @property
    def client(self) -> Client:
        """Whom it serves."""
        return self._client

    @property
    def token(self) -> str:
        """Token of the session."""
        return self._caller.token

    @property
    def silent_s(self) -> float:
        """How long nothing has come from the client."""
        return self._station.clock.now_s() - self._heard_s

    def lose_motion(self, why: str) -> None:
        """End what the client moves and take the lease from it; any thread."""
        self._station.lease.release(self._caller.token, why)
        self._tickets.cancel_motion()

    def check_motion(self) -> None:
        """End what the client moves, if the lease is not its own any more; any thread."""
        if not self._station.lease.holds(self._caller.token):
            self._tickets.cancel_motion()

    @override
    def run_body(self) -> None:
        while not self.end_requested:
            try:
                question = self._questions.take()
            except InboxClosed:
                return
            self._serve(question, self._route)

    def attach(
        self, token: str, proven: str | None, framed: FramedSocket, on_lost: Callable[[], None]
    ) -> None:
        """Serve a direct line of this client in a thread of its own; any thread.

        Parameters
        ----------
        proven : str or None
            The name of the certificate; None without certificates.
        on_lost : callable
            Called when the line has ended, in its thread.

        Raises
        ------
        CallRefused
            It is not this client's, or it has too many.
        """
        known = secrets.compare_digest(token.encode(), self._caller.token.encode())
        if not known or proven not in (None, self._client.name):
            raise CallRefused("the session is unknown: connect again")
        framed.set_limit(CALL_LIMIT_BYTES)
        name = f"{self._station.name} answers {self._client.name}"
        with self._lock:
            self._direct = [each for each in self._direct if not each.isFinished()]
            if self._closed or len(self._direct) >= DIRECT_LINES:
                raise CallRefused(f"{self._client.name} has {DIRECT_LINES} direct lines already")
            made = DirectReader(name, self._station, framed, self._serve_here, on_lost)
            self._direct.append(made)
            made.start()

    @override
    def request_end(self) -> None:
        super().request_end()
        self._questions.close()

    def close(self, why: str) -> None:
        """End the session; what the client moves stops first. A call in progress goes on."""
        self.lose_motion(why)
        self.request_end()
        with self._lock:
            self._closed = True
            direct = list(self._direct)
        for each in direct:
            each.request_end()
        self.join()
        self._outlet.close()
        logger.info("%s: %s is gone (%s)", self._station.name, self._client.key, why)

    @property
    def ended(self) -> bool:
        """True when no thread of the session runs any more."""
        return not any(each.isRunning() for each in self._direct)

    def join_direct(self) -> None:
        """Wait for calls in progress; after `close`."""
        for each in self._direct:
            each.join()

    def greet(self, question: Question, direct_port: int = 0) -> None:
        """Answer the first message of the session; `direct_port` is where direct lines go."""
        hosted = {
            name: {
                each.name: [each.mark.moves, each.mark.at_once] for each in invoker.offered.values()
            }
            for name, invoker in self._station.invokers.items()
        }
        welcome = {"token": self._caller.token, "hosted": hosted, "direct": direct_port}
        self._answer(question, welcome)
        logger.info("%s: %s is here", self._station.name, self._client.key)

    def _serve_here(self, question: Question) -> None:
        """Serve a question of a direct line, whose thread may wait: its caller waits as well."""
        self._serve(question, lambda _, job: job())

    def _serve(self, question: Question, route: Route) -> None:
        try:
            self._carry_out(question, route)
        except CosmicError as exc:
            logger.warning("%s refused %s: %s", self._station.name, self._client.name, exc)
            self._refuse(question, exc)

    def _carry_out(self, question: Question, route: Route) -> None:
        request = read_request(question.message)
        if not secrets.compare_digest(request.token.encode(), self._caller.token.encode()):
            raise CallRefused("the session is unknown: connect again")
        self._guard.check(request.number)
        self._note_life(request)
        if request.order is Order.CALL:
            self._call(question, request, route)
        else:
            self._answer(question, self._other(request))

    def _note_life(self, request: Request) -> None:
        now_s = self._station.clock.now_s()
        if request.sent_s <= now_s:
            self._heard_s = max(self._heard_s, request.sent_s)
            self._station.lease.beat(self._caller.token, request.sent_s)

    def _other(self, request: Request) -> object:
        name, lease = self._client.name, self._station.lease
        if request.order is Order.BEAT:
            return lease.holds(self._caller.token)
        if request.order is Order.CANCEL:
            self._tickets.cancel(request.function)
        elif request.order is Order.RELEASE:
            self._tickets.cancel_motion()
            lease.release(self._caller.token)
        elif request.order is Order.TAKE:
            check_age(self._station.clock, request.until_s, "taking the lease")
            if self._client.access < Access.MOVE:
                raise CallRefused(f"{name} may not move anything")
            lease.take(name, self._caller.token)
            lease.beat(self._caller.token, request.sent_s)
        elif request.order is Order.PUBLISH:
            if self._client.access < Access.CALL:
                raise CallRefused(f"{name} may not publish")
            self._station.publish_shared(name, request.function, request.arguments.get("payload"))
        return None

    def _call(self, question: Question, request: Request, route: Route) -> None:
        invoker = self._station.invoker(request.application)
        found = invoker.find(self._caller, request.function)
        what = f"{request.application}.{request.function} from {self._client.name}"

        def still_wanted() -> None:
            check_age(self._station.clock, request.until_s, what)

        def carry_out(wait_s: float = FOR_EVER) -> None:
            try:
                result = invoker.invoke(
                    self._caller, request.function, request.arguments, still_wanted, wait_s=wait_s
                )
                self._answer(question, self._tickets.wrap(result, moves=found.mark.moves))
            except Busy:
                raise
            except CosmicError as exc:
                logger.warning("%s: %s ended: %s", self._station.name, what, exc)
                self._refuse(question, exc)

        if found.mark.at_once:
            carry_out()
            return
        still_wanted()
        if found.mark.reads:
            with suppress(Busy):
                carry_out(0.0)
                return
        route(request.application, carry_out)

    def _answer(self, question: Question, value: object) -> None:
        try:
            message = answer(self._station.clock.now_s(), value)
        except ProtocolError as exc:
            raise ProtocolError(f"the result cannot travel: {exc}") from exc
        question.answer(message)

    def _refuse(self, question: Question, error: CosmicError) -> None:
        question.answer(refusal_of(self._station.clock.now_s(), error))


class _DirectQuestion(Question):
    def __init__(self, message: bytes, framed: FramedSocket) -> None:
        self._message = message
        self._framed = framed

    @property
    @override
    def key(self) -> str:
        return ""

    @property
    @override
    def message(self) -> bytes:
        return self._message

    @override
    def answer(self, message: bytes) -> None:
        try:
            self._framed.send(message)
        except LineLost as exc:
            logger.debug("an answer found nobody: %s", exc)


class DirectReader(WorkerThread):
    """Reads one direct line, carries out what is asked and answers, all in this thread."""

    def __init__(
        self,
        name: str,
        station: Station,
        framed: FramedSocket,
        serve: Callable[[Question], None],
        on_lost: Callable[[], None],
    ) -> None:
        super().__init__(name, station.policy)
        self._clock = station.clock
        self._framed = framed
        self._serve = serve
        self._on_lost = on_lost

    @override
    def run_body(self) -> None:
        try:
            self._framed.send(answer(self._clock.now_s(), None))
            while not self.end_requested:
                self._serve(_DirectQuestion(self._framed.receive(), self._framed))
        except LineLost as exc:
            logger.debug("%s: %s", self.name, exc)
        finally:
            self._on_lost()
            self._framed.close()

    @override
    def request_end(self) -> None:
        super().request_end()
        self._framed.shut()
