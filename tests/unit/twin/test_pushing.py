"""The probe and a held fibre, with stages that move as they do on the platform."""

import math

import numpy as np
import pytest

from unit.twin.force_bench import EI, FIBRE, Bench, before_the_fibre, settings, touching_y

SENSOR = 800.0
"""uN/um."""


def pushed(bench: Bench, way_um: float, speed: float = 200.0) -> Bench:
    return bench.go(speed, probe_y=touching_y(bench) - way_um)


def test_the_fibre_is_found_in_the_left_jaws_and_nothing_touches() -> None:
    bench = Bench()
    assert bench.moment.fibres[0].held_by == ("left",)
    (x0, y0, z0), (x1, y1, z1) = bench.moment.fibres[0].ends_um
    assert (x0, x1) == pytest.approx((-4800.0, -2800.0))
    assert (y0, y1, z0, z1) == pytest.approx((0.0, 0.0, 1510.0, 1510.0))
    assert bench.force_un == 0.0


@pytest.mark.parametrize("span_um", [200.0, 400.0, 600.0])
def test_the_force_is_that_of_a_cantilever_and_pushes_the_probe_back(span_um: float) -> None:
    bench = before_the_fibre(Bench(), span_um)
    for part in (0.02, 0.05, 0.1):
        pushed(bench, part * span_um)
        push = bench.push
        assert push.abscissa_um == pytest.approx(span_um, abs=0.01)
        assert push.deflection_um + push.force_un / SENSOR == pytest.approx(
            part * span_um, rel=1e-3
        )
        linear = 3.0 * EI * push.deflection_um / span_um**3
        assert push.force_un == pytest.approx(linear, rel=0.013 if span_um >= 400.0 else 0.02)
        assert bench.force_un == pytest.approx(push.force_un) and push.force_un > 0.0


def test_loading_and_unloading_give_one_curve_down_to_the_pull_off() -> None:
    bench = before_the_fibre(Bench())
    ways = [5.0, 15.0, 30.0]
    loading = [pushed(bench, way).force_un for way in ways]
    unloading = [pushed(bench, way).force_un for way in reversed(ways)]
    assert unloading[::-1] == pytest.approx(loading, rel=1e-6)
    assert pushed(bench, -0.3).force_un == pytest.approx(-0.7, abs=0.02), "it sticks"
    assert pushed(bench, -0.6).force_un == 0.0, "and comes off at 1 uN"
    assert pushed(bench, -0.3).force_un == 0.0, "it does not jump back"
    assert pushed(bench, 5.0).force_un == pytest.approx(loading[0], rel=1e-6)


def test_the_probe_is_not_the_fibre_until_it_gets_there() -> None:
    bench = before_the_fibre(Bench())
    assert pushed(bench, -0.01).force_un == 0.0
    assert pushed(bench, 0.01).force_un > 0.0


@pytest.mark.parametrize("speed", [20_000.0, 20.0])
def test_the_probe_does_not_tunnel_at_any_speed(speed: float) -> None:
    bench = before_the_fibre(Bench())
    end_s = bench.start({"probe.y": touching_y(bench) - 60.0}, speed)
    times = np.arange(bench.now_s, end_s + 0.01, 1e-4)
    force = bench.force_side.timeline.force_un(times)
    bench.now_s = end_s + 0.01
    assert bench.push.deflection_um == pytest.approx(60.0, rel=0.01)
    assert (np.diff(force) > -1e-9).all(), "it only rises"
    pushed_um = np.maximum((times - bench.now_s + 0.01) * speed + 60.0, 0.0).clip(max=60.0)
    expected = np.interp(pushed_um, *some_forces())
    assert force == pytest.approx(expected, abs=0.3 if speed < 1000.0 else 12.0)


def some_forces() -> tuple[list[float], list[float]]:
    bench, ways = before_the_fibre(Bench()), [10.0 * number for number in range(7)]
    return ways, [pushed(bench, way).force_un for way in ways]


def test_one_step_of_the_clock_through_the_fibre_is_a_push_too() -> None:
    bench = Bench(settings(step_s=0.01))  # 200 um a look at 20 mm/s
    before_the_fibre(bench).go(20_000.0, probe_y=-5100.0)
    assert bench.push.deflection_um == pytest.approx(115.0, rel=0.01)


