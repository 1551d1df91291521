"""Both generations of lens under the suite for all, over an object and over pyserial; and more."""

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from contract.peripheral_rig import PeripheralRig, terminal
from cosmic.frame.errors import DeviceTimeout, NotAvailable
from cosmic.testing.lenses import LensContract
from cosmic.vico.hw.factory import make_lens
from cosmic.vico.hw.peripherals import Lens, LensAxis

ZOOM, FOCUS = LensAxis.ZOOM, LensAxis.FOCUS
# The second generation is asked in frames first, a time-out: over a terminal once, at the end.
KINDS = [
    pytest.param((generation, way), id=f"generation {generation}, {way}")
    for generation, way in ((1, "object"), (1, "terminal"), (2, "object"))
]


class Bench:
    """One lens under test."""

    def __init__(self, kind: tuple[int, str], *, cold: bool = False) -> None:
        self.generation, self.way = kind
        self.rig = PeripheralRig(generation=self.generation, cold=cold)
        self._stack = ExitStack()
        if self.way == "terminal":
            if sys.platform == "win32":
                pytest.skip("there are no pseudo-terminals")
            path = self._stack.enter_context(terminal(self.rig.simulation.lens_line)).path
            made = make_lens("navitar", port=path, homed=not cold)
        else:
            made = make_lens("simulated", simulation=self.rig.simulation)
        assert made is not None
        self.lens: Lens = made
        self._stack.callback(self.lens.close)

    def close(self) -> None:
        self._stack.close()

    def true_counts(self, axis: LensAxis) -> float:
        return self.rig.lens.position_counts(axis.value, self.rig.clock.now_s())

    def run(self, axis: LensAxis) -> float:
        """Move the time until the motor stands; return how long it took."""
        taken_s = 0.0
        while self.lens.state(axis).moving:
            self.rig.clock.advance(0.25)
            taken_s += 0.25
            assert taken_s < 30.0
        return taken_s


class _Navitar(LensContract):
    kind: tuple[int, str]

    @pytest.fixture(autouse=True)
    def benches(self) -> Iterator[None]:
        with ExitStack() as self._benches:
            yield

    def make_lens(self) -> tuple[Lens, Callable[[float], None]]:
        bench = Bench(self.kind, cold=True)
        self._benches.callback(bench.close)
        return bench.lens, bench.rig.clock.advance


class TestFirstGeneration(_Navitar):
    kind = (1, "object")


class TestFirstGenerationOverATerminal(_Navitar):
    kind = (1, "terminal")


class TestSecondGeneration(_Navitar):
    kind = (2, "object")


@pytest.fixture(params=KINDS)
def bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    made = Bench(request.param)
    yield made
    made.close()


@pytest.fixture(params=KINDS)
def cold_bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    made = Bench(request.param, cold=True)
    yield made
    made.close()


def test_it_reports_which_generation_it_is(bench: Bench) -> None:
    assert str(bench.generation) in bench.lens.name


def test_a_warm_lens_stands_where_it_was_left(bench: Bench) -> None:
    zoom, focus = bench.lens.state(ZOOM), bench.lens.state(FOCUS)
    assert (zoom.position_counts, zoom.limit_counts) == (0, 12000)
    assert (focus.position_counts, focus.limit_counts) == (4000, 8000)
    assert zoom.homed and focus.homed and not zoom.moving and not focus.moving
    assert zoom.at_home and not focus.at_home


def test_a_seek_returns_at_once_moves_over_time_and_ends_there(bench: Bench) -> None:
    bench.lens.seek(ZOOM, 6000)
    assert bench.lens.state(ZOOM).moving and not bench.lens.state(FOCUS).moving
    bench.rig.clock.advance(0.3)
    assert 0 < bench.lens.state(ZOOM).position_counts < 6000
    bench.run(ZOOM)
    assert bench.lens.state(ZOOM).position_counts == 6000
    assert bench.true_counts(ZOOM) == pytest.approx(6000, abs=1)


def test_play_makes_no_difference_from_which_side_it_comes(bench: Bench) -> None:
    for target in (5000, 3000, 3100):
        bench.lens.seek(FOCUS, target)
        bench.run(FOCUS)
        assert bench.lens.state(FOCUS).position_counts == target
        assert bench.true_counts(FOCUS) == pytest.approx(target, abs=1)


