"""What bluesky expects of devices, in classes of ours: nothing of bluesky is imported.

The shapes are those of ``bluesky.protocols``; names and parameters that differ from the rest of
CoSMic are bluesky's.
"""

import logging
from abc import abstractmethod
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from typing import Any, NotRequired, Protocol, TypedDict

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import ConfigError
from cosmic.frame.operation import Operation

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
    external: NotRequired[str]


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


class Configured(Protocol):
    """What has a name and settings that are read back."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What the names of its settings begin with."""

    @abstractmethod
    def read_configuration(self) -> Readings:
        """Return its settings."""


def configure(
    device: Configured, wanted: Mapping[str, Any], setters: Mapping[str, Callable[[Any], object]]
) -> tuple[Readings, Readings]:
    """Change settings of a device, by their names with or without its own; return old and new.

    Raises
    ------
    ConfigError
        It has no such setting; nothing was changed.
    """
    prefix = f"{device.name}_"
    chosen = {key.removeprefix(prefix): value for key, value in wanted.items()}
    unknown = sorted(set(chosen) - set(setters))
    if unknown:
        there = ", ".join(setters) or "nothing"
        raise ConfigError(f"{device.name}: {', '.join(unknown)} cannot be set; there is {there}")
    before = device.read_configuration()
    for key, value in chosen.items():
        setters[key](value)
    return before, device.read_configuration()


class PlanStatus(Operation[None]):
    """Something under way that a plan waits for; why it fails is logged."""

    @override
    def finish(self, result: None = None) -> bool:
        return super().finish(result)

    @override
    def fail(self, error: Exception) -> bool:
        ended = super().fail(error)
        if ended:
            logger.warning("%s ended: %s", self.title, error)
        return ended
