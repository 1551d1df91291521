"""The chain of named algorithms that is run on each image before it is shown.

A package brings an algorithm under ``[project.entry-points."cosmic.analyses"]``, where an
`AnalysisBackend` stands; it is in the chain of each camera that names it among its `algorithms`.

In a script, one of one's own is a class with `name` and `run`, and `@algorithm` above it, before
`algorithms.make_chain` is called::

    @algorithm
    class Brightness:
        name = "brightness"

        def run(self, image: CameraImage, results: Results) -> object:
            return float(image.data.mean())
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
from cosmic.frame.plugins import Backend
from cosmic.vico.core.image import CameraImage

logger = logging.getLogger(__name__)

MOST_FAILURES: Final = 3
RETRY_S: Final = 2.0
"""How long one rests that failed so often in a row, in wall time; then it is tried again."""

Results = Mapping[str, object]
T = TypeVar("T")


class Algorithm(Protocol):
    """Something that is found on each image. One thread runs it; it may keep what it likes."""

    name: str

    @abstractmethod
    def run(self, image: CameraImage, results: Results) -> object:
        """Return what is found on `image`, as an object that nobody changes afterwards.

        Parameters
        ----------
        results : mapping of str to object
            What the algorithms before it in the chain found on the same image, by name. One
            that is switched off or failed is missing.

        Returns
        -------
        object
            `Unavailable` where there is nothing to be found, with the reason. An exception is
            for what nobody foresaw: after some of them in a row it runs now and then only, until
            it succeeds.
        """


AnalysisBackend = Backend[None, Algorithm]
"""What an entry point of the group ``cosmic.analyses`` leads to; made anew for each camera."""


@dataclass(frozen=True, slots=True)
class Unavailable:
    """Why there is no result."""

    reason: str


@dataclass(frozen=True, slots=True)
class Failure:
    """An algorithm that raised."""

    text: str
    resting: bool


@dataclass(frozen=True, slots=True, eq=False)
class Analysis:
    """What the chain found on one image.

    Attributes
    ----------
    results : mapping of str to object
        By the algorithm's name, in the order they ran.
    durations_s : mapping of str to float
        Wall time of each.
    failures : mapping of str to Failure
        Those that raised on this image.
    """

    image: CameraImage
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
        Why it rests: it failed, and is tried again in a while; empty where all is well.
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
        self.due_s = 0.0
        self.last_s: float | None = None


class Chain:
    """Runs algorithms in order on an image; one that raises does not keep the rest from running.

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
        retry_s: float = RETRY_S,
    ) -> None:
        idle = set(off)
        self._most_failures = most_failures
        self._retry_s = retry_s
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
        """Switch an algorithm on or off, from the next image on; its failures are forgotten.

        Raises
        ------
        ConfigError
            There is none of that name; the text lists those there are.
        """
        link = self._link(name)
        with self._lock:
            link.on, link.failures, link.reason, link.due_s = on, 0, "", 0.0

    def algorithm(self, name: str) -> Algorithm:
        """Return an algorithm, for its own settings; raises `ConfigError` as `switch` does."""
        return self._link(name).algorithm

    def run(self, image: CameraImage) -> Analysis:
        """Run all that are on."""
        began_s = WALL.now_s()
        results: dict[str, object] = {}
        durations_s: dict[str, float] = {}
        failures: dict[str, Failure] = {}
        seen = MappingProxyType(results)
        for name, link in self._links.items():
            start_s = WALL.now_s()
            if not link.on or start_s < link.due_s:
                continue
            try:
                results[name] = link.algorithm.run(image, seen)
            except Exception as exc:  # noqa: BLE001 - said once, and it does not end the others
                failures[name] = self._failed(link, exc, image.frame.frame_id)
            else:
                self._succeeded(link)
            durations_s[name] = link.last_s = WALL.now_s() - start_s
        return Analysis(
            image,
            seen,
            MappingProxyType(durations_s),
            WALL.now_s() - began_s,
            MappingProxyType(failures),
        )

    def _failed(self, link: _Link, exc: Exception, frame: int) -> Failure:
        name = link.algorithm.name
        text = f"{name}: {str(exc) or type(exc).__name__}"
        with self._lock:
            link.failures += 1
            rests = link.failures >= self._most_failures
            if rests:
                link.due_s = WALL.now_s() + self._retry_s
                link.reason = (
                    f"failed {link.failures} times in a row, is tried again every "
                    f"{self._retry_s:g} s: {text}"
                )
            first = link.failures == 1
        if first:  # the same at every image says nothing new
            logger.error(
                "vision: %s failed on frame %d; it is tried again", name, frame, exc_info=exc
            )
        return Failure(text, rests)

    def _succeeded(self, link: _Link) -> None:
        with self._lock:
            failures, link.failures, link.reason = link.failures, 0, ""
        if failures:
            logger.info("vision: %s works again, after %d failures", link.algorithm.name, failures)

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

    @property
    def names(self) -> tuple[str, ...]:
        """Names of what was added, as far as the makers tell them."""
        return tuple(getattr(maker, "name", "") for maker in self._makers)

    def add(self, maker: M) -> M:
        """Have every chain made from now on end with one of these; decorates a class."""
        self._makers.append(maker)
        return maker

    def chain(self, before: Iterable[Algorithm] = (), *, off: Iterable[str] = ()) -> Chain:
        """Return a chain of those `before`, and then one of each, anew.

        Raises
        ------
        ConfigError
            Two have one name, or `off` names one that is not there.
        """
        return Chain([*before, *(maker() for maker in self._makers)], off=off)


ALGORITHMS: Final = Registry()
algorithm = ALGORITHMS.add
