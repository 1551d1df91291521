"""Each effect of the twin switched on alone, seen through the simplest formula that one could use.

The lever formula takes a push for one along the probe's axis, and the fibre for an even straight
rod: k^(-1/3) over the lever is a straight line, its slope gives EI, its end the clamp. It stands
here and nowhere else.
"""

import math
from dataclasses import dataclass

import numpy as np
import pytest

from cosmic.frame.clock import ManualClock
from cosmic.twin.climate import Climate
from cosmic.twin.force_settings import ClimateSettings
from cosmic.twin.optics.projection import Projection
from cosmic.twin.scene import Scene
from cosmic.twin.settings import TwinSettings, shipped_settings
from cosmic.twin.world import World
from unit.twin.force_bench import EI, FIBRE, Bench, Heard, settings

SENSOR = 800.0
SPANS_UM = (600.0, 450.0, 300.0)
TURNED_UM = 1300.0


@dataclass
class Fit:
    """What the lever formula makes of three spans."""

    ei_off: float
    clamp_um: float
    loop: float
    """Mean difference of load and unload over the mean force."""


def lever_fit(twin: TwinSettings, seed: int = 0, stroke: float = 0.05) -> Fit:
    bench = Bench(twin, seed)
    levers, roots, loops = [], [], []
    for span in SPANS_UM:
        bench.go(left_x=4000.0 - span).go(left_z=-810.0)
        state = bench.moment.fibres[0]
        x, y, _ = state.line_um[np.argsort(state.line_um[:, 0])].T
        tips = bench.scene.tips(bench.now_s)
        touch = -5000.0 + 0.5 * state.seen_um + float(np.interp(tips["probe"][0], x, y))
        bench.go(probe_y=touch + 20.0)
        ways = np.linspace(0.2, 1.0, 6) * stroke * span
        load = np.array([signal(bench.go(200.0, probe_y=touch - way)) for way in ways])
        unload = np.array([signal(bench.go(200.0, probe_y=touch - way)) for way in ways[::-1]])
        bench.go(200.0, probe_y=touch + 20.0)
        force = 0.5 * (load + unload[::-1])
        stiffness = 1.0 / (1.0 / np.polyfit(ways, force, 1)[0] - 1.0 / SENSOR)
        at = np.linspace(0.0, span, 800)
        high = np.interp(at + tips["left.hold"][0], x, y)
        arms = span - 0.5 * (at[1:] + at[:-1])
        inertia = float((arms**2 * np.hypot(np.diff(at), np.diff(high))).sum())
        levers.append((3.0 * inertia) ** (1.0 / 3.0))
        roots.append(stiffness ** (-1.0 / 3.0))
        loops.append(float((load - unload[::-1]).mean() / force.mean()))
    slope, root = np.polyfit(levers, roots, 1)
    return Fit(1.0 / (3.0 * slope**3) / EI - 1.0, root / slope, float(np.mean(loops)))


def signal(bench: Bench) -> float:
    """What the sensor would tell without noise, uN."""
    sensor = bench.force_side.sensors["force"]
    times = np.array([bench.now_s])
    return float(sensor._force_un(times)[0])


def with_fibre(**changed: float) -> TwinSettings:
    return settings(FIBRE.model_copy(update=changed))


def with_contact(**contact: float) -> TwinSettings:
    return settings(**contact)


def with_world(**session: float) -> TwinSettings:
    return World(session={key.replace("__", "."): each for key, each in session.items()}).applied(
        settings(), 0
    )


def off(twin: TwinSettings, seed: int = 0) -> float:
    """By how much EI is off, less what the finite stroke of a plain fibre does."""
    return lever_fit(twin, seed).ei_off - PLAIN.ei_off


PLAIN = Fit(-0.0084, -1.7, 0.0)


def test_without_any_effect_the_lever_formula_is_right_but_for_the_stroke() -> None:
    plain = lever_fit(settings())
    assert plain.ei_off == pytest.approx(PLAIN.ei_off, abs=0.001)
    assert plain.clamp_um == pytest.approx(PLAIN.clamp_um, abs=0.2)
    assert plain.loop == pytest.approx(0.0, abs=1e-6)


# --- the fibre --------------------------------------------------------------------------------


