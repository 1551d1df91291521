"""Who may command motion on a station: one at a time, and the local operator above all."""

import logging
import secrets
from collections.abc import Callable
from dataclasses import dataclass, replace
from threading import Lock
from typing import Final

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import refusal
from cosmic.frame.events import Event, notify
from cosmic.frame.network.caller import MOVE_LIMIT_S
from cosmic.frame.network.dead_man import DeadMan, Pulse
from cosmic.frame.network.transfer import transferable
from cosmic.frame.verdict import MoveVerdict, Reason, refuse

logger = logging.getLogger(__name__)

TAKE_IT: Final = "take control first (the button in the top bar, rig.take_control() in a script)"


@transferable
@dataclass(frozen=True, slots=True)
class LeaseState:
    """Who may move, as every window shows it.

    Attributes
    ----------
    holder : str
        Name of the holder.
    local : bool
        It is the station's own process.
    offered : bool
        Others may take it while it is local.
    why : str
        Why it last changed.
    """

    holder: str
    local: bool
    offered: bool
    why: str = ""


@dataclass(frozen=True, slots=True)
class _Grant:
    name: str
    token: str
    pulse: Pulse
    in_process: bool


class StationLease:
    """The right to move; any thread. `stop` never asks for it.

    While nobody else holds it, it is this process's own. Another session takes it with its token
    and keeps it as long as its heartbeats come. The local operator takes it over at any time;
    from then on it is not given away until it is offered again.

    Parameters
    ----------
    name : str
        How the local holder is called.
    offered : bool
        Whether others may take it from the start.

    Attributes
    ----------
    refused : Event
        `refused(name, verdict)` is emitted when a session was refused it.
    """

    def __init__(
        self, name: str = "this program", *, offered: bool = True, clock: Clock = WALL
    ) -> None:
        self._clock = clock
        self._lock = Lock()
        self._local = _Grant(
            name, secrets.token_hex(16), Pulse(name, limit_s=float("inf"), clock=clock), True
        )
        self._grant: _Grant | None = None
        self._offered = offered
        self._why = ""
        self._changed: Event[LeaseState] = Event()
        self.refused: Event[str, MoveVerdict] = Event()

    @property
    def local_token(self) -> str:
        """Token of the station's own process."""
        return self._local.token

    @property
    def state(self) -> LeaseState:
        """Who may move now."""
        self.poll()
        with self._lock:
            return self._state()

    def subscribe(self, listener: Callable[[LeaseState], object]) -> Callable[[], None]:
        """Call `listener` at once and at each change; returns the function that ends it."""
        end = self._changed.subscribe(listener)
        notify(listener, self.state)
        return end

    def take(
        self, name: str, token: str, *, in_process: bool = False, keep_s: float = MOVE_LIMIT_S
    ) -> None:
        """Give it to the session `token`, or leave it there.

        Parameters
        ----------
        in_process : bool
            The session lives and dies with this process, and so sends no heartbeats.
        keep_s : float
            Silence that ends it. What moves bears no more than before, however long it is: a
            program that thinks may keep the right, and one that is gone leaves nothing moving.

        Raises
        ------
        MoveRefused
            Another holds it, or it is not offered (`NO_LEASE`).
        """
        self.poll()
        limit_s = float("inf") if in_process else keep_s
        with self._lock:
            verdict = self._verdict_on(token)
            changed = verdict is None and self._give(name, token, limit_s, in_process=in_process)
        if verdict is not None:
            self.refused.emit(name, verdict)
            raise refusal(verdict)
        if changed:
            self._publish()

    def _verdict_on(self, token: str) -> MoveVerdict | None:
        """Return why the session `token` may not have it now; None where it may."""
        held = self._grant
        if held is None and self._offered:
            return None
        if held is None:
            return _refused(f"{self._local.name} keeps the right to move to itself")
        if secrets.compare_digest(held.token, token):
            return None
        return _refused(f"the right to move is held by {held.name}")

    def _give(self, name: str, token: str, limit_s: float, *, in_process: bool) -> bool:
        held = self._grant
        changed = held is None or held.pulse.limit_s != limit_s
        if held is None:
            pulse = Pulse(name, limit_s=limit_s, clock=self._clock)
            self._grant = _Grant(name, token, pulse, in_process)
        else:
            held.pulse.beat(self._clock.now_s())  # who asks is alive
            held.pulse.bear(limit_s)
            self._grant = replace(held, in_process=in_process)
        if changed:
            kept = MOVE_LIMIT_S < limit_s < float("inf")
            silence = f", who may be silent for {limit_s:g} s" if kept else ""
            self._why = f"taken by {name}{silence}"
        return changed

    def release(self, token: str, why: str = "") -> None:
        """Give it back, if the session `token` holds it; what moves by it stops."""
        with self._lock:
            held = self._grant
            if held is None or not secrets.compare_digest(held.token, token):
                return
            self._drop(held, why or f"given back by {held.name}")
        self._publish()

    def take_over(self) -> None:
        """Take it for the local operator and keep it until `offer`; never refused."""
        with self._lock:
            self._offered = False
            if self._grant is not None:
                self._drop(self._grant, f"{self._local.name} took over from {self._grant.name}")
        self._publish()

    def offer(self) -> None:
        """Let other sessions take it again."""
        with self._lock:
            self._offered = True
        self._publish()

    def beat(self, token: str, sent_s: float) -> None:
        """Note a heartbeat of the session `token`, sent at `sent_s` of this station's clock."""
        with self._lock:
            held = self._grant
        if held is not None and secrets.compare_digest(held.token, token):
            held.pulse.beat(sent_s)

    def holds(self, token: str) -> bool:
        """Return whether the session `token` may move now."""
        self.poll()
        with self._lock:
            return secrets.compare_digest((self._grant or self._local).token, token)

    def dead_man(self, token: str, limit_s: float = MOVE_LIMIT_S) -> DeadMan:
        """Return what a motion commanded by the session `token` has to poll.

        Raises
        ------
        MoveRefused
            That session does not hold the lease (`NO_LEASE`).
        """
        self.poll()
        with self._lock:
            held = self._grant or self._local
            if not secrets.compare_digest(held.token, token):
                advice = TAKE_IT if self._grant is None and self._offered else ""
                raise refusal(_refused(f"the right to move is held by {held.name}", advice))
        if held.in_process:
            return DeadMan(held.pulse, float("inf"))
        return DeadMan(held.pulse, limit_s)

    def poll(self) -> None:
        """Let it lapse if its holder has fallen silent."""
        with self._lock:
            held = self._grant
            why = held.pulse.why if held is not None else ""
            if held is None or not why:
                return
            self._drop(held, why)
        self._publish()

    def _drop(self, held: _Grant, why: str) -> None:
        held.pulse.end(why)
        self._grant = None
        self._why = why

    def _state(self) -> LeaseState:
        held = self._grant or self._local
        return LeaseState(
            holder=held.name, local=self._grant is None, offered=self._offered, why=self._why
        )

    def _publish(self) -> None:
        with self._lock:
            state = self._state()
        logger.info("the right to move: %s (%s)", state.holder, state.why)
        self._changed.emit(state)


def _refused(text: str, what_to_do: str = "") -> MoveVerdict:
    advice = what_to_do or "ask for it there, or wait until it is given back"
    return refuse(Reason.NO_LEASE, f"{text}; {advice}")
