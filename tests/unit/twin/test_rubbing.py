"""Friction along a fibre sticks before it slides, against Coulomb's law step by step."""

import numpy as np
import pytest

from cosmic.twin.cantilever import Cantilever
from cosmic.twin.rod import PushCurve
from cosmic.twin.rubbing import RubbedPush, Rubbing
from oracles.pushed_rod import arc
from oracles.rubbed_rod import RubbedRod
from unit.twin.force_bench import EI, FIBRE, Bench, settings, touching_y

SENSOR = 800.0
RIGID = 1e30
ARC_UM = 1300.0
EDGE_UM = 10.0
CURLED = FIBRE.model_copy(update={"curl_deg": 35.0 * FIBRE.length_um / ARC_UM})
SOFT = {"probe_friction": 0.3, "probe_side_un_um": 10.0}


def curves(
    span_um: float, *, turn_deg: float, friction: float, side: float, ei: float
) -> list[PushCurve]:
    """With friction that pulls the fibre outwards, none, and inwards."""
    return [
        Cantilever(
            *arc(ARC_UM, turn_deg, 400).T,
            ei_un_um2=ei,
            depth_um=0.0,
            radius_um=20.0,
            friction=each,
            probe_un_um=side,
        ).curve(span_um, sensor_un_um=RIGID)
        for each in (friction, 0.0, -friction)
    ]


def out_and_back(stroke_um: float) -> np.ndarray:
    out = np.linspace(0.02, 1.0, 25)
    return np.concatenate([out, out[-2:1:-1]]) * stroke_um


@pytest.mark.parametrize(
    ("turn_deg", "friction", "side", "span_um", "ei"),
    [
        (0.0, 0.3, 1e6, 400.0, 5e7),
        (0.0, 0.3, 10.0, 400.0, 5e7),
        (35.0, 0.3, 10.0, 400.0, 3e7),
        (35.0, 0.2, 10.0, 120.0, 3e7),
        (35.0, 0.4, 10.0, 800.0, 1.5e8),
        (-35.0, 0.3, 10.0, 450.0, 1.5e8),
        (-35.0, 0.3, 10.0, 600.0, 3e7),
        (60.0, 0.3, 1e6, 400.0, 5e7),
        (60.0, 0.3, 10.0, 400.0, 5e7),
        (-60.0, 0.3, 5.0, 250.0, 5e7),
    ],
)
def test_a_push_out_and_back_follows_the_law_of_coulomb(
    turn_deg: float, friction: float, side: float, span_um: float, ei: float
) -> None:
    travels = out_and_back(min(0.1 * span_um, 60.0, 80.0 * span_um**3 / (3.0 * ei)))
    rod = RubbedRod(
        ei, span_um, friction, side, curvature=np.radians(turn_deg) / ARC_UM, radius_um=20.0
    )
    outwards, free, inwards = curves(
        span_um, turn_deg=turn_deg, friction=friction, side=side, ei=ei
    )
    rubbing = Rubbing(side, turn_um=1e-3)
    found, expected = [], []
    for travel in travels.tolist():
        part = rubbing.follow(outwards, inwards, travel, 0.0)
        found.append(RubbedPush(outwards, free, inwards, part).both_un(travel))
        expected.append(rod.go(travel)[:2])
    (across, along), (force, aside) = np.transpose(found), np.transpose(expected)
    assert across == pytest.approx(force, rel=5e-3, abs=0.1)
    assert along == pytest.approx(aside, abs=0.03 * friction * force.max())


def test_between_both_frictions_the_force_is_not_in_the_middle() -> None:
    # Friction moves the probe by 6 um of 120, and three times that part goes with the force.
    travels = np.linspace(0.1, 0.8, 8).tolist()
    rod = RubbedRod(1.5e8, 120.0, 0.3, 10.0, curvature=np.radians(35.0) / ARC_UM, radius_um=20.0)
    outwards, free, inwards = curves(120.0, turn_deg=35.0, friction=0.3, side=10.0, ei=1.5e8)
    rubbing = Rubbing(10.0, turn_um=1e-3)
    for travel in travels:
        part = rubbing.follow(outwards, inwards, travel, 0.0)
        assert abs(part) < 1.0, "it sticks"
        found = RubbedPush(outwards, free, inwards, part).force_un(travel)
        assert found == pytest.approx(rod.go(travel)[0], rel=5e-3)


def test_the_contact_sticks_and_slides_at_least_once_in_these() -> None:
    rod = RubbedRod(3e7, 400.0, 0.3, 10.0, curvature=np.radians(35.0) / ARC_UM, radius_um=20.0)
    rubs = np.array([rod.go(travel)[2] for travel in out_and_back(40.0).tolist()])
    assert (np.abs(rubs) > 0.2999).sum() > 8 and (np.abs(rubs) < 0.29).sum() > 8


# --- on the bench -----------------------------------------------------------------------------