@pytest.mark.parametrize(("turn_deg", "expected"), [(10, -0.014), (25, -0.086), (45, -0.25)])
def test_an_arc_comes_out_too_soft_by_as_much_as_its_slope_says(
    turn_deg: float, expected: float
) -> None:
    # Both ways round: a finite push straightens one and bends the other more.
    turn = turn_deg * FIBRE.length_um / TURNED_UM
    both = [lever_fit(with_fibre(curl_deg=side * turn), stroke=0.02) for side in (1.0, -1.0)]
    assert np.mean([each.ei_off for each in both]) == pytest.approx(
        expected, abs=0.01 if turn_deg < 45 else 0.02
    )


def test_a_stiffness_that_varies_along_the_fibre_scatters_the_formula() -> None:
    found = [lever_fit(with_fibre(ei_variation=0.25), seed) for seed in range(8)]
    assert 0.06 < np.std([each.ei_off for each in found]) < 0.35, "10 % median, 22 % worst"
    assert max(abs(each.clamp_um) for each in found) > 10.0, "clamps that cannot be"


def test_weak_places_make_it_softer() -> None:
    assert off(with_fibre(hinges_per_mm=5.0)) < -0.05


def test_a_ribbon_is_as_stiff_as_its_plane_of_bending_says() -> None:
    ribbon = {"plane_ratio": 4.0}
    assert off(with_fibre(orientation_deg=0.0, **ribbon)) == pytest.approx(0.0, abs=0.005)
    assert off(with_fibre(orientation_deg=90.0, **ribbon)) == pytest.approx(3.0, abs=0.05)
    # Askew, it gives way by the mean of both planes: 1 / (0.5 + 0.5 / 4).
    assert off(with_fibre(orientation_deg=45.0, **ribbon)) == pytest.approx(0.6, abs=0.02)


def test_a_twisted_ribbon_differs_along_the_fibre() -> None:
    twisted = lever_fit(with_fibre(plane_ratio=4.0, orientation_deg=-40.0, twist_deg_mm=60.0))
    assert abs(twisted.clamp_um - PLAIN.clamp_um) > 5.0


def test_a_ribbon_shows_how_it_is_turned() -> None:
    seen = [
        Bench(with_fibre(plane_ratio=4.0, orientation_deg=angle)).moment.fibres[0].seen_um
        for angle in (0.0, 45.0, 90.0)
    ]
    assert seen == pytest.approx([8.0, math.hypot(8.0, 30.0) / math.sqrt(2.0), 30.0])


def test_shear_counts_where_spans_are_short() -> None:
    sheared = lever_fit(with_fibre(shear_ratio=300.0))
    # 300 * 8^2 / (4 * 0.83 * a^2): 6.4 % at 300 um, 1.6 % at 600 um.
    assert sheared.clamp_um > PLAIN.clamp_um + 5.0
    assert sheared.ei_off > PLAIN.ei_off + 0.01


def test_a_round_fibre_shears_as_one_as_thick_as_it_looks() -> None:
    flat = lever_fit(with_fibre(shear_ratio=12.0))
    round_one = lever_fit(with_fibre(shear_ratio=12.0, thick_as_wide=True))
    assert abs(flat.ei_off - PLAIN.ei_off) < 0.005, "8 um thick it hardly shears"
    assert round_one.clamp_um > flat.clamp_um + 3.0


def test_a_fibre_that_relaxes_comes_out_too_soft_and_makes_a_loop() -> None:
    slow = lever_fit(with_fibre(relaxation_per_decade=0.1))
    assert slow.ei_off - PLAIN.ei_off == pytest.approx(-0.10, abs=0.04)
    assert slow.loop > 0.01


def test_a_dwell_shows_the_relaxation_of_each_decade() -> None:
    bench = Bench(with_fibre(relaxation_per_decade=0.05))
    bench.go(left_x=3600.0).go(left_z=-810.0).go(probe_y=-4965.0)
    bench.go(2000.0, probe_y=-5005.0)
    begin_s = bench.now_s
    bench.wait(120.0)
    times = begin_s + np.array([1.0, 10.0, 100.0])
    one, ten, hundred = bench.force_side.timeline.force_un(times)
    assert ten / one == pytest.approx(0.955, abs=0.012)
    assert hundred / ten == pytest.approx(0.955, abs=0.012)


