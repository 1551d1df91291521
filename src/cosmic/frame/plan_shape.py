"""What bluesky expects of devices, in classes of ours: nothing of bluesky is imported.

The shapes are those of ``bluesky.protocols``; names and parameters that differ from the rest of
CoSMic are bluesky's.
"""

import logging
from collections.abc import Callable
from datetime import UTC, datetime
from threading import Condition
from typing import Any, NotRequired, TypedDict

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import DeviceTimeout
from cosmic.frame.listeners import tell
from cosmic.frame.threads import forbid_waiting_here

logger = logging.getLogger(__name__)


class Reading(TypedDict):
    """A value and when it was true, in seconds of UNIX time."""

    value: Any
    timestamp: float


class DataKey(TypedDict):
    """What a value is: where it comes from, its kind, shape and unit."""

    source: str
    dtype: str
    shape: list[int]
    dtype_numpy: NotRequired[str]
    units: NotRequired[str]


class EventPage(TypedDict):
    """Values of many moments, a list each."""

    time: list[float]
    data: dict[str, list[float]]
    timestamps: dict[str, list[float]]


Readings = dict[str, Reading]
DataKeys = dict[str, DataKey]


def plain_name(name: str) -> str:
    """Return a name as bluesky's documents admit it: "left_x" for "left.x"."""
    return name.replace(".", "_")


def number_key(source: str, units: str = "") -> DataKey:
    """Describe one number; `units` as CoSMic writes them."""
    key: DataKey = {"source": source, "dtype": "number", "shape": [], "dtype_numpy": "<f8"}
    return {**key, "units": units} if units else key


def whole_key(source: str) -> DataKey:
    """Describe one whole number."""
    return {"source": source, "dtype": "integer", "shape": [], "dtype_numpy": "<i8"}


def text_key(source: str) -> DataKey:
    """Describe one text."""
    return {"source": source, "dtype": "string", "shape": []}


def unix_now_s() -> float:
    """Return the time in seconds since 1970, as bluesky stamps what it reads."""
    return datetime.now(UTC).timestamp()


def unix_of_wall_s(wall_s: float) -> float:
    """Return the UNIX time of a moment of `WALL`."""
    return unix_now_s() - (WALL.now_s() - wall_s)


def unix_of_platform_s(clock: Clock, platform_s: float) -> float:
    """Return the UNIX time of a moment of the platform's clock."""
    return unix_now_s() - (clock.now_s() - platform_s) / (clock.rate or 1.0)


class PlanStatus:
    """Something under way that a plan waits for; ends exactly once, from any thread."""

    def __init__(self, what: str) -> None:
        self._what = what
        self._changed = Condition()
        self._done = False
        self._error: Exception | None = None
        self._callbacks: list[Callable[[PlanStatus], None]] = []

    @override
    def __repr__(self) -> str:
        if not self._done:
            return f"<{self._what}: under way>"
        return f"<{self._what}: {self._error or 'done'}>"

    @property
    def done(self) -> bool:
        """True when it has ended, well or not."""
        return self._done

    @property
    def success(self) -> bool:
        """True when it has ended well."""
        return self._done and self._error is None

    def exception(self, timeout: float | None = 0.0) -> Exception | None:
        """Return why it failed, or None; waits up to `timeout` seconds (None: for ever).

        Raises
        ------
        DeviceTimeout
            It had not ended by then.
        """
        if not self._done and timeout != 0.0:
            forbid_waiting_here(f"waiting for {self._what}")
        with self._changed:
            if not self._changed.wait_for(lambda: self._done, timeout):
                raise DeviceTimeout(f"{self._what} had not ended after {timeout:g} s")
        return self._error

    def wait(self, timeout_s: float | None = None) -> None:
        """Wait for the end; raises what it failed with, and `DeviceTimeout`."""
        error = self.exception(timeout_s)
        if error is not None:
            raise error

    def add_callback(self, callback: "Callable[[PlanStatus], None]") -> None:
        """Call `callback(status)` at the end, in the thread that ends it, or now."""
        with self._changed:
            if not self._done:
                self._callbacks.append(callback)
                return
        tell([callback], self)

    def finish(self) -> bool:
        """End it well; False where it had ended before. For whoever carries it out."""
        return self._end(None)

    def fail(self, error: Exception) -> bool:
        """End it badly; False where it had ended before. For whoever carries it out."""
        return self._end(error)

    def _end(self, error: Exception | None) -> bool:
        with self._changed:
            if self._done:
                return False
            self._error, self._done = error, True
            callbacks, self._callbacks = self._callbacks, []
            self._changed.notify_all()
        if error is not None:
            logger.warning("%s ended: %s", self._what, error)
        tell(callbacks, self)
        return True