def before(bench: Bench, span_um: float) -> float:
    """Bring a held fibre before the probe, and return where they meet."""
    bench.go(probe_y=-4500.0)
    bench.go(left_x=4000.0 - span_um).go(left_z=-810.0)
    state, tips = bench.moment.fibres[0], bench.scene.tips(bench.now_s)
    x, y, _ = state.line_um[np.argsort(state.line_um[:, 0])].T
    met = -5000.0 + 0.5 * state.seen_um + float(np.interp(tips["probe"][0], x, y))
    bench.go(probe_y=met + 30.0)
    bench.go(probe_y=met + 2.0)
    start = bench.start({"probe.y": met - 2.0}, 10.0)
    times = np.arange(bench.now_s, start, 2e-4)
    force = bench.force_side.timeline.force_un(times)
    touched = float(bench.scene.stages["probe.y"].position_then(times[int(np.argmax(force > 0))]))
    bench.now_s = start
    bench.go(probe_y=touched + 30.0)
    return touched


def forces(bench: Bench, met: float, travels: np.ndarray) -> np.ndarray:
    return np.array(
        [bench.go(200.0, probe_y=met - each).wait(0.02).force_un for each in travels.tolist()]
    )


def pinned_un_um(line_um: np.ndarray, span_um: float, side: float, radius_um: float) -> float:
    """Stiffness across of a fibre whose place of contact goes along with a spring; small pushes."""
    steps = np.diff(line_um, axis=0)
    heading = np.arctan2(*steps.T[::-1])
    middles = 0.5 * (line_um[1:] + line_um[:-1])
    number = int(np.argmin(np.abs(middles[:, 0] - radius_um * np.sin(heading) - span_um)))
    arms = middles[number] - middles[:number]
    turned = np.column_stack([-arms[:, 1], arms[:, 0]])
    gives = (turned * np.hypot(*steps[:number].T)[:, None]).T @ turned / EI
    return float(1.0 / (gives[1, 1] - gives[0, 1] ** 2 / (gives[0, 0] + 1.0 / side)))


@pytest.mark.parametrize("curl", [1.0, -1.0])
@pytest.mark.parametrize("side", [10.0, 30.0])
def test_what_sticks_is_as_stiff_as_a_fibre_pinned_to_the_probe(side: float, curl: float) -> None:
    turned = CURLED.model_copy(update={"curl_deg": curl * CURLED.curl_deg})
    stiffness = {}
    for friction in (0.0, 0.9):
        bench = Bench(settings(turned, probe_friction=friction, probe_side_un_um=side))
        met = before(bench, 300.0)
        there = forces(bench, met, np.array([0.4, 0.7, 1.0, 0.7, 0.4]))
        assert there[3:] == pytest.approx(there[1::-1], rel=2e-3), "no loop"
        slope = (there[2] - there[0]) / 0.6
        stiffness[friction] = 1.0 / (1.0 / slope - 1.0 / SENSOR)
    state, tips = bench.moment.fibres[0], bench.scene.tips(bench.now_s)
    line = state.line_um[np.argsort(state.line_um[:, 0])][:, :2]
    hold = np.array(tips["left.hold"][:2])
    at = np.linspace(0.0, 400.0, 4000)
    line = np.column_stack([at, np.interp(at, *(line - hold).T)])
    pinned = pinned_un_um(line, 300.0, side, EDGE_UM + 0.5 * FIBRE.width_um)
    assert stiffness[0.9] == pytest.approx(pinned, rel=0.01)
    assert stiffness[0.9] != pytest.approx(stiffness[0.0], rel=0.01)


def test_a_contact_that_sticks_is_stiffer_than_one_without_friction_and_softer_than_one_that_slides(
) -> None:  # fmt: skip
    line = arc(ARC_UM, 35.0, 20_000)
    outwards, free, inwards = curves(400.0, turn_deg=35.0, friction=0.9, side=10.0, ei=EI)
    pinned = pinned_un_um(line, 400.0, 10.0, 20.0)
    slid = max(outwards.force_un(1.0), inwards.force_un(1.0))
    assert free.force_un(1.0) < pinned < slid


def test_a_falling_push_sticks_until_probe_and_fibre_have_given_way_both_ways() -> None:
    span, side, friction, stroke = 400.0, 10.0, 0.3, 48.0
    outwards, _, inwards = curves(span, turn_deg=0.0, friction=friction, side=side, ei=EI)
    rubbing = Rubbing(side, turn_um=1e-3)
    assert rubbing.follow(outwards, inwards, stroke, 0.0) == 1.0, "it slides"
    travels = np.arange(stroke, 5.0, -0.05)
    parts = [rubbing.follow(outwards, inwards, travel, 0.0) for travel in travels.tolist()]
    turned = travels[int(np.argmax(np.array(parts) <= -1.0))]
    # The bow takes 0.6 d^2/L of the fibre; friction and the slope of the fibre, 1.5 d/L, draw the
    # probe aside.
    stiffness = 3.0 * EI / span**3
    drawn = 0.6 * (travels**2 - stroke**2) / span
    begun = stiffness * stroke * (friction - 1.5 * stroke / span)
    ended = stiffness * travels * (friction + 1.5 * travels / span)
    aside = (begun + ended) / side
    expected = travels[int(np.argmax(-drawn >= aside))]
    assert stroke - turned == pytest.approx(stroke - expected, rel=0.1)
    assert stroke - turned > 15.0, "nowhere near at once"


