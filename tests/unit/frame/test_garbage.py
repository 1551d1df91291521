"""Old objects are looked through when nothing moves, and everything is put back at the end."""

import gc
import linecache
import traceback
import weakref
from collections.abc import Callable, Iterator
from threading import Event, Thread

import pytest

from cosmic.frame import garbage
from cosmic.frame.garbage import (
    LONG_REST_S,
    LONGEST_S,
    MOST,
    WORTHWHILE,
    Garbage,
    objects_of,
)


class Ring:
    """Refers to itself, so that only the collector can find it."""

    def __init__(self, objects: int) -> None:
        self.itself = self
        self.many = [[number] for number in range(objects)]


class Bench:
    """A collector with a time and a motion of its own."""

    def __init__(self) -> None:
        self.time_s = 100.0
        self.moves = False
        self.garbage = Garbage(lambda: self.time_s)
        self.end = self.garbage.begin(lambda: self.moves)

    def after(self, seconds: float) -> garbage.Collection | None:
        at_once = self.garbage.tick()
        self.time_s += seconds
        return at_once or self.garbage.tick()


@pytest.fixture
def bench() -> Iterator[Bench]:
    gc.collect()
    made = Bench()
    yield made
    made.end()


def old_ring(objects: int) -> tuple[list[Ring], "weakref.ref[Ring]"]:
    """Return a ring among the old objects; it is garbage once the list is cleared."""
    ring = Ring(objects)
    gc.collect(1)
    gc.collect(1)
    return [ring], weakref.ref(ring)


def test_old_garbage_is_collected_at_a_rest(bench: Bench) -> None:
    kept, found = old_ring(WORTHWHILE)
    kept.clear()
    assert found() is not None
    done = bench.after(1.0)
    assert found() is None
    assert done is not None
    assert done.at_rest
    assert not done.whole
    assert done.found >= WORTHWHILE


def test_what_a_closed_platform_leaves_is_freed_at_the_next_long_rest(bench: Bench) -> None:
    kept, found = old_ring(10)
    end = bench.garbage.begin(lambda: False)  # freezes the ring with the rest
    kept.clear()
    end()
    assert bench.after(LONG_REST_S / 2.0) is None
    done = bench.after(LONG_REST_S)
    assert done is not None and done.whole and done.at_rest
    assert found() is None
    assert bench.after(LONG_REST_S) is None


def test_what_a_closed_platform_leaves_waits_a_minute_for_a_long_rest_and_then_takes_a_short_one(
    bench: Bench,
) -> None:
    kept, found = old_ring(10)
    end = bench.garbage.begin(lambda: False)
    kept.clear()
    end()
    for _ in range(int(LONGEST_S)):  # another platform is at work, and rests for a second at most
        bench.moves = True
        assert bench.garbage.tick() is None
        bench.moves = False
        assert found() is not None
        done = bench.after(1.0)
    assert done is not None and done.whole and done.at_rest
    assert found() is None


def test_platforms_that_are_closed_one_after_the_other_do_not_put_that_off(bench: Bench) -> None:
    kept, found = old_ring(10)
    end = bench.garbage.begin(lambda: False)
    kept.clear()
    end()
    for _ in range(3):
        bench.moves = True
        assert bench.after(LONGEST_S / 2.0) is None
        bench.garbage.begin(lambda: False)()
    bench.moves = False
    bench.after(1.0)
    assert found() is None


def test_nothing_old_is_looked_through_while_something_moves(bench: Bench) -> None:
    kept, found = old_ring(WORTHWHILE)
    kept.clear()
    bench.moves = True
    assert bench.after(10.0) is None
    assert found() is not None
    bench.moves = False
    bench.after(1.0)
    assert found() is None


def test_motion_that_goes_on_for_ever_does_not_let_memory_grow(bench: Bench) -> None:
    bench.moves = True
    kept, found = old_ring(MOST)
    kept.clear()
    done = bench.after(1.0)
    assert found() is None
    assert done is not None
    assert not done.at_rest


def test_a_little_garbage_is_found_within_a_minute_for_it_may_hold_much(bench: Bench) -> None:
    bench.moves = True
    kept, found = old_ring(10)
    kept.clear()
    bench.after(1.0)
    assert found() is not None
    bench.after(LONGEST_S)
    assert found() is None


