"""Axes linked to each other: moving one moves the others the same way, or a part of it."""

import logging
import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from threading import Lock

from cosmic.frame.errors import NotAvailable
from cosmic.frame.events import Event, Unsubscribe
from cosmic.mico.core.motion.orders import Motion, MoveBy, MoveTo
from cosmic.mico.core.motion.settings import LinkSettings, mistake

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Link:
    """Two axes that move together.

    Attributes
    ----------
    ratio : float
        How far `second` goes when `first` goes 1, in their units; below 0 in the other direction.
    """

    first: str
    second: str
    ratio: float = 1.0


class LinkTable:
    """The links in force; any thread.

    Links that have an axis in common make a chain, all of which moves together.

    Parameters
    ----------
    links : iterable of LinkSettings
        Those that are there from the start.
    """

    def __init__(self, links: Iterable[LinkSettings] = ()) -> None:
        self._lock = Lock()
        self._links: tuple[Link, ...] = ()
        self._factors: Mapping[str, Mapping[str, float]] = {}
        self._went_to: dict[str, float] = {}
        self._changed: Event[[]] = Event()
        for link in links:
            self.add(link.first, link.second, link.ratio)

    @property
    def links(self) -> tuple[Link, ...]:
        """The links in force."""
        return self._links

    def subscribe(self, listener: Callable[[], object]) -> Unsubscribe:
        """Call `listener` after each change, in the thread that made it."""
        return self._changed.subscribe(listener)

    def companions(self, axis: str) -> Mapping[str, float]:
        """Return how far each axis linked to `axis` goes when that goes 1; takes no lock."""
        return self._factors.get(axis, {})

    def partners(self) -> Mapping[str, frozenset[str]]:
        """Return the axes that must move with each linked one; takes no lock."""
        return {axis: frozenset(factors) for axis, factors in self._factors.items()}

    def add(self, first: str, second: str, ratio: float = 1.0) -> Link:
        """Link two axes.

        Raises
        ------
        NotAvailable
            They are linked already, if by a detour, or the ratio makes no sense.
        """
        text = mistake(first, second, ratio)
        if text:
            raise NotAvailable(text)
        with self._lock:
            if second in self.companions(first):
                raise NotAvailable(f"{first} and {second} are linked already; unlink them first")
            link = Link(first, second, ratio)
            self._set((*self._links, link))
        logger.info("%s linked with %s, ratio %g", first, second, ratio)
        self._changed.emit()
        return link

    def remove(self, axis: str) -> bool:
        """Take away every link of `axis`; False when there was none."""
        with self._lock:
            left = tuple(each for each in self._links if axis not in (each.first, each.second))
            if left == self._links:
                return False
            self._set(left)
        logger.info("%s is linked no more", axis)
        self._changed.emit()
        return True

    def _set(self, links: tuple[Link, ...]) -> None:
        self._links = links
        self._factors = {
            axis: _reach(axis, links) for link in links for axis in (link.first, link.second)
        }
        self._went_to = {
            name: went for name, went in self._went_to.items() if name in self._factors
        }

    # Moving

    def expanded(
        self,
        motions: Mapping[str, Motion],
        stand: Mapping[str, float],
        tolerance: float,
        tolerance_deg: float | None = None,
    ) -> dict[str, Motion]:
        """Return `motions` with what the axes linked to them do, as positions to go to.

        An axis that is named itself does what is asked of it. Where each counts from is the
        place that it was sent to last, so that what remains after each movement does not add up.

        Parameters
        ----------
        stand : mapping of float
            Where each axis stands, or is going, in gate coordinates.
        tolerance, tolerance_deg : float
            How far from where it was sent an axis may stand and still be taken to be there; of
            rotary axes `tolerance_deg`, where that is given.
        """
        found = dict(motions)
        for name, motion in motions.items():
            if not isinstance(motion, (MoveTo, MoveBy)):
                continue
            companions = {
                other: ratio
                for other, ratio in self.companions(name).items()
                if other not in motions and other in stand
            }
            if not companions or name not in stand:
                continue
            near = tolerance
            if motion.unit == "deg" and tolerance_deg is not None:
                near = tolerance_deg
            here = self._nominal(name, stand[name], near)
            target = here + motion.distance if isinstance(motion, MoveBy) else motion.target
            found[name] = MoveTo(target, motion.unit)
            for other, ratio in companions.items():
                there = self._nominal(other, stand[other], near)
                found[other] = MoveTo(there + ratio * (target - here), motion.unit)
        return found

    def sent(self, targets: Mapping[str, float]) -> None:
        """Remember where linked axes were sent."""
        with self._lock:
            for name in self._factors.keys() & targets.keys():
                self._went_to[name] = targets[name]

    def _nominal(self, name: str, stands: float, tolerance: float) -> float:
        went_to = self._went_to.get(name, math.inf)
        return went_to if abs(went_to - stands) <= tolerance else stands


def _reach(axis: str, links: tuple[Link, ...]) -> dict[str, float]:
    """Return how far every axis that hangs together with `axis` goes when that goes 1."""
    factors = {axis: 1.0}
    todo = [axis]
    while todo:
        here = todo.pop()
        for link in links:
            for one, other, ratio in (
                (link.first, link.second, link.ratio),
                (link.second, link.first, 1.0 / link.ratio),
            ):
                if one == here and other not in factors:
                    factors[other] = factors[here] * ratio
                    todo.append(other)
    del factors[axis]
    return factors