def test_beside_a_rigid_probe_friction_turns_round_at_once() -> None:
    bench, ends = Bench(settings(probe_friction=0.3)), {}
    before(bench, 400.0)
    met = touching_y(bench)
    out = forces(bench, met, np.array([10.0, 20.0, 40.0]))
    back = forces(bench, met, np.array([39.0, 20.0, 10.0]))
    for friction in (0.3, -0.3):
        straight = Cantilever(
            np.array([0.0, 1200.0]),
            np.zeros(2),
            ei_un_um2=EI,
            depth_um=0.0,
            radius_um=EDGE_UM + 0.5 * FIBRE.width_um,
            friction=friction,
        ).curve(400.0, sensor_un_um=SENSOR)
        ends[friction] = straight
    assert out == pytest.approx([ends[0.3].force_un(each) for each in (10.0, 20.0, 40.0)], rel=2e-3)
    assert back == pytest.approx(
        [ends[-0.3].force_un(each) for each in (39.0, 20.0, 10.0)], rel=2e-3
    )


def test_a_soft_probe_makes_the_loop_of_a_curled_fibre_narrower() -> None:
    loops = []
    for side in (1e6, 10.0):
        bench = Bench(settings(CURLED, probe_friction=0.3, probe_side_un_um=side))
        met = before(bench, 300.0)
        out, _, back = forces(bench, met, np.array([6.0, 12.0, 6.0]))
        loops.append(out / back - 1.0)
    assert loops[0] > 0.03
    assert abs(loops[1]) < 0.3 * loops[0]


@pytest.mark.parametrize("lifted", [False, True])
def test_a_contact_that_was_left_begins_anew(lifted: bool) -> None:
    # Looks so far apart that the first one finds it pushed already.
    bench = Bench(settings(CURLED, step_s=0.01, pull_off_un=0.0, **SOFT))
    met = before(bench, 400.0)
    first = bench.go(20_000.0, probe_y=met - 5.0).wait(0.05).force_un
    forces(bench, met, np.array([60.0]))
    falling = forces(bench, met, np.array([5.0]))
    forces(bench, met, np.array([60.0]))
    if lifted:
        bench.go(left_z=-600.0).go(probe_y=met + 40.0).go(left_z=-810.0)
    bench.go(20_000.0, probe_y=met + 40.0)
    assert falling != pytest.approx(first, rel=0.02)
    assert bench.go(20_000.0, probe_y=met - 5.0).wait(0.05).force_un == pytest.approx(
        first, rel=1e-3
    )


@pytest.mark.parametrize(("stroke_um", "slides"), [(3.0, False), (60.0, True)])
def test_a_fibre_that_creeps_does_not_slide_while_the_probe_stands(
    stroke_um: float, slides: bool
) -> None:
    later = {}
    for friction in (0.0, 0.3):
        creeps = FIBRE.model_copy(update={"relaxation_per_decade": 0.05})
        bench = Bench(settings(creeps, probe_friction=friction, probe_side_un_um=10.0))
        bench.go(200.0, probe_y=before(bench, 400.0) - stroke_um)
        begin = bench.push
        end = bench.wait(1000.0).push
        assert end.force_un < 0.9 * begin.force_un, "it creeps"
        later[friction] = begin, end
    begin, end = later[0.3]
    rubs = [
        np.tan(np.arctan2(free.along_un, free.force_un) - np.arctan2(each.along_un, each.force_un))
        for free, each in zip(*later.values(), strict=True)
    ]
    if slides:
        assert rubs == pytest.approx([0.3, 0.3], abs=0.02), "all that there is"
    else:
        assert np.abs(rubs).max() < 0.1
        # What drew the probe aside still does.
        assert end.along_un == pytest.approx(begin.along_un, abs=0.02 * begin.force_un)


def test_pushing_while_the_span_changes_draws_all_the_friction_there_is() -> None:
    bench = Bench(settings(**SOFT))
    bench.go(200.0, probe_y=before(bench, 400.0) - 8.0)
    assert abs(bench.push.along_un) < 0.15 * bench.push.force_un
    nearer = bench.go(left_x=3620.0).push
    farther = bench.go(left_x=3580.0).push
    assert nearer.along_un == pytest.approx(0.3 * nearer.force_un, rel=0.2)
    assert farther.along_un == pytest.approx(-0.3 * farther.force_un, rel=0.2)