def test_a_push_beyond_yield_leaves_the_fibre_bent() -> None:
    def contact_lost_at(strain: float) -> float:
        bench = Bench(with_fibre(yield_strain=strain))
        bench.go(left_x=3800.0).go(left_z=-810.0).go(probe_y=-4965.0)
        bench.go(100.0, probe_y=-5015.0)
        way = 15.0
        while bench.go(100.0, probe_y=-4985.0 - way).force_un > 0.0:
            way -= 0.25
        return way

    assert contact_lost_at(0.02) == pytest.approx(0.0, abs=0.3)
    assert contact_lost_at(0.004) > 2.0


def test_stiffness_follows_the_humidity() -> None:
    damp = settings(FIBRE.model_copy(update={"ei_per_rh": -0.005}))
    damp = damp.model_copy(update={"climate": ClimateSettings(rh_percent=70.0)})
    assert off(damp) == pytest.approx(-0.10, abs=0.003)


# --- tools and contact ------------------------------------------------------------------------


def test_a_deep_clamp_shows_as_the_end_of_the_line() -> None:
    deep = lever_fit(with_contact(clamp_depth_um=30.0))
    assert deep.ei_off == pytest.approx(PLAIN.ei_off, abs=0.003)
    assert deep.clamp_um == pytest.approx(30.0 + PLAIN.clamp_um, abs=0.5)


def test_jaws_that_give_way_make_it_softer_as_stiff_springs_in_line_do() -> None:
    at_300 = 3.0 * EI / 300.0**3
    soft = lever_fit(with_contact(jaw_side_un_um=100.0))
    assert at_300 / 100.0 == pytest.approx(0.056, abs=0.001)
    assert soft.ei_off - PLAIN.ei_off > 0.01, "the slope of the line rises"
    turned = lever_fit(with_contact(jaw_turn_deg=0.05))
    assert turned.clamp_um > PLAIN.clamp_um + 10.0


def test_friction_makes_a_loop() -> None:
    rubbed = lever_fit(with_contact(probe_friction=0.4))
    assert 0.005 < abs(rubbed.loop) < 0.2
    assert abs(rubbed.ei_off - PLAIN.ei_off) < 0.05
    curled = settings(
        FIBRE.model_copy(update={"curl_deg": 30.0 * FIBRE.length_um / TURNED_UM}),
        probe_friction=0.4,
    )
    assert lever_fit(curled).loop > 0.03


@pytest.mark.parametrize("curl_deg", [-60.0, -25.0, 0.0, 25.0, 60.0])
def test_friction_takes_work_whichever_way_a_fibre_is_curled(curl_deg: float) -> None:
    curled = FIBRE.model_copy(update={"curl_deg": curl_deg * FIBRE.length_um / TURNED_UM})
    assert lever_fit(settings(curled, probe_friction=0.35)).loop > 0.005


def test_friction_holds_a_ribbon_that_stands_askew() -> None:
    askew = {"plane_ratio": 4.0, "orientation_deg": 45.0}
    free = lever_fit(with_fibre(**askew))
    held = lever_fit(settings(FIBRE.model_copy(update=askew), probe_friction=0.3))
    assert held.loop > free.loop + 0.1


def test_a_ribbon_that_friction_holds_altogether_is_too_stiff_both_ways() -> None:
    steep = FIBRE.model_copy(update={"plane_ratio": 4.0, "orientation_deg": 75.0})
    free, held = (lever_fit(settings(steep, probe_friction=each)) for each in (0.0, 0.3))
    cos, sin = math.cos(math.radians(75.0)), math.sin(math.radians(75.0))
    across, askew, up = cos**2 + sin**2 / 4.0, 0.75 * cos * sin, sin**2 + cos**2 / 4.0
    assert askew / up < 0.3, "friction can hold it"
    stiffer = (1.0 + held.ei_off) / (1.0 + free.ei_off)
    assert stiffer == pytest.approx(1.0 / (1.0 - askew**2 / (across * up)), abs=0.02)
    assert abs(held.loop) < 0.02, "no loop tells"