def test_what_was_frozen_is_looked_through_at_a_long_rest(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(garbage, "MANY_FROZEN", WORTHWHILE)
    kept, found = old_ring(WORTHWHILE)
    assert bench.after(1.0) is not None  # it survives and is frozen
    kept.clear()
    gc.collect()
    assert found() is not None
    bench.moves = True
    assert bench.after(LONG_REST_S) is None
    bench.moves = False
    done = bench.after(LONG_REST_S)
    assert found() is None
    assert done is not None
    assert done.whole


def test_frozen_objects_beyond_bounds_are_looked_through_whatever_moves(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(garbage, "MOST_FROZEN", WORTHWHILE)
    kept, found = old_ring(WORTHWHILE)
    assert bench.after(1.0) is not None
    kept.clear()
    bench.moves = True
    done = bench.after(1.0)
    assert found() is None
    assert done is not None
    assert (done.whole, done.at_rest) == (True, False)


def test_young_garbage_is_collected_by_python_as_usual(bench: Bench) -> None:
    found = weakref.ref(Ring(0))
    young = [[number] for number in range(2 * gc.get_threshold()[0])]
    assert found() is None
    assert young


def test_python_does_not_look_through_old_objects_by_itself(bench: Bench) -> None:
    seen: list[int] = []
    gc.callbacks.append(lambda _phase, info: seen.append(info["generation"]))
    kept = [[[number]] for number in range(200_000)]
    gc.callbacks.pop()
    assert kept
    assert seen
    assert 2 not in seen


def test_at_the_end_everything_is_as_it_was() -> None:
    before = gc.get_threshold()
    first, second = Garbage(), Garbage()
    end_one = first.begin(lambda: False)
    end_two = first.begin(lambda: False)
    assert gc.get_threshold() != before
    assert gc.get_freeze_count() > 0
    end_one()
    end_one()
    assert first.in_force
    assert gc.get_freeze_count() > 0
    end_two()
    assert not first.in_force
    assert gc.get_threshold() == before
    assert gc.get_freeze_count() == 0
    assert gc.isenabled()
    assert second.tick() is None


def test_what_a_script_has_set_itself_stays() -> None:
    before = gc.get_threshold()
    gc.freeze()
    try:
        end = Garbage().begin(lambda: False)
        gc.set_threshold(1000, 20, 30)
        end()
        assert gc.get_threshold() == (1000, 20, 30)
        assert gc.get_freeze_count() > 0
    finally:
        gc.unfreeze()
        gc.set_threshold(*before)


def test_a_script_that_switched_collection_off_is_obeyed(bench: Bench) -> None:
    kept, found = old_ring(WORTHWHILE)
    kept.clear()
    gc.disable()
    try:
        assert bench.after(1.0) is None
        assert found() is not None
    finally:
        gc.enable()


def in_another_thread(do: Callable[[], object]) -> None:
    thread = Thread(target=do)
    thread.start()
    thread.join()


def test_beside_a_window_only_its_own_thread_collects(bench: Bench) -> None:
    end = bench.garbage.begin(lambda: False, by_hand=True)
    kept, found = old_ring(WORTHWHILE)
    kept.clear()
    in_another_thread(lambda: bench.after(LONGEST_S))
    young = weakref.ref(Ring(garbage.YOUNG))
    in_another_thread(bench.garbage.tick_young)
    assert found() is not None
    assert young() is not None
    bench.garbage.tick_young()
    assert young() is None
    bench.after(LONGEST_S)
    assert found() is None
    end()


def test_of_two_windows_the_last_switches_collection_on_again(bench: Bench) -> None:
    first = bench.garbage.begin(lambda: False, by_hand=True)
    second = bench.garbage.begin(lambda: False, by_hand=True)
    first()
    assert not gc.isenabled()
    second()
    assert gc.isenabled()


def test_freed_memory_goes_back_to_the_system_at_a_rest_and_not_while_something_moves(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[bool] = []
    monkeypatch.setattr(garbage, "give_memory_back", lambda: given.append(bench.moves))
    bench.moves = True
    for _ in range(2):
        kept, _found = old_ring(MOST)
        kept.clear()
        assert bench.after(LONGEST_S) is not None
        bench.moves = False
    assert given == [False]


def test_objects_are_counted_while_another_thread_builds_a_tuple() -> None:
    """A list of all objects would hold the unfinished tuple, which then cannot grow."""
    ended, failed = Event(), list[BaseException]()

    def values() -> Iterator[int]:
        for number in range(60):
            if number == 1:
                gc.collect(1)  # the tuple is old from here on
            yield number

    def build() -> None:
        while not ended.is_set():
            try:
                tuple(values())
            except SystemError as exc:
                failed.append(exc)
                return

    thread = Thread(target=build)
    thread.start()
    try:
        counts = [objects_of(2) for _ in range(300)]
    finally:
        ended.set()
        thread.join()
    assert not failed
    assert min(counts) > 0


def test_source_texts_of_modules_are_given_up_and_what_was_typed_stays(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    typed = len("x"), None, ["x\n"], "<console>"
    monkeypatch.setitem(linecache.cache, "<console>", typed)
    assert linecache.getline(garbage.__file__, 1)
    bench = Bench()
    try:
        assert garbage.__file__ not in linecache.cache
        assert linecache.getline(garbage.__file__, 1), "it is read again"
        ring = old_ring(WORTHWHILE + 1)
        ring[0].clear()
        assert bench.after(1.0) is not None
        assert garbage.__file__ not in linecache.cache
    finally:
        bench.end()
    assert linecache.cache["<console>"] == typed
    try:
        raise ValueError("asked for")
    except ValueError as exc:
        assert 'raise ValueError("asked for")' in "".join(traceback.format_exception(exc))