def test_a_fibre_slides_off_when_it_is_bent_too_far_and_the_probe_stands_beside() -> None:
    bench = before_the_fibre(Bench(settings(FIBRE.model_copy(update={"free_um": 440.0}))))
    assert pushed(bench, 60.0).force_un > 50.0
    assert pushed(bench, 250.0).force_un == 0.0
    assert pushed(bench, 100.0).force_un == 0.0
    assert pushed(bench, -10.0).force_un == 0.0
    assert pushed(bench, 10.0).force_un > 10.0


@pytest.mark.parametrize("away", [{"left_x": 2000.0}, {"left_z": -780.0}, {"left_z": -860.0}])
def test_the_fibre_is_lost_when_it_is_carried_away_sideways(away: dict[str, float]) -> None:
    bench = pushed(before_the_fibre(Bench()), 20.0)
    assert bench.force_un > 20.0
    assert bench.go(**away).force_un == 0.0


def test_a_probe_above_or_below_the_fibre_passes_it() -> None:
    bench = before_the_fibre(Bench()).go(left_z=-850.0)
    assert pushed(bench, 50.0).force_un == 0.0


def test_pushing_while_the_span_changes_slides_along_the_fibre() -> None:
    bench = pushed(before_the_fibre(Bench()), 20.0)
    bench.go(left_x=3400.0)
    linear = 3.0 * EI * bench.push.deflection_um / 600.0**3
    assert bench.force_un == pytest.approx(linear, rel=0.01)
    assert bench.push.abscissa_um == pytest.approx(600.0)


def test_moving_the_fibre_against_the_probe_is_pushing_too() -> None:
    by_probe = pushed(before_the_fibre(Bench()), 20.0).force_un
    bench = pushed(before_the_fibre(Bench()), 0.0)
    assert bench.go(left_y=20.0).force_un == pytest.approx(by_probe, rel=1e-3)


def test_a_jaw_is_as_stiff_as_the_sensor() -> None:
    # The probe above the jaws' flank: its outer face stands at 100 um + half the gap.
    bench = Bench().go(left_x=4200.0).go(left_z=-810.0)
    face = -5000.0 + 15.0 + 100.0
    assert bench.go(probe_y=face + 0.05).force_un == 0.0
    assert bench.go(20.0, probe_y=face - 0.1).force_un == pytest.approx(0.1 * SENSOR, rel=1e-3)
    moment = bench.moment
    assert moment.jaw_un == moment.force_un and moment.pushes == ()
    assert bench.go(probe_y=face + 1.0).force_un == 0.0


def test_the_clamp_lies_somewhat_inside_the_jaws_and_differs_for_each_seed() -> None:
    spread = {"clamp_depth_um": 8.0, "clamp_depth_spread_um": 4.0}
    forces = [
        pushed(before_the_fibre(Bench(settings(**spread), seed)), 10.0).force_un
        for seed in range(12)
    ]
    depths = (3.0 * EI * 10.0 / np.array(forces)) ** (1.0 / 3.0) - 400.0
    assert depths.min() >= -1.0 and 3.0 < depths.mean() < 13.0 and depths.std() > 1.0


def test_no_clamp_lies_in_front_of_the_jaws() -> None:
    spread = {"clamp_depth_um": 0.0, "clamp_depth_spread_um": 100.0}
    forces = [
        pushed(before_the_fibre(Bench(settings(**spread), seed)), 10.0).force_un
        for seed in range(6)
    ]
    assert max(forces) == pytest.approx(3.0 * EI * 10.0 / 400.0**3, rel=0.01)


def test_friction_shows_between_loading_and_unloading() -> None:
    bench = before_the_fibre(Bench(settings(probe_friction=0.4, friction_turn_um=0.3)))
    out = pushed(bench, 60.0).force_un
    pushed(bench, 80.0)
    back = pushed(bench, 60.0).force_un
    assert out > 1.05 * back
    smooth = before_the_fibre(Bench(settings()))
    assert back < pushed(smooth, 60.0).force_un < out


