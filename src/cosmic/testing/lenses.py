"""The contract of a `Lens`, as a suite for pytest.

A package that brings one derives from `LensContract` and says how its lens is made over a fake that
was just switched on, and how time goes on for it::

    class TestMyLens(LensContract):
        def make_lens(self) -> tuple[Lens, Callable[[float], None]]:
            clock = ManualClock()
            return MyLens(FakeLens(clock)), clock.advance
"""

from abc import abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest

from cosmic.frame.errors import ConfigError, DeviceError, DeviceFault, NotAvailable
from cosmic.vico.hw.peripherals import Lens, LensAxis

_LOOK_S = 0.1
_LONGEST_S = 120.0
AXES = pytest.mark.parametrize("axis", list(LensAxis))


@dataclass
class OpenLens:
    """A lens under test, and what lets its time go on."""

    lens: Lens
    go_on: Callable[[float], None]

    def at(self, axis: LensAxis) -> int:
        """Wait until a motor is stationary, and return where it is."""
        waited_s = 0.0
        while (state := self.lens.state(axis)).moving:
            assert waited_s < _LONGEST_S, f"the {axis} moves for more than {_LONGEST_S:g} s"
            self.go_on(_LOOK_S)
            waited_s += _LOOK_S
        return state.position_counts

    def homed(self, axis: LensAxis) -> int:
        """Home a motor; return its far end."""
        self.lens.home(axis)
        self.at(axis)
        assert self.lens.state(axis).homed
        return self.lens.state(axis).limit_counts


class LensContract:
    """What ViCo relies on in any lens."""

    @abstractmethod
    def make_lens(self) -> tuple[Lens, Callable[[float], None]]:
        """Return the lens over its fake, just switched on, and what lets time go on by seconds."""

    @pytest.fixture
    def it(self) -> Iterator[OpenLens]:
        """The lens; closed afterwards."""
        lens, go_on = self.make_lens()
        yield OpenLens(lens, go_on)
        lens.close()

    def test_it_has_a_name_and_two_motors_with_a_travel(self, it: OpenLens) -> None:
        assert it.lens.name
        for axis in LensAxis:
            state = it.lens.state(axis)
            assert state.limit_counts > 0
            assert not state.moving, "opening it moves nothing"

    @AXES
    def test_before_its_position_is_known_it_moves_nowhere_but_home(
        self, it: OpenLens, axis: LensAxis
    ) -> None:
        before = it.lens.state(axis)
        if before.homed:  # it knows its position from the start
            assert 0 <= before.position_counts <= before.limit_counts
            return
        with pytest.raises(NotAvailable):
            it.lens.seek(axis, before.limit_counts // 2)
        it.go_on(1.0)
        after = it.lens.state(axis)
        assert (after.moving, after.position_counts) == (False, before.position_counts)

    @AXES
    def test_homing_ends_at_zero(self, it: OpenLens, axis: LensAxis) -> None:
        it.homed(axis)
        state = it.lens.state(axis)
        assert (state.position_counts, state.at_home) == (0, True)

    @AXES
    def test_a_homing_that_was_ended_early_is_none(self, it: OpenLens, axis: LensAxis) -> None:
        it.lens.seek(axis, it.homed(axis))
        it.at(axis)
        it.lens.home(axis)
        it.lens.abort()
        assert it.at(axis) > 0
        assert not it.lens.state(axis).homed
        with pytest.raises(NotAvailable):
            it.lens.seek(axis, 1)

    @AXES
    def test_a_target_is_reached_from_both_sides(self, it: OpenLens, axis: LensAxis) -> None:
        limit = it.homed(axis)
        for target in (limit // 2, limit // 4, limit, 0):
            it.lens.seek(axis, target)
            assert it.at(axis) == target

    def test_seek_returns_before_it_is_there(self, it: OpenLens) -> None:
        limit = it.homed(LensAxis.ZOOM)
        it.lens.seek(LensAxis.ZOOM, limit)
        state = it.lens.state(LensAxis.ZOOM)
        assert state.moving
        assert state.position_counts < limit

    def test_abort_stops_both_while_they_move(self, it: OpenLens) -> None:
        limits = {axis: it.homed(axis) for axis in LensAxis}
        for axis, limit in limits.items():
            it.lens.seek(axis, limit)
        it.go_on(_LOOK_S)
        it.lens.abort()
        for axis, limit in limits.items():
            assert 0 <= it.at(axis) < limit
            assert it.lens.state(axis).homed

    @AXES
    def test_a_target_off_the_travel_is_refused_and_nothing_moves(
        self, it: OpenLens, axis: LensAxis
    ) -> None:
        limit = it.homed(axis)
        for target in (-1, limit + 1, 2**31, -(2**31)):
            with pytest.raises(ConfigError):
                it.lens.seek(axis, target)
        assert not it.lens.state(axis).moving
        assert it.at(axis) == 0

    def test_closing_twice_is_harmless_and_afterwards_it_is_closed(self, it: OpenLens) -> None:
        it.lens.close()
        it.lens.close()
        with pytest.raises(DeviceError) as caught:
            it.lens.state(LensAxis.ZOOM)
        assert caught.value.fault is DeviceFault.STATE
