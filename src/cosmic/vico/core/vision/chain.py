"""The chain of named algorithms that is run on each picture before it is shown.

An algorithm of one's own is a class with `name` and `run`, and `@algorithm` above it, in a module
that is imported before `algorithms.make_chain` is called::

    @algorithm
    class Brightness:
        name = "brightness"

        def run(self, picture: Picture, results: Results) -> object:
            return float(picture.data.mean())
"""

import logging
import threading
from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final, Protocol, TypeVar

from cosmic.frame.clock import WALL
from cosmic.frame.errors import ConfigError
from cosmic.vico.core.picture import Picture

logger = logging.getLogger(__name__)

MOST_FAILURES: Final = 3

Results = Mapping[str, object]
T = TypeVar("T")


class Algorithm(Protocol):
    """Something that is found on each picture. One thread runs it; it may keep what it likes."""

    name: str

    @abstractmethod
    def run(self, picture: Picture, results: Results) -> object:
        """Return what is found on `picture`, as an object that nobody changes afterwards.

        Parameters
        ----------
        results : mapping of str to object
            What the algorithms before it in the chain found on the same picture, by name. One
            that is switched off or failed is missing.

        Returns
        -------
        object
            `Unavailable` where there is nothing to be found, with the reason. An exception is
            for what nobody foresaw: after some of them in a row the algorithm is switched off.
        """


@dataclass(frozen=True, slots=True)
class Unavailable:
    """Why there is no result."""

    reason: str


@dataclass(frozen=True, slots=True)
class Failure:
    """An algorithm that raised."""

    text: str
    switched_off: bool


@dataclass(frozen=True, slots=True, eq=False)
class Analysis:
    """What the chain found on one picture.

    Attributes
    ----------
    results : mapping of str to object
        By the algorithm's name, in the order they ran.
    durations_s : mapping of str to float
        Wall time of each.
    failures : mapping of str to Failure
        Those that raised on this picture.
    """

    picture: Picture
    results: Results
    durations_s: Mapping[str, float]
    duration_s: float
    failures: Mapping[str, Failure] = field(default_factory=lambda: MappingProxyType({}))

    def get(self, name: str, kind: type[T]) -> T | None:
        """Return the result of an algorithm if it is of `kind`; None where there is none."""
        found = self.results.get(name)
        return found if isinstance(found, kind) else None


@dataclass(frozen=True, slots=True)
class LinkState:
    """How an algorithm of the chain stands.

    Attributes
    ----------
    reason : str
        Why it was switched off by the chain; empty where a person did or it is on.
    last_s : float or None
        What it took last time.
    """

    name: str
    on: bool
    reason: str
    last_s: float | None


class _Link:
    def __init__(self, one: Algorithm, *, on: bool) -> None:
        self.algorithm = one
        self.on = on
        self.failures = 0
        self.reason = ""
        self.last_s: float | None = None


class Chain:
    """Runs algorithms in order on a picture; one that raises does not keep the rest from running.

    `run` belongs to one thread; `switch` and `states` are for any.

    Raises
    ------
    ConfigError
        Two algorithms have one name.
    """

    def __init__(
        self,
        algorithms: Iterable[Algorithm],
        *,
        off: Iterable[str] = (),
        most_failures: int = MOST_FAILURES,
    ) -> None:
        idle = set(off)
        self._most_failures = most_failures
        self._lock = threading.Lock()
        self._links: dict[str, _Link] = {}
        for each in algorithms:
            if each.name in self._links:
                raise ConfigError(f"vision: two algorithms are called {each.name!r}; rename one")
            self._links[each.name] = _Link(each, on=each.name not in idle)
        for name in idle:
            self._link(name)

    @property
    def names(self) -> tuple[str, ...]:
        """The algorithms in the order in which they run."""
        return tuple(self._links)

    @property
    def states(self) -> tuple[LinkState, ...]:
        """How each stands, in order."""
        with self._lock:
            return tuple(
                LinkState(name, link.on, link.reason, link.last_s)
                for name, link in self._links.items()
            )

    def switch(self, name: str, *, on: bool) -> None:
        """Switch an algorithm on or off, from the next picture on; its failures are forgotten.

        Raises
        ------
        ConfigError
            There is none of that name; the text lists those there are.
        """
        link = self._link(name)
        with self._lock:
            link.on, link.failures, link.reason = on, 0, ""

    def algorithm(self, name: str) -> Algorithm:
        """Return an algorithm, for its own settings; raises `ConfigError` as `switch` does."""
        return self._link(name).algorithm

    def run(self, picture: Picture) -> Analysis:
        """Run all that are on."""
        began_s = WALL.now_s()
        results: dict[str, object] = {}
        durations_s: dict[str, float] = {}
        failures: dict[str, Failure] = {}
        seen = MappingProxyType(results)
        for name, link in self._links.items():
            if not link.on:
                continue
            start_s = WALL.now_s()
            try:
                results[name] = link.algorithm.run(picture, seen)
            except Exception as exc:
                logger.exception("vision: %s failed on frame %d", name, picture.frame.frame_id)
                failures[name] = self._failed(link, exc)
            else:
                link.failures = 0
            durations_s[name] = link.last_s = WALL.now_s() - start_s
        return Analysis(
            picture,
            seen,
            MappingProxyType(durations_s),
            WALL.now_s() - began_s,
            MappingProxyType(failures),
        )

    def _failed(self, link: _Link, exc: Exception) -> Failure:
        text = f"{link.algorithm.name}: {str(exc) or type(exc).__name__}"
        with self._lock:
            link.failures += 1
            off = link.failures >= self._most_failures
            if off:
                link.on = False
                link.reason = f"switched off after it failed {link.failures} times in a row: {text}"
                logger.error("vision: %s", link.reason)
        return Failure(text, off)

    def _link(self, name: str) -> _Link:
        if name not in self._links:
            raise ConfigError(
                f"vision: there is no algorithm {name!r}; there are: {', '.join(self._links)}"
            )
        return self._links[name]


Maker = Callable[[], Algorithm]
M = TypeVar("M", bound=Maker)


class Registry:
    """Which algorithms a chain is made of, in order; filled when their modules are imported."""

    def __init__(self) -> None:
        self._makers: list[Maker] = []

    def add(self, maker: M) -> M:
        """Have every chain made from now on end with one of these; decorates a class."""
        self._makers.append(maker)
        return maker

    def chain(self, *, off: Iterable[str] = ()) -> Chain:
        """Return a chain with one of each, anew.

        Raises
        ------
        ConfigError
            Two have one name, or `off` names one that is not there.
        """
        return Chain([maker() for maker in self._makers], off=off)


ALGORITHMS: Final = Registry()
algorithm = ALGORITHMS.add