def test_friction_lets_go_as_much_one_way_as_the_other_once_a_fibre_was_slid() -> None:
    steep = FIBRE.model_copy(update={"plane_ratio": 4.0, "orientation_deg": 75.0})
    forces = {}
    for friction in (0.0, 0.3):
        bench = Bench(settings(steep, probe_friction=friction))
        bench.go(left_x=3600.0).go(left_z=-810.0)
        touch = -5000.0 + 0.5 * bench.moment.fibres[0].seen_um
        read = [bench.go(200.0, probe_y=touch + 20.0).go(200.0, probe_y=touch - 2.0).force_un]
        for side in (10.0, -10.0):
            read.append(bench.go(left_z=-810.0 + side).go(left_z=-810.0).force_un)
        forces[friction] = read
    free, (before, up, down) = forces[0.0][0], forces[0.3]
    assert forces[0.0] == pytest.approx([free] * 3), "without friction nothing changes"
    assert before > 1.05 * free
    assert abs(up - down) > 0.1 * free
    assert 2.0 / (1.0 / up + 1.0 / down) == pytest.approx(free, rel=0.01)


def test_friction_does_not_turn_round_while_the_probe_stands_and_the_fibre_creeps() -> None:
    askew = {"plane_ratio": 8.0, "orientation_deg": 60.0, "relaxation_per_decade": 0.03}
    bench = Bench(settings(FIBRE.model_copy(update=askew), probe_friction=0.35), 0)
    bench.go(left_x=3600.0).go(left_z=-810.0)
    state = bench.moment.fibres[0]
    x, y, _ = state.line_um[np.argsort(state.line_um[:, 0])].T
    at = bench.scene.tips(bench.now_s)["probe"][0]
    touch = -5000.0 + 0.5 * state.seen_um + float(np.interp(at, x, y))
    bench.go(probe_y=touch + 20.0)
    soon = signal(bench.go(200.0, probe_y=touch - 12.0))
    later = [signal(bench.wait(0.02)) for _ in range(40)][-1]
    assert 0.85 * soon < later < soon, "it relaxes by some per cent in each decade, and no more"


def test_a_soft_probe_goes_along_on_a_curled_fibre() -> None:
    curl = FIBRE.model_copy(update={"curl_deg": 45.0 * FIBRE.length_um / TURNED_UM})
    stiff, soft = (lever_fit(settings(curl, probe_side_un_um=each)).ei_off for each in (1e9, 5.0))
    assert 0.003 < abs(soft - stiff) < 0.1


def test_the_probe_touches_beside_the_place_where_it_is_seen() -> None:
    shifted = lever_fit(with_world(geometry__probe_contact_um=3.0))
    assert shifted.clamp_um == pytest.approx(PLAIN.clamp_um + 3.0, abs=0.2)


def test_a_charged_fibre_jumps_to_the_probe() -> None:
    def pull_before_contact(charge: float) -> float:
        bench = Bench(with_fibre(charge_uc_m2=charge))
        bench.go(left_x=3600.0).go(left_z=-810.0).go(probe_y=-4975.0)
        end_s = bench.start({"probe.y": -4985.2}, 2.0)
        return float(bench.force_side.timeline.force_un(np.arange(bench.now_s, end_s, 0.002)).min())

    assert pull_before_contact(0.0) == 0.0
    assert pull_before_contact(2.0) < -0.1


def test_a_charged_ribbon_on_edge_is_pushed_though_its_jump_does_not_hold() -> None:
    ribbon = with_fibre(charge_uc_m2=2.0, plane_ratio=10.0, orientation_deg=80.0)
    bench = Bench(ribbon).go(left_x=3600.0).go(left_z=-810.0).go(probe_y=-4975.0)
    for step in range(8):
        bench.go(probe_y=-4975.0 - 2.5 * step)
    end_s = bench.start({"probe.y": -4995.0}, 2.0)
    assert bench.force_side.timeline.force_un(np.array([bench.now_s, end_s]))[-1] > 5.0