def test_both_motors_move_at_once(bench: Bench) -> None:
    bench.lens.seek(ZOOM, 12000)
    bench.lens.seek(FOCUS, 8000)
    assert bench.lens.state(ZOOM).moving and bench.lens.state(FOCUS).moving
    bench.run(ZOOM)
    bench.run(FOCUS)
    assert bench.lens.state(ZOOM).at_limit and bench.lens.state(FOCUS).at_limit


def test_it_is_not_homed_after_power_up_and_refuses_to_seek(cold_bench: Bench) -> None:
    before = cold_bench.true_counts(ZOOM)
    assert not cold_bench.lens.state(ZOOM).homed
    with pytest.raises(NotAvailable, match="home it first"):
        cold_bench.lens.seek(ZOOM, 100)
    cold_bench.rig.clock.advance(1.0)
    assert cold_bench.true_counts(ZOOM) == before


def test_homing_makes_counts_true(cold_bench: Bench) -> None:
    bench = cold_bench
    for axis in LensAxis:
        assert bench.true_counts(axis) != pytest.approx(0.0)
        bench.lens.home(axis)
        assert not bench.lens.state(axis).homed
        bench.run(axis)
        state = bench.lens.state(axis)
        assert state.homed and state.at_home and state.position_counts == 0
        bench.lens.seek(axis, 2500)
        bench.run(axis)
        assert bench.true_counts(axis) == pytest.approx(2500, abs=1)


def test_abort_stops_both_on_the_way(bench: Bench) -> None:
    bench.lens.seek(ZOOM, 12000)
    bench.lens.seek(FOCUS, 8000)
    bench.rig.clock.advance(0.6)
    bench.lens.abort()
    bench.run(ZOOM)
    bench.run(FOCUS)
    zoom, focus = bench.lens.state(ZOOM), bench.lens.state(FOCUS)
    assert 0 < zoom.position_counts < 12000 and zoom.homed
    assert 4000 < focus.position_counts < 8000 and focus.homed
    assert bench.true_counts(ZOOM) == pytest.approx(zoom.position_counts, abs=1)


def test_it_works_through_garbage_and_lost_bytes(bench: Bench) -> None:
    faults = bench.rig.simulation.faults
    faults.inject("garbage")
    if bench.way == "object":  # each loss costs a time-out on a real line
        faults.inject("lost_bytes")
    for target in (100, 200, 300):
        bench.lens.seek(ZOOM, target)
        bench.run(ZOOM)
        assert bench.lens.state(ZOOM).position_counts == target
        assert bench.true_counts(ZOOM) == pytest.approx(target, abs=1)


def test_a_silent_controller_is_a_time_out_and_comes_back(bench: Bench) -> None:
    bench.rig.simulation.faults.inject("silent")
    with pytest.raises(DeviceTimeout, match="3 times, no answer"):
        bench.lens.state(ZOOM)
    bench.rig.simulation.faults.clear()
    assert bench.lens.state(ZOOM).position_counts == 0


def test_lost_steps_are_not_noticed_until_it_is_homed_anew(bench: Bench) -> None:
    bench.rig.simulation.faults.inject("lost_steps")
    bench.lens.seek(ZOOM, 10000)
    bench.run(ZOOM)
    assert bench.lens.state(ZOOM).position_counts == 10000
    assert bench.true_counts(ZOOM) == pytest.approx(9500, abs=1)
    bench.rig.simulation.faults.clear()
    bench.lens.home(ZOOM)
    bench.run(ZOOM)
    bench.lens.seek(ZOOM, 10000)
    bench.run(ZOOM)
    assert bench.true_counts(ZOOM) == pytest.approx(10000, abs=1)


def test_the_second_generation_over_a_terminal_homes_seeks_and_stops() -> None:
    bench = Bench((2, "terminal"), cold=True)
    try:
        bench.rig.simulation.faults.inject("garbage")
        bench.lens.home(FOCUS)
        bench.run(FOCUS)
        bench.lens.seek(FOCUS, 5000)
        bench.run(FOCUS)
        assert bench.true_counts(FOCUS) == pytest.approx(5000, abs=1)
        bench.lens.seek(FOCUS, 0)
        bench.rig.clock.advance(0.5)
        bench.lens.abort()
        bench.run(FOCUS)
        assert 0 < bench.lens.state(FOCUS).position_counts < 5000
    finally:
        bench.close()
