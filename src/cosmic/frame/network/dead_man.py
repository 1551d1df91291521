"""What stops a motion when whoever commands it falls silent.

The thread that moves polls a `DeadMan`; nothing has to reach that thread for the motion to end.
"""

from threading import Lock

from cosmic.frame.clock import Clock


class Pulse:
    """When the holder of the lease was last alive, on this station's clock; any thread.

    Parameters
    ----------
    limit_s : float
        Silence after which it has ended and no later heartbeat revives it.
    """

    def __init__(self, name: str, *, limit_s: float, clock: Clock) -> None:
        self._name = name
        self._limit_s = limit_s
        self._clock = clock
        self._lock = Lock()
        self._last_s = clock.now_s()
        self._why = ""

    def beat(self, sent_s: float) -> None:
        """Note a heartbeat that was sent at `sent_s` of this station's clock."""
        with self._lock:
            self._look(self._limit_s)
            if not self._why and sent_s <= self._clock.now_s():
                self._last_s = max(self._last_s, sent_s)

    def bear(self, limit_s: float) -> None:
        """Bear `limit_s` of silence from now on."""
        with self._lock:
            self._look(self._limit_s)
            self._limit_s = limit_s

    @property
    def limit_s(self) -> float:
        """How much silence it bears."""
        with self._lock:
            return self._limit_s

    def end(self, why: str) -> None:
        """End it for good."""
        with self._lock:
            self._why = self._why or why

    def ended_after(self, limit_s: float) -> str:
        """Return why it is over for whoever bears `limit_s` of silence; empty while it is not."""
        with self._lock:
            self._look(self._limit_s)
            return self._why or self._silence(limit_s)

    @property
    def why(self) -> str:
        """Why it has ended; empty while it has not."""
        return self.ended_after(self._limit_s)

    def _look(self, limit_s: float) -> None:
        self._why = self._why or self._silence(limit_s)

    def _silence(self, limit_s: float) -> str:
        silent_s = self._clock.now_s() - self._last_s
        if silent_s <= limit_s:
            return ""
        return f"nothing heard from {self._name} for {silent_s:.1f} s (limit {limit_s:g} s)"


class DeadMan:
    """A deadline that only the holder's heartbeats put off; polled by the thread that moves.

    Once expired it stays so: going on needs a new command.
    """

    def __init__(self, pulse: Pulse, limit_s: float) -> None:
        self._pulse = pulse
        self._limit_s = limit_s
        self._why = ""

    @property
    def limit_s(self) -> float:
        """How long the holder may be silent."""
        return self._limit_s

    @property
    def expired(self) -> bool:
        """True when the motion has to end; takes about a microsecond, waits for nothing."""
        return bool(self.why)

    @property
    def why(self) -> str:
        """Why it has expired, in words for the operator; empty while it has not."""
        if not self._why:
            self._why = self._pulse.ended_after(self._limit_s)
        return self._why

    def within(self, limit_s: float) -> "DeadMan":
        """Return one for the same holder that bears only `limit_s` of silence."""
        return DeadMan(self._pulse, min(limit_s, self._limit_s))