def test_a_fibre_that_sticks_more_than_it_is_held_stays_on_the_plate() -> None:
    def lifted(**more: float) -> list[str]:
        grip = more.pop("grip_un")
        lying = FIBRE.model_copy(update={"held_by": "", "free_um": 0.0, "x_um": -1000.0, **more})
        heard = Heard()
        twin = settings(lying, start={"left.gripper": 300.0}, jaw_grip_un=grip)
        sticky = World(session={"handling.adhesion_un": 1.0, "handling.adhesion_sigma_ln": 0.0})
        bench = Bench(sticky.applied(twin, 0), truth=heard)
        x, y, z = bench.scene.tips(bench.now_s)["left.hold"]
        bench.go(left_x=-1400.0 - x, left_y=-y).go(left_z=5.0 - z).go(left_gripper=20.0)
        bench.go(50.0, left_z=100.0 - z).moment  # noqa: B018 - looked at
        return heard.names

    assert "lifted" in lifted(adhesion_un_mm=5.0, grip_un=150.0)
    failed = lifted(adhesion_un_mm=60.0, grip_un=50.0)
    assert "pulled out" in failed and "slipped" in failed and "lifted" not in failed
    assert "pulled out" in lifted(charge_uc_m2=80.0, grip_un=20.0)


# --- sensor -----------------------------------------------------------------------------------


def test_a_sensor_off_its_linearity_shifts_all_forces() -> None:
    bent = lever_fit(with_world(force_sensors__force__linearity=0.02), stroke=0.1)
    straight = lever_fit(settings(), stroke=0.1)
    assert abs(bent.ei_off - straight.ei_off) > 0.005


def test_hysteresis_parts_a_falling_force_from_a_growing_one() -> None:
    # 1.8 uN at most, against a mean force of some 40 uN.
    loop = lever_fit(with_world(force_sensors__force__hysteresis=0.01), stroke=0.1).loop
    assert -0.05 < loop < -0.01


def test_loads_along_the_fibre_and_upwards_add_to_the_signal() -> None:
    curl = FIBRE.model_copy(update={"curl_deg": 45.0 * FIBRE.length_um / TURNED_UM})
    assert differs(World(session={"force_sensors.force.cross_talk": 0.2}), settings(curl))
    askew = FIBRE.model_copy(update={"plane_ratio": 4.0, "orientation_deg": 45.0})
    world = World(session={"force_sensors.force.axial_talk": 0.2})
    assert differs(world, settings(askew, probe_friction=0.3))


def differs(world: World, twin: TwinSettings) -> bool:
    with_it, without = (lever_fit(each, 1).ei_off for each in (world.applied(twin, 1), twin))
    return abs(with_it - without) > 0.01


def volts(twin: TwinSettings, begin_s: float, count: int = 20_000, rate_hz: float = 100.0):
    sensor = Bench(twin, 5).force_side.sensors["force"]
    return sensor.volts(begin_s + np.arange(count) / rate_hz), sensor


def test_gain_and_zero_follow_the_room() -> None:
    climate = {"climate__temperature_wander_k": 1.0, "climate__temperature_period_s": 100.0}
    calm, _ = volts(with_world(**climate), 0.0)
    warm, sensor = volts(with_world(force_sensors__force__zero_un_k=5.0, **climate), 0.0)
    swing_un = np.ptp((warm - calm) / sensor.true_gain_v_un)
    assert 1.0 < swing_un < 40.0


def test_a_sensor_just_switched_on_drifts() -> None:
    cold, sensor = volts(with_world(force_sensors__force__warm_up_un=20.0), 0.0, 2000)
    warm, _ = volts(with_world(force_sensors__force__warm_up_un=20.0), 12_000.0, 2000)
    assert abs(cold.mean() - warm.mean()) / sensor.true_gain_v_un > 2.0


def test_slow_noise_grows_as_the_frequency_falls() -> None:
    def slow_part(corner_hz: float) -> float:
        told, sensor = volts(
            with_world(
                force_sensors__force__corner_hz=corner_hz,
                force_sensors__force__drift_un_sqrt_s=0.0,
            ),
            0.0,
        )
        means = told.reshape(-1, 1000).mean(axis=1) / sensor.true_gain_v_un
        return float(np.diff(means).std())

    assert slow_part(100.0) > 2.0 * slow_part(0.0)


