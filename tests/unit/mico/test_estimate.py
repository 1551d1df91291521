"""An axis without sensor: bounds, uncertainty, end stops, and what somebody saw."""

import math
from contextlib import contextmanager

import pytest
from hypothesis import given
from hypothesis import strategies as st

import cosmic
from cosmic.frame.verdict import Reason
from cosmic.mico.core.collision.checker import AxisSpan
from cosmic.mico.core.motion.positioner import CountedTravel
from unit.mico import rigs
from unit.mico.rigs import mico, wait_until

NAME = "d0.c2"
TRAVEL = CountedTravel(0.0, 1000.0, 1.0, 0.1, 20.0)


@contextmanager
def gripper(monkeypatch, **more):
    made = rigs.settings

    def with_travel(*args, **changes):
        found = made(*args, **changes)
        axes = [
            each.model_copy(
                update={"travel_um": (0.0, 1000.0), "step_um": 1.0, "start_um": 600.0} | more
            )
            if each.kind == "open-loop"
            else each
            for each in found.positioner
        ]
        return found.model_copy(update={"positioner": tuple(axes)})

    monkeypatch.setattr(rigs, "settings", with_travel)
    with mico() as (rig, controller):
        yield rig, rig[NAME], controller


def made(axis, steps):
    axis.steps(steps, frequency_hz=18500)
    return axis.position_um, axis.position_std_um


def test_at_the_start_nobody_knows_and_the_uncertainty_grows_from_what_is_set(monkeypatch):
    with gripper(monkeypatch) as (_, axis, controller):
        assert (axis.position_um, axis.position_std_um) == (600.0, math.inf)
        axis.set_estimate(500.0, std_um=4.0)
        assert (axis.position_um, axis.position_std_um) == (500.0, 4.0)
        controller.instant = False
        movement = axis.steps(-10, wait=False)
        wait_until(lambda: axis.details.in_motion)
        with pytest.raises(cosmic.NotAvailable, match="is moving"):
            axis.set_estimate(1.0)
        controller.end(axis.details.address)
        movement.wait(2)
        assert axis.position_std_um > 4.0


def test_closing_counts_to_the_end_stop_and_not_beyond_it(monkeypatch):
    with gripper(monkeypatch) as (_, axis, controller):
        axis.set_estimate(600.0, std_um=5.0)
        with pytest.raises(cosmic.LimitError, match="end stop") as refused:
            axis.steps(-1400)
        verdict = refused.value.verdict
        assert (verdict.value, verdict.limit, verdict.unit) == (-800.0, 0.0, "um")
        assert "600.0 µm ± 5.0 µm" in verdict.text
        assert not controller.of("step")


def test_steps_against_a_stop_end_in_a_refusal_and_those_to_the_inside_never(monkeypatch):
    with gripper(monkeypatch) as (_, axis, _):
        axis.set_estimate(0.0, std_um=0.0)
        with pytest.raises(cosmic.LimitError):
            axis.steps(-100)
        assert axis.steps(5) is not None
        axis.set_estimate(1000.0, std_um=0.0)
        with pytest.raises(cosmic.LimitError):
            axis.steps(100)
        axis.set_estimate(400.0, std_um=None)
        axis.steps(-1400)  # nobody knows: it may be open wide


def test_an_estimate_is_finite_within_the_travel_and_for_axes_without_sensor(monkeypatch):
    with gripper(monkeypatch) as (rig, axis, _):
        for position in (-1.0, 1001.0):
            with pytest.raises(cosmic.LimitError, match="beyond its end stop"):
                axis.set_estimate(position)
        for position, std in ((math.nan, 1.0), (1.0, -1.0), (1.0, math.nan)):
            with pytest.raises(cosmic.MoveRefused) as refused:
                axis.set_estimate(position, std_um=std)
            assert refused.value.verdict.reason is Reason.NOT_FINITE
        with pytest.raises(cosmic.NotAvailable, match="has a sensor"):
            rig["d0.c0"].set_estimate(1.0)
        assert rig["d0.c0"].position_std_um == 0.0
        axis.set_zero()
        axis.set_estimate(0.0)
        assert axis.details.position == 600.0


def test_a_rescan_keeps_what_is_known_of_an_estimate(monkeypatch):
    with gripper(monkeypatch) as (rig, axis, _):
        axis.set_estimate(123.0, std_um=7.0)
        rig.application.manager.rescan()
        assert (axis.position_um, axis.position_std_um) == (123.0, 7.0)


def test_the_gate_looks_at_the_estimate_and_three_deviations_around_it(monkeypatch):
    with gripper(monkeypatch) as (rig, axis, _):
        gate = rig.application.manager.gate
        assert gate.spans()[NAME].spread is None, "anywhere in its travel"
        axis.set_estimate(100.0, std_um=4.0)
        span = gate.spans()[NAME]
        assert span == AxisSpan(100.0, 100.0, 100.0, estimated=True, spread=12.0)


@given(
    st.floats(0.0, 1000.0),
    st.floats(0.0, 200.0),
    st.lists(st.tuples(st.floats(-1300.0, 1300.0), st.floats(0.72, 1.28)), max_size=12),
    st.floats(-2.9, 2.9),
)
def test_the_true_position_stays_within_three_deviations_whatever_a_step_is_worth(
    position, std, ways, off
):
    truth = min(max(position + off * std, 0.0), 1000.0)
    for way, worth in ways:
        truth = min(max(truth + way * worth, 0.0), 1000.0)
        position, std = TRAVEL.after(position, std, way)
        place = TRAVEL.around(position, std)
        assert place.low - 1e-6 <= truth <= place.high + 1e-6
        assert 0.0 <= position <= 1000.0


def test_a_run_that_must_have_reached_its_stop_sets_the_estimate():
    assert TRAVEL.after(600.0, math.inf, -1430.0) == (0.0, 20.0)
    assert TRAVEL.after(600.0, math.inf, -1100.0) == (0.0, math.inf)
    assert TRAVEL.after(600.0, 5.0, 700.0) == (1000.0, 20.0)
    assert TRAVEL.after(500.0, 5.0, 100.0) == (600.0, 15.0)