def test_jaws_that_give_way_make_a_fibre_seem_softer() -> None:
    rigid = pushed(before_the_fibre(Bench()), 5.0).force_un
    stiff = 3.0 * EI / 400.0**3
    soft = pushed(before_the_fibre(Bench(settings(jaw_side_un_um=10.0))), 5.0).force_un
    assert rigid / soft == pytest.approx(1.0 + stiff / 10.0, rel=5e-3)
    turned = pushed(before_the_fibre(Bench(settings(jaw_turn_deg=0.02))), 5.0).force_un
    assert rigid / turned == pytest.approx(
        1.0 + stiff * math.radians(0.02) * 1e-3 * 400.0**2, rel=5e-3
    )


def test_a_stiffness_that_varies_along_the_fibre_is_that_of_the_span() -> None:
    varied = FIBRE.model_copy(update={"ei_variation": 0.25})
    apart = []
    for seed in range(5):
        bench = before_the_fibre(Bench(settings(varied), seed))
        apart.append(pushed(bench, 5.0).force_un * 400.0**3 / (15.0 * EI))
    assert 0.05 < float(np.std(apart)) < 0.4
    assert 0.6 < float(np.mean(apart)) < 1.5


# --- through the sensor -----------------------------------------------------------------------


def test_the_sensor_turns_the_push_into_volts() -> None:
    bench = pushed(before_the_fibre(Bench()), 30.0)
    sensor = bench.force_side.sensors["force"]
    volts = sensor.volts(bench.now_s + np.arange(3000) / 15_000.0)
    expected = sensor.true_zero_v + sensor.true_gain_v_un * bench.push.force_un
    assert volts.mean() == pytest.approx(expected, abs=0.001)
    assert volts.std() == pytest.approx(0.003, rel=0.3)


def test_the_sensor_saturates_on_a_jaw() -> None:
    bench = Bench().go(left_x=4200.0).go(left_z=-810.0).go(probe_y=-4890.0)
    volts = bench.force_side.sensors["force"].volts(bench.now_s + np.arange(100) / 15_000.0)
    assert volts.max() == pytest.approx(4.3)


# --- who looks when ---------------------------------------------------------------------------


def campaign(bench: Bench) -> None:
    before_the_fibre(bench)
    for way in (10.0, 30.0, 5.0, 40.0):
        bench.go(300.0, probe_y=touching_y(bench) - way).wait(0.05)


def test_the_past_is_the_same_whether_it_is_looked_at_often_or_late() -> None:
    late, often = Bench(), Bench()
    campaign(late)
    times = np.arange(late.now_s - 1.0, late.now_s, 1.0 / 15_000.0)
    seen_late = late.force_side.timeline.force_un(times)

    parts, ends = [], iter(times)
    assert next(ends) == times[0]
    real_go = often.go

    def go_and_look(speed: float = 2000.0, **target: float) -> Bench:
        real_go(speed, **target)
        often.force_side.timeline.force_un(np.array([often.now_s]))
        return often

    often.go = go_and_look  # type: ignore[method-assign]
    campaign(often)
    for start in range(0, times.size, 75):
        parts.append(often.force_side.timeline.force_un(times[start : start + 75]))
    assert np.concatenate(parts) == pytest.approx(seen_late, abs=0.3)
    assert seen_late.max() > 80.0


def test_a_minute_at_rest_costs_a_few_looks() -> None:
    bench = pushed(before_the_fibre(Bench()), 20.0)
    force = bench.force_un
    bench.wait(60.0)
    times = np.linspace(bench.now_s - 60.0, bench.now_s, 600)
    assert bench.force_side.timeline.force_un(times) == pytest.approx(force, rel=1e-3)


def test_a_long_journey_that_nobody_watched_ends_where_it_should() -> None:
    bench = before_the_fibre(Bench())
    bench.go(0.25, probe_y=touching_y(bench) - 10.0)  # two minutes
    assert bench.push.deflection_um == pytest.approx(10.0, rel=0.01)


def test_no_times_give_no_forces() -> None:
    assert Bench().force_side.timeline.force_un(np.empty(0)).shape == (0,)