def test_the_same_times_give_the_same_noise_in_portions_of_any_size() -> None:
    twin = with_world(force_sensors__force__corner_hz=2.0)
    whole, _ = volts(twin, 0.0, 4000, 1000.0)
    sensor = Bench(twin, 5).force_side.sensors["force"]
    times = np.arange(4000) / 1000.0
    parts = [sensor.volts(times[start : start + 70]) for start in range(0, 4000, 70)]
    assert np.concatenate(parts) == pytest.approx(whole, abs=1e-9)


# --- stages -----------------------------------------------------------------------------------


def test_a_stage_of_another_scale_stretches_all_spans() -> None:
    def gone_um(seed: int) -> float:
        bench = Bench(with_world(kinds__linear__scale_error=0.01), seed)
        begin = bench.moment.tips_um["left.hold"][0]
        return bench.go(left_x=4000.0).moment.tips_um["left.hold"][0] - begin

    assert np.std([gone_um(seed) for seed in range(30)]) == pytest.approx(40.0, rel=0.3)


def test_play_is_lost_when_the_direction_changes() -> None:
    played = lever_fit(with_world(kinds__linear__reversal=1.0))
    assert played.loop == pytest.approx(-1.0 / 13.5, abs=0.05), "1 um of mean ways of 13.5 um"


def test_a_stage_creeps_on_after_a_long_way() -> None:
    bench = Bench(with_world(kinds__linear__lag_part=0.001))
    bench.go(left_x=3000.0)
    at_once = bench.moment.tips_um["left.hold"][0]
    later = bench.wait(20.0).moment.tips_um["left.hold"][0]
    assert later - at_once == pytest.approx(2.1, abs=0.2), "some of the 3 um on the way"


def test_a_guideway_leads_the_tip_aside() -> None:
    def path_um(twin: TwinSettings) -> float:
        bench = Bench(twin, 2)
        ys = [bench.go(left_x=x).moment.tips_um["left.hold"][1] for x in (0.0, 2000.0, 4000.0)]
        return float(np.ptp(ys))

    assert path_um(settings()) == pytest.approx(0.0, abs=1e-9)
    assert 0.5 < path_um(with_world(kinds__linear__yaw_um=10.0)) < 10.0


# --- optics -----------------------------------------------------------------------------------


def microscope(**changed: float) -> TwinSettings:
    return World(
        session={f"optics.views.microscope.{key}": each for key, each in changed.items()}
    ).applied(shipped_settings(), 0)


def seen(twin: TwinSettings, seed: int = 0) -> Projection:
    scene = Scene.from_settings(twin, ManualClock(), seed)
    assert scene.optics is not None
    return scene.optics.projection(0.0)


def test_distortion_moves_the_corners_and_not_the_middle() -> None:
    straight, bent = seen(microscope()), seen(microscope(distortion=0.005))
    corner = np.array([[6000.0, 4500.0, 0.0]])
    middle = np.array([[60.0, -45.0, 0.0]])
    moved = np.hypot(*(bent.image_px(corner) - straight.image_px(corner))[0])
    assert moved == pytest.approx(0.005 * 1000.0, rel=0.1)
    assert np.abs(bent.image_px(middle) - straight.image_px(middle)).max() < 1e-6


def test_each_run_of_the_zoom_ends_at_another_scale_and_place() -> None:
    twin = microscope(zoom_scale=0.004, zoom_shift_um=20.0, zoom_focus_um=50.0)
    scene = Scene.from_settings(twin, ManualClock(), 3)
    assert scene.optics is not None and scene.lens is not None
    scales, axes, focuses = [], [], []
    for run in range(6):
        scene.lens.seek("zoom", 6000 + 3000 * (run % 2), 100.0 * run)
        if run % 2:
            now = scene.optics.projection(100.0 * run + 50.0)
            assert now == scene.optics.projection(100.0 * run + 60.0), "and stays there"
            scales.append(now.px_um)
            axes.append(now.axis_um)
            focuses.append(now.focus_um)
    assert 1e-4 < np.std(scales) / np.mean(scales) < 0.02
    assert 1.0 < np.std(np.array(axes), axis=0).mean() < 60.0
    assert 2.0 < np.std(focuses) < 150.0


