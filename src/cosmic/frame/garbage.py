"""Garbage collection that does not stop the interpreter while something moves.

Python looks through all objects of a program from time to time. With a window that takes 60 to
180 ms, in which no thread runs, and a stop has to wait. Here what a program has loaded at its start
is frozen, which takes no time: no later collection looks at it. Young objects are collected as
usual, in at most a few milliseconds. Older ones are looked through at moments when nothing
moves; where there is no such moment, before they are so many that it would take long. What
survives is frozen as well, so that the next time is as short; it is all looked through again at a
longer rest, or when it has grown beyond bounds.

In a program with a window Python collects nothing by itself: whatever thread makes objects would do
it, and one that takes a Qt object apart holds Qt's lock and waits for the interpreter, while the
window's thread may hold the interpreter and wait for that lock. There the window's thread collects
young objects too.

Knows no Qt, so that helper processes can use it.
"""

import gc
import linecache
import logging
from collections.abc import Callable
from dataclasses import dataclass
from threading import RLock, get_ident
from typing import Final

from cosmic.frame.c_memory import give_memory_back
from cosmic.frame.clock import WALL

logger = logging.getLogger(__name__)

NEVER: Final = 1_000_000_000
"""As the third threshold: Python does not look through old objects by itself."""
REST_S: Final = 0.5
LONG_REST_S: Final = 5.0
"""How long nothing may have moved before old objects, or all of them, are looked through."""
WORTHWHILE: Final = 5_000
"""So many old objects are looked through at a rest."""
MOST: Final = 20_000
"""So many are looked through at once, whatever moves; it takes about 10 ms."""
LONGEST_S: Final = 60.0
"""So often at least, for a few objects can hold many megabytes. What a closed platform leaves waits
no longer for a long rest where another one is at work all the time: a short one will do."""
YOUNG: Final = 700
"""So many young objects are worth a look of the window's thread."""
PASSES: Final = 10
"""After so many looks at the youngest those that survived one are looked through."""
MANY_FROZEN: Final = 50_000
MOST_FROZEN: Final = 250_000
"""So many that were frozen since the start are looked through at a long rest, or in any case."""


@dataclass(frozen=True, slots=True)
class Collection:
    """One look through old objects.

    Attributes
    ----------
    objects : int
        How many were looked through.
    found : int
        How many of them nobody could reach any more.
    took_s : float
        How long the interpreter stood still.
    at_rest : bool
        Nothing moved.
    whole : bool
        What had been frozen was looked through as well.
    """

    objects: int
    found: int
    took_s: float
    at_rest: bool
    whole: bool


