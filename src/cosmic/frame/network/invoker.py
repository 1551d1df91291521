"""The one way into a hosted application (thesis 5.2.1, Fig. 5.7)."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import RLock
from typing import Final

from cosmic.frame.errors import CosmicError
from cosmic.frame.events import Event
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.caller import Access, Call, Caller, carrying_out
from cosmic.frame.network.errors import Busy, CallRefused, RemoteDefect
from cosmic.frame.network.lease import StationLease
from cosmic.frame.network.ongoing import Answered, Ongoing
from cosmic.frame.network.remote import Offered, offered_by

FOR_EVER: Final = -1.0
logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Ended:
    """A call that was carried out, or refused.

    Attributes
    ----------
    goes_on : Ongoing or None
        What it began, if that goes on.
    """

    caller: Caller
    found: Offered
    arguments: Mapping[str, object]
    error: CosmicError | None
    goes_on: Ongoing | None = None


class ApplicationInvoker:
    """Checks and carries out the calls to one application, one after the other.

    Calls to other applications never wait for this one. What is marked `at_once` (a stop) waits
    for nothing.

    Parameters
    ----------
    application : object
        Its functions marked with `remote` may be called, and nothing else.

    Attributes
    ----------
    ended : Event
        Emitted after each call, in its thread.

    Raises
    ------
    TypeError
        A marked function has a signature that cannot be checked.
    """

    def __init__(
        self, name: str, application: object, lease: StationLease, policy: FailurePolicy
    ) -> None:
        self.ended: Event[[Ended]] = Event()
        self._name = name
        self._offered = offered_by(application)
        self._lease = lease
        self._policy = policy
        self._turn = RLock()

    @property
    def name(self) -> str:
        """Name of the application."""
        return self._name

    @property
    def offered(self) -> Mapping[str, Offered]:
        """What may be called."""
        return self._offered

    def find(self, caller: Caller, function: object) -> Offered:
        """Return the function of that name, if `caller` may call it.

        Raises
        ------
        CallRefused
            There is none, or it may not.
        """
        found = self._offered.get(function) if isinstance(function, str) else None
        if found is None:
            raise CallRefused(f"{self._name} offers no function {str(function)[:60]!r}")
        mark = found.mark
        # Everybody may stop, whatever else is forbidden.
        needed = Access.VIEW if mark.reads or mark.at_once else Access.CALL
        if caller.access < (Access.MOVE if mark.moves else needed):
            refused = CallRefused(f"{caller.name} may not call {self._name}.{found.name}")
            self.ended.emit(Ended(caller, found, {}, refused))
            raise refused
        return found

    def invoke(
        self,
        caller: Caller,
        function: object,
        arguments: Mapping[str, object],
        still_wanted: Callable[[], None] | None = None,
        *,
        wait_s: float = FOR_EVER,
    ) -> object:
        """Carry out one call and return its result.

        Parameters
        ----------
        still_wanted : callable or None
            Called last before the function; raises when it is too late.
        wait_s : float
            How long to wait for other calls to end.

        Raises
        ------
        CosmicError
            What the function raised, or why it was not called: `CallRefused`, `CommandExpired`,
            `Busy` after `wait_s`, `MoveRefused` without the lease, `RemoteDefect` for a mistake in
            the program.
        """
        found = self.find(caller, function)
        try:
            result = self._invoke(caller, found, arguments, still_wanted, wait_s)
        except CosmicError as exc:
            self.ended.emit(Ended(caller, found, arguments, exc))
            raise
        answer = result.result if isinstance(result, Answered) else result
        goes_on = answer if isinstance(answer, Ongoing) else None
        self.ended.emit(Ended(caller, found, arguments, None, goes_on))
        return result

    def _invoke(
        self,
        caller: Caller,
        found: Offered,
        arguments: Mapping[str, object],
        still_wanted: Callable[[], None] | None,
        wait_s: float,
    ) -> object:
        checked = found.checked(arguments)
        if found.mark.at_once:
            return self._run(caller, found, checked, still_wanted)
        if not self._turn.acquire(timeout=wait_s):
            raise Busy(f"{self._name} is busy with other calls; this one was not carried out")
        try:
            return self._run(caller, found, checked, still_wanted)
        finally:
            self._turn.release()

    def _run(
        self,
        caller: Caller,
        found: Offered,
        checked: dict[str, object],
        still_wanted: Callable[[], None] | None,
    ) -> object:
        if still_wanted is not None and not found.mark.at_once:
            still_wanted()
        dead_man = None
        if found.mark.moves:
            dead_man = self._lease.dead_man(caller.token, found.mark.limit_s)
        level = logging.DEBUG if found.mark.reads or caller.local else logging.INFO
        if logger.isEnabledFor(level):
            said = _said(checked)
            logger.log(level, "%s: %s.%s(%s)", caller.name, self._name, found.name, said)
        try:
            with carrying_out(Call(caller, dead_man)):
                return found.run(**checked)
        except CosmicError:
            raise
        except Exception as exc:
            where = f"{self._name}.{found.name}, called by {caller.name}"
            failure = self._policy.report(exc, where)
            raise RemoteDefect(f"{failure.where}: {failure.text}") from exc


def _said(arguments: Mapping[str, object]) -> str:
    return ", ".join(f"{name}={value!r:.60}" for name, value in arguments.items())
