"""Who holds the fibre, and where it goes when nobody does."""

import math

import pytest

from unit.twin.force_bench import FIBRE, Bench, before_the_fibre, settings

LYING = FIBRE.model_copy(update={"held_by": "", "free_um": 0.0, "x_um": 200.0, "angle_deg": 5.0})
OPEN = {"left.gripper": 600.0}


def on_the_plate(**changed: float) -> Bench:
    """Left jaws open, down on the plate, their tip 400 um left of the middle."""
    lying = LYING.model_copy(update=changed)
    return Bench(settings(lying, start=OPEN)).go(left_x=3600.0).go(left_z=-1500.0)


def holders(bench: Bench, fibre: int = 0) -> tuple[str, ...]:
    return bench.moment.fibres[fibre].held_by


def test_a_fibre_whose_gripper_is_found_open_lies_on_the_plate() -> None:
    bench = Bench(settings(start=OPEN))
    assert holders(bench) == ()
    assert {end[2] for end in bench.moment.fibres[0].ends_um} == {4.0}


def test_opening_the_jaws_drops_the_fibre_where_it_is() -> None:
    bench = Bench().go(left_x=1000.0, left_y=300.0)
    assert holders(bench) == ("left",)
    bench.go(left_gripper=40.0)
    assert holders(bench) == ()
    (x0, y0, z0), (x1, y1, z1) = bench.moment.fibres[0].ends_um
    assert (x0, x1) == pytest.approx((-3800.0, -1800.0))
    assert (y0, y1, z0, z1) == pytest.approx((300.0, 300.0, 4.0, 4.0))


def test_a_fibre_that_was_dropped_turns_with_the_table() -> None:
    bench = Bench().go(left_x=2000.0).go(20.0, table_rotation=30.0)
    held = bench.moment.fibres[0].ends_um
    before = bench.go(left_gripper=100.0).moment.fibres[0].ends_um
    for (x, y, _), (u, v, _) in zip(held, before, strict=True):
        assert (u, v) == pytest.approx((x, y), abs=1e-6)
    after = bench.go(20.0, table_rotation=120.0).moment.fibres[0].ends_um
    for (x, y, _), (u, v, _) in zip(before, after, strict=True):
        assert (u, v) == pytest.approx((-y, x), abs=1e-6)


def test_closing_on_a_fibre_takes_it_up_and_turns_it_into_line() -> None:
    bench = on_the_plate()
    assert holders(bench) == ()
    bench.go(left_gripper=28.0)
    assert holders(bench) == ("left",)
    ends = bench.go(left_z=-810.0).moment.fibres[0].ends_um
    assert ends[0][1:] == pytest.approx((0.0, 700.0)) and ends[1][1:] == pytest.approx((0.0, 700.0))
    assert ends[1][0] == pytest.approx(200.0 + 1000.0, abs=4.0), "it was 5 degrees aside"
    assert math.dist(*ends) == pytest.approx(2000.0)


@pytest.mark.parametrize(
    "changed",
    [
        {"x_um": 2000.0},  # all of it in front of the jaws
        {"y_um": 400.0},  # outside the gap
        {"angle_deg": 80.0},  # across
        {"width_um": 20.0},  # thinner than the gap will be
    ],
)
def test_closing_beside_a_fibre_takes_nothing(changed: dict[str, float]) -> None:
    assert holders(on_the_plate(**changed).go(left_gripper=28.0)) == ()


def test_closing_above_a_fibre_takes_nothing() -> None:
    bench = on_the_plate().go(left_z=-1450.0).go(left_gripper=28.0)
    assert holders(bench) == ()


def test_a_fibre_that_was_taken_up_again_pushes_back() -> None:
    bench = Bench(settings(LYING.model_copy(update={"x_um": 400.0}), start=OPEN))
    bench.go(left_x=3600.0).go(left_z=-1500.0).go(left_gripper=25.0)
    before_the_fibre(bench).go(probe_y=-5005.0)
    assert bench.push.deflection_um == pytest.approx(20.0, rel=0.01)


def both(bench: Bench) -> Bench:
    """Bring the right jaws round the free end, 1000 um from the left ones, and close them."""
    bench.go(left_x=3600.0).go(right_x=-3400.0, left_z=-810.0).go(right_z=-810.0)
    return bench.go(right_gripper=20.0)


def test_two_grippers_hold_one_fibre_and_either_can_let_go() -> None:
    bench = both(Bench())
    assert holders(bench) == ("left", "right")
    assert bench.moment.fibres[0].tension_un == pytest.approx(0.0, abs=1e-6)
    assert holders(bench.go(left_gripper=50.0)) == ("right",)
    ends = bench.go(right_x=-3000.0).moment.fibres[0].ends_um
    assert {round(end[0]) for end in ends} == {-800, 1200}, "it goes with the right gripper"
    assert holders(bench.go(right_gripper=50.0)) == ()


def test_between_two_grippers_the_same_push_is_many_times_the_force() -> None:
    cantilever = before_the_fibre(Bench(), 500.0).go(probe_y=-5005.0).force_un
    bench = both(Bench(settings(gripper_un_um=1e9)))
    bench.go(probe_x=100.0).go(probe_y=-5005.0)
    assert bench.push.abscissa_um == pytest.approx(500.0)
    assert bench.force_un > 25.0 * cantilever, "8 times by linear theory"
    soft = both(Bench(settings(gripper_un_um=100.0))).go(probe_x=100.0).go(probe_y=-5005.0)
    assert bench.force_un > 2.5 * soft.force_un


def test_pulling_the_grippers_apart_stretches_until_the_fibre_slips() -> None:
    bench = both(Bench())
    stiffness = 1.0 / (1000.0 / 7.2e6 + 2.0 / 100.0)
    bench.go(10.0, right_x=-3395.0)
    assert bench.moment.fibres[0].tension_un == pytest.approx(5.0 * stiffness, rel=0.01)
    bench.go(100.0, right_x=-3200.0)
    bench.go(probe_x=100.0, probe_y=-4950.0).go(20.0, right_x=-3199.0)
    assert bench.moment.fibres[0].tension_un == pytest.approx(5000.0, rel=0.01)
    assert bench.go(10.0, right_x=-3205.0).moment.fibres[0].tension_un < 4900.0


def test_the_push_goes_on_when_one_of_two_grippers_lets_go() -> None:
    bench = both(Bench()).go(probe_x=100.0).go(probe_y=-5005.0)
    stiff = bench.force_un
    assert 0.0 < bench.go(right_gripper=60.0).force_un < stiff / 5.0
    assert bench.push.deflection_um == pytest.approx(20.0, rel=0.01)
    assert bench.go(left_gripper=60.0).force_un == 0.0


def test_a_gripper_holds_one_fibre_at_a_time() -> None:
    bench = Bench(settings(FIBRE, LYING)).go(left_x=3600.0).go(left_z=-1500.0)
    bench.go(left_gripper=25.0)
    assert holders(bench, 0) == ("left",) and holders(bench, 1) == ()