def test_a_seed_has_the_zoom_come_to_rest_alike_whenever_it_runs() -> None:
    def scales(later_s: float) -> list[float]:
        scene = Scene.from_settings(microscope(zoom_scale=0.004), ManualClock(), 3)
        assert scene.optics is not None and scene.lens is not None
        seen = []
        for run in range(3):
            scene.lens.seek("zoom", 6000 - 3000 * (run % 2), later_s + 100.0 * run)
            seen.append(scene.optics.projection(later_s + 100.0 * run + 50.0).px_um)
        return seen

    first = scales(0.5)
    assert first == scales(7.25)
    assert first[0] != first[2], "at the same zoom"


def test_the_focus_moves_with_the_zoom() -> None:
    def focus(zoom_counts: int) -> float:
        scene = Scene.from_settings(microscope(focus_shift_um=100.0), ManualClock())
        assert scene.optics is not None and scene.lens is not None
        scene.lens.seek("zoom", zoom_counts, 0.0)
        return scene.optics.projection(60.0).focus_um

    assert focus(12_000) - focus(0) == pytest.approx(100.0)


def test_pale_fibres_stand_out_less() -> None:
    def darkest(contrast: float) -> float:
        twin = World(
            session={"optics.picture.contrast": contrast, "optics.picture.dust_per_mm2": 0.0}
        ).applied(shipped_settings(), 0)
        scene = Scene.from_settings(twin, ManualClock())
        assert scene.optics is not None
        at = scene.optics.world_to_image_px((200.0, -150.0, 4.0), 0.0).round().astype(int)
        image = scene.optics.render(0.0).astype(float)
        near = image[at[1] - 15 : at[1] + 16, at[0] - 15 : at[0] + 16]
        return float(np.median(near) - near.min()) / float(np.median(near))

    assert darkest(0.25) < 0.5 * darkest(1.0)


def test_the_lamp_fades() -> None:
    twin = World(session={"light.fading_per_h": 0.08}).applied(shipped_settings(), 0)
    light = Scene.from_settings(twin, ManualClock()).light
    assert light is not None
    assert light.given_percent(3600.0) == pytest.approx(0.92 * light.percent(3600.0))


# --- the air ----------------------------------------------------------------------------------


def test_damp_air_makes_fibres_creep_and_stick_and_lose_their_charge() -> None:
    dry, damp = (Climate(ClimateSettings(rh_percent=rh), 0) for rh in (30.0, 70.0))
    assert damp.creep(0.0) / dry.creep(0.0) == pytest.approx(2.5, abs=0.1)
    assert damp.adhesion(0.0) / dry.adhesion(0.0) == pytest.approx(2.0)
    assert damp.charge(0.0) < 0.1 * dry.charge(0.0)


def test_the_air_changes_with_time() -> None:
    wandering = Climate(ClimateSettings(rh_wander_percent=5.0, temperature_wander_k=1.0), 1)
    hours = np.arange(0.0, 7200.0, 60.0)
    assert 5.0 < np.ptp([wandering.rh_percent(each) for each in hours]) <= 10.0
    assert 1.0 < np.ptp([wandering.warmer_k(each) for each in hours]) <= 2.0
    assert wandering.warmer_k(0.0) == 0.0


# --- the measurand ----------------------------------------------------------------------------


def test_the_truth_records_what_each_push_is_about() -> None:
    fibre = FIBRE.model_copy(
        update={"ei_variation": 0.25, "plane_ratio": 4.0, "orientation_deg": 30.0}
    )
    heard = Heard()
    bench = Bench(settings(fibre), 3, truth=heard)
    for span in (300.0, 500.0):
        bench.go(left_x=4000.0 - span).go(left_z=-810.0).go(probe_y=-4965.0)
        # A small push of a straight fibre: all that it gives way comes from this stiffness.
        touch = -5000.0 + 0.5 * bench.moment.fibres[0].seen_um
        one = bench.go(20.0, probe_y=touch - 1.0).force_un
        two = bench.go(20.0, probe_y=touch - 4.0).force_un
        bench.go(probe_y=-4960.0).moment  # noqa: B018 - looked at
        stiffness = 1.0 / (3.0 / (two - one) - 1.0 / SENSOR)
        told = heard.facts("touched")
        assert told["ei_n_m2"] * 1e18 == pytest.approx(stiffness * span**3 / 3.0, rel=0.015)
        assert told["orientation_deg"] == pytest.approx(30.0)
        assert told["rh_percent"] == 50.0