class Garbage:
    """Decides when the old objects of this process are looked through; any thread.

    There is one for a process, `GARBAGE`, which all its platforms share.

    Parameters
    ----------
    now_s : callable
        Returns the time of the wall, s.
    """

    def __init__(self, now_s: Callable[[], float] = WALL.now_s) -> None:
        self._now_s = now_s
        self._lock = RLock()  # a finalizer may end a platform
        self._users: dict[int, Callable[[], bool]] = {}
        self._count = 0
        self._by_hand: dict[int, int] = {}  # with the thread of the widgets
        self._before = gc.get_threshold()
        self._frozen_before = 0
        self._grown = 0  # what was frozen since the start; to count takes many milliseconds
        self._moved_s = 0.0
        self._collected_s = 0.0
        self._left_s: float | None = None  # since when a closed platform waits to be freed

    @property
    def in_force(self) -> bool:
        """True while a platform is open, and Python's own rules for old objects are not."""
        return bool(self._users)

    def begin(self, moves: Callable[[], bool], *, by_hand: bool = False) -> Callable[[], None]:
        """Freeze what is loaded, and collect as `moves` allows from now on.

        Parameters
        ----------
        moves : callable
            Tells whether anything moves that a pause could harm; called in `tick`.
        by_hand : bool
            There are widgets, which belong to this thread: nothing is collected except by its calls
            of `tick` and `tick_young`. Those of other threads, such as that of a second platform
            without a window, do nothing meanwhile: a painter must not go while it is painted with.

        Returns
        -------
        callable
            Ends that; the last one puts back everything as it was before the first.
        """
        with self._lock:
            if not self._users:
                self._before = gc.get_threshold()
                self._frozen_before = gc.get_freeze_count()
                gc.set_threshold(*self._before[:2], NEVER)
            self._count += 1
            number = self._count
            self._users[number] = moves
            # Else a script has switched it off, for its reasons.
            if by_hand and (gc.isenabled() or self._by_hand):
                self._by_hand[number] = get_ident()
                gc.disable()
            forget_sources()
            gc.freeze()
            self._grown = 0
            self._moved_s = self._collected_s = self._now_s()
        return lambda: self._end(number)

    def _end(self, number: int) -> None:
        with self._lock:
            if self._by_hand.pop(number, None) is not None and not self._by_hand:
                gc.enable()
            if self._users.pop(number, None) is None:
                return
            # A platform is freed by a whole collection only: much of it was frozen with the rest.
            if self._users:
                self._left_s = self._now_s() if self._left_s is None else self._left_s
                return
            self._left_s = None
            if gc.get_threshold() == (*self._before[:2], NEVER):  # else somebody else's wish
                gc.set_threshold(*self._before)
            if not self._frozen_before:  # what a script froze before stays so
                gc.unfreeze()

    def tick(self) -> Collection | None:
        """Look through old objects if it is time; to be called about twice a second.

        In a program with widgets it does so in their thread only: what is found may be one.
        """
        with self._lock:
            if not self._users or not self._is_my_turn():
                return None
            now_s = self._now_s()
            if any(moves() for moves in list(self._users.values())):
                self._moved_s = now_s
            rest_s = now_s - self._moved_s
            waits_s = -1.0 if self._left_s is None else now_s - self._left_s
            long_rest = rest_s >= (REST_S if waits_s >= LONGEST_S else LONG_REST_S)
            many = self._grown >= MANY_FROZEN or waits_s >= 0.0
            if self._grown >= MOST_FROZEN or (many and long_rest):
                return self._collect(at_rest=long_rest, whole=True)
            passes = gc.get_count()[2]  # of young objects, since old ones were looked through
            grown = objects_of(2) if passes else 0
            long_ago = now_s - self._collected_s >= LONGEST_S
            at_rest = rest_s >= REST_S
            if grown >= (WORTHWHILE if at_rest else MOST) or (grown and long_ago):
                return self._collect(at_rest=at_rest, whole=False)
            return None

    def tick_young(self) -> None:
        """Collect young objects where Python does not; the window's thread, ten times a second."""
        with self._lock:
            if not self._by_hand or gc.isenabled() or not self._is_my_turn():
                return
            young, passes, _ = gc.get_count()
            if passes >= PASSES:
                gc.collect(1)
            elif young >= YOUNG:
                gc.collect(0)

    def _is_my_turn(self) -> bool:
        """Return whether this thread may collect; locked."""
        return get_ident() in self._by_hand.values() if self._by_hand else gc.isenabled()

    def _collect(self, *, at_rest: bool, whole: bool) -> Collection:
        before = gc.get_freeze_count()
        began_s = self._now_s()
        if whole:
            gc.unfreeze()
        found = gc.collect()
        gc.freeze()
        self._collected_s = self._now_s()
        if at_rest:
            forget_sources()
            give_memory_back()
        left = gc.get_freeze_count()
        self._grown = 0 if whole else self._grown + left - before
        if whole:
            self._left_s = None
        objects = found + (left if whole else left - before)
        done = Collection(objects, found, self._collected_s - began_s, at_rest, whole)
        level = logging.INFO if not at_rest and done.took_s > 0.02 else logging.DEBUG
        logger.log(
            level,
            "garbage collection: %d of %d objects in %.1f ms%s",
            done.found,
            done.objects,
            1e3 * done.took_s,
            "" if at_rest else ", while something moved",
        )
        return done


GARBAGE: Final = Garbage()


def objects_of(generation: int | None = None) -> int:
    """Return how many objects of a generation the collector knows, of all if None; any thread.

    The list of them must not be seen by another thread: it holds a tuple that one of them just
    builds from an iterator, and Python cannot make such a tuple longer then (a SystemError). So
    listed, counted and dropped is in one step of the interpreter, which `map` does.
    """
    return next(map(len, map(gc.get_objects, (generation,))))


def forget_sources() -> None:
    """Let go of the source texts of modules; any thread.

    PySide reads that of every module that is imported, and Python keeps them for tracebacks: 30 MB
    at the start. A traceback reads what it needs again. What was typed is in no file, and stays.
    """
    for name, kept in list(linecache.cache.items()):
        read_from_file = len(kept) > 1 and kept[1] is not None
        if read_from_file:
            linecache.cache.pop(name, None)


def freeze_what_is_loaded() -> None:
    """Collect once and freeze the rest, for good; for helper processes.

    What such a process makes afterwards is little and young: Python's own rules stay in force.
    """
    gc.collect()
    gc.freeze()
