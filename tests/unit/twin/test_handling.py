"""What happens to fibres in the hand."""

import math
from typing import Any

import numpy as np
import pytest

from cosmic.frame.errors import CosmicError
from cosmic.twin.fate import draw_fate
from cosmic.twin.fibre_state import FibreState
from cosmic.twin.settings import TwinSettings, shipped_settings
from unit.twin.force_bench import FIBRE, Bench, Heard, before_the_fibre, settings

LYING = FIBRE.model_copy(
    update={"held_by": "", "free_um": 0.0, "x_um": 400.0, "angle_deg": 0.0, "width_um": 30.0}
)
OPEN = {"left.gripper": 600.0}
CURLED = {"curl_deg": 50.0}


class Hand:
    """Left jaws, open and down on the plate, their tip at x = -400 um."""

    def __init__(self, *faults: str, twin: TwinSettings | None = None, **changed: Any) -> None:
        self._heard = Heard()
        lying = LYING.model_copy(update=changed)
        self.bench = Bench(twin or settings(lying, start=OPEN), truth=self._heard)
        for name in faults:
            self.bench.scene.faults.inject(name)
        self.bench.go(left_x=3600.0).go(left_z=-1500.0)

    @property
    def heard(self) -> Heard:
        """What was told up to now."""
        assert self.bench.moment
        return self._heard

    def close(self) -> "Hand":
        self.bench.go(left_gripper=25.0)
        return self

    def open(self) -> "Hand":
        self.bench.go(left_gripper=600.0)
        return self

    def lift(self, um: float = 700.0) -> "Hand":
        self.bench.go(left_z=-1500.0 + um)
        return self

    def fibre(self, number: int = 0) -> FibreState:
        return self.bench.moment.fibres[number]

    def where(self, number: int = 0) -> str:
        return self.fibre(number).where

    def measure(self, way_um: float = 20.0, span_um: float = 400.0) -> float:
        """Bring the held fibre before the probe, push and return the force."""
        bench = self.bench
        bench.go(left_x=4000.0 - span_um).go(left_z=-810.0)
        x_um, tip_um = -1.0, 0.0
        line, hold = self.fibre().line_um, bench.moment.tips_um["left.hold"]
        x_um = hold[0] + span_um
        order = np.argsort(line[:, 0])
        tip_um = float(np.interp(x_um, line[order, 0], line[order, 1]))
        face = tip_um + self.fibre().settings.width_um / 2.0
        probe_y = bench.moment.tips_um["probe"][1]
        stage_y = bench.scene.stages["probe.y"].position(bench.now_s)
        bench.go(probe_y=stage_y + face - probe_y + 20.0)
        bench.go(20.0, probe_y=stage_y + face - probe_y - way_um)
        return bench.force_un


# ---------------------------------------------------------------------------------- curl


@pytest.mark.parametrize("angle_deg", [0.0, 180.0])
def test_a_curled_fibre_is_taken_where_it_is_drawn(angle_deg: float) -> None:
    hand = Hand(curl_deg=50.0, angle_deg=angle_deg)
    assert hand.bench.scene.optics is not None
    (drawn,) = hand.bench.scene.optics.centre_lines_um(hand.bench.now_s)
    hold = hand.bench.moment.tips_um["left.hold"]
    order = np.argsort(drawn[:, 0])
    aside = float(np.interp(hold[0], drawn[order, 0], drawn[order, 1]))
    assert abs(aside) > 40.0, "a straight one would lie elsewhere"
    narrow = 2.0 * abs(aside) - 40.0
    assert hand.close().where() == "held"
    (grasped,) = [facts for name, facts in hand.heard.events if name == "grasped"]
    steps = np.hypot(*np.diff(drawn[:, :2], axis=0).T)
    arc = float(
        np.interp(hold[0], drawn[order, 0], np.concatenate([[0.0], np.cumsum(steps)])[order])
    )
    assert grasped["at_um"] == pytest.approx(arc, abs=2.0)
    beside = Hand(curl_deg=50.0, angle_deg=angle_deg)
    beside.bench.go(left_z=-1400.0).go(left_gripper=narrow).go(left_z=-1500.0)
    beside.bench.go(left_gripper=narrow - 5.0).go(left_gripper=narrow)
    assert beside.open().where() == "plate"


def test_a_draught_blows_the_fibre_aside_that_a_gripper_comes_down_to_and_once() -> None:
    hand = Hand()
    calm = hand.fibre().line_um[:, 1].mean()
    hand.lift()
    hand.bench.scene.faults.inject("draught", amount=140.0)
    assert hand.fibre().line_um[:, 1].mean() == pytest.approx(calm)
    hand.lift(200.0)
    half_way = hand.fibre().line_um[:, 1].mean() - calm
    assert 30.0 < half_way < 139.0
    hand.lift(0.0)
    assert hand.fibre().line_um[:, 1].mean() == pytest.approx(calm + 140.0, abs=0.1)
    hand.lift().lift(0.0)
    assert hand.fibre().line_um[:, 1].mean() == pytest.approx(calm + 140.0, abs=0.1)
    assert [facts["by_um"] for name, facts in hand.heard.events if name == "blown"] == [140.0]


def test_jaws_do_not_close_on_a_fibre_that_runs_out_under_one_of_them() -> None:
    assert Hand(x_um=-700.0, angle_deg=25.0).close().where() == "plate"
    assert Hand(x_um=200.0, y_um=200.0, angle_deg=25.0).close().where() == "held"


@pytest.mark.parametrize("curl_deg", [-60.0, 0.0, 60.0])
def test_the_probe_meets_a_held_fibre_where_it_is_drawn(curl_deg: float) -> None:
    hand = Hand(curl_deg=curl_deg).close().lift()
    assert hand.measure(way_um=-0.5) == 0.0
    assert hand.measure(way_um=0.5) > 0.0


def test_a_curled_fibre_gives_way_nearly_as_a_straight_one() -> None:
    straight = Hand().close().lift().measure(20.0)
    assert Hand(curl_deg=30.0).close().lift().measure(20.0) == pytest.approx(straight, rel=0.03)


def test_what_is_drawn_of_a_pushed_curled_fibre_touches_the_probe() -> None:
    hand = Hand(curl_deg=40.0).close().lift()
    hand.measure(25.0)
    assert hand.bench.scene.optics is not None
    (drawn,) = hand.bench.scene.optics.centre_lines_um(hand.bench.now_s)
    probe = hand.bench.moment.tips_um["probe"]
    y = float(np.interp(probe[0], drawn[:, 0], drawn[:, 1]))
    assert y + 15.0 == pytest.approx(probe[1], abs=0.5)


@pytest.mark.parametrize("curl_deg", [0.0, 45.0, -45.0])
def test_a_fibre_that_is_put_down_stays_as_it_was_in_the_hand(curl_deg: float) -> None:
    hand = Hand(curl_deg=curl_deg).close().lift(5.0)
    held = hand.fibre().line_um
    lying = hand.open().fibre().line_um
    outside = held[:, 0] > hand.bench.moment.tips_um["left.hold"][0] + 1.0
    free = np.array([np.hypot(*(lying[:, :2] - p[:2]).T).min() for p in held[outside]])
    assert free.max() < 30.0 and free.mean() < 10.0


# ---------------------------------------------------------------------------------- the plate


def test_a_soft_fibre_comes_off_the_plate_later_than_a_stiff_one() -> None:
    heights = {}
    for ei in (5e-11, 1e-13):
        hand = Hand(ei_n_m2=ei).close().lift()
        heights[ei] = hand.heard.facts("lifted")["height_um"]
    assert heights[5e-11] < 50.0
    assert heights[1e-13] == pytest.approx(heights[5e-11] * math.sqrt(500.0), rel=0.1)


def test_the_far_end_lies_on_the_plate_until_it_is_peeled_off() -> None:
    hand = Hand(ei_n_m2=1e-13).close().lift(40.0)
    heights = hand.fibre().line_um[:, 2]
    assert heights.max() == pytest.approx(50.0, abs=1.0)
    assert heights[-1] == pytest.approx(4.0, abs=1.0), "half its thickness"
    assert "lifted" not in hand.heard.names
    assert hand.lift(700.0).fibre().line_um[-1, 2] == pytest.approx(710.0, abs=1.0)


# ---------------------------------------------------------------------------------- going wrong


def test_a_missed_grasp_leaves_the_fibre_and_the_next_one_takes_it() -> None:
    hand = Hand("missed_grasp").close()
    assert hand.where() == "plate" and hand.heard.names == ["missed"]
    assert hand.open().close().where() == "held"


def test_a_fibre_that_slips_in_lifting_lies_where_it_was_taken() -> None:
    hand = Hand("slip_in_lift").close()
    assert hand.where() == "held"
    assert hand.lift().where() == "plate"
    assert 20.0 <= hand.heard.facts("slipped")["height_um"] <= 301.0
    assert hand.fibre().line_um[0, 0] == pytest.approx(LYING.x_um - 1000.0, abs=10.0)


def test_a_dropped_fibre_lands_below() -> None:
    hand = Hand("drop").close().lift()
    hand.bench.go(left_x=1600.0).go(left_x=-2000.0)
    assert hand.where() == "plate" and "dropped" in hand.heard.names
    assert -6000.0 < hand.heard.facts("landed")["x_um"] < 400.0


def test_a_fibre_let_go_beyond_the_plate_is_gone_and_not_drawn() -> None:
    twin = settings(LYING.model_copy(update={"length_um": 9000.0}), start=OPEN)
    far = twin.stages["left.x"].model_copy(update={"start": -6000.0})
    held = LYING.model_copy(
        update={"length_um": 8000.0, "held_by": "left", "free_um": 10.0, "width_um": 700.0}
    )
    stages = {**twin.stages, "left.x": far}
    bench = Bench(twin.model_copy(update={"fibres": (held,), "stages": stages}))
    assert bench.moment.fibres[0].where == "held"
    bench.go(left_gripper=800.0)
    assert bench.moment.fibres[0].where == "gone"
    assert bench.scene.optics is not None
    assert bench.scene.optics.centre_lines_um(bench.now_s) == ()


def test_a_fibre_that_sticks_goes_along_until_it_is_shaken_off() -> None:
    hand = Hand("jaw_adhesion").close().lift().open()
    assert hand.where() == "stuck" and hand.fibre().held_by == ()
    hand.bench.go(left_x=3000.0)
    assert hand.fibre().line_um[:, 0].max() == pytest.approx(800.0, abs=20.0)
    for _ in range(60):
        hand.bench.go(left_y=10.0).go(left_y=0.0)
        if hand.where() != "stuck":
            break
    assert hand.where() == "plate" and hand.heard.facts("came off")["how"] == "shaken"


def test_a_fibre_that_sticks_is_wiped_off_along_the_plate() -> None:
    hand = Hand("jaw_adhesion").close().lift().open()
    hand.bench.go(left_z=-1495.0)
    for number in range(1, 8):
        hand.bench.go(left_x=3600.0 - 200.0 * number)
    assert hand.where() == "plate" and hand.heard.facts("came off")["how"] == "wiped"


def test_the_other_gripper_picks_off_what_sticks() -> None:
    hand = Hand("jaw_adhesion").close().lift().open()
    assert hand.where() == "stuck"
    hand.bench.go(right_x=-3400.0).go(right_z=-800.0).go(right_gripper=20.0)
    assert hand.fibre().held_by == ("right",)


def test_an_overloaded_fibre_breaks_and_its_piece_lies_on_the_plate() -> None:
    hand = Hand("fibre_break").close().lift()
    assert hand.measure(60.0) == 0.0
    broken = hand.heard.facts("broken")
    assert 0.0008 <= broken["strain"] < 0.006
    assert hand.where(0) == "held" and hand.where(1) == "plate"
    lengths = [hand.fibre(number).settings.length_um for number in (0, 1)]
    assert sum(lengths) == pytest.approx(2000.0) and lengths[1] == pytest.approx(1800.0, abs=1.0)
    assert hand.bench.scene.optics is not None
    assert len(hand.bench.scene.optics.centre_lines_um(hand.bench.now_s)) == 2
    assert hand.bench.scene.optics.render(hand.bench.now_s).shape == (1200, 1600)


def test_a_grip_that_gives_way_halves_the_stiffness_for_good() -> None:
    firm = Hand().close().lift().measure(40.0)
    loose = Hand("loose_grip").close().lift()
    loose.measure(60.0)
    assert "grip loosened" in loose.heard.names
    assert loose.measure(40.0) < 0.9 * firm


def test_the_probe_passes_a_fibre_that_points_out_of_the_plane() -> None:
    hand = Hand("out_of_plane").close().lift()
    assert hand.measure(20.0) == 0.0
    ends = hand.fibre().ends_um
    assert abs(ends[1][2] - ends[0][2]) > 100.0


def test_a_bent_tip_is_not_where_its_stages_say() -> None:
    hand = Hand()
    before = hand.bench.moment.tips_um
    hand.bench.scene.faults.inject("tip_bent", tool="left", amount=30.0)
    after = hand.bench.wait(1.0).moment.tips_um
    assert after["left.hold"][0] - before["left.hold"][0] == pytest.approx(30.0)
    assert after["right.hold"] == before["right.hold"]
    hand.bench.scene.faults.clear()
    assert hand.bench.wait(1.0).moment.tips_um == before


# ---------------------------------------------------------------------------------- partners


def crossed(bond_un: float) -> Hand:
    across = LYING.model_copy(
        update={"x_um": 900.0, "angle_deg": 80.0, "bonded_to": 0, "bond_un": bond_un}
    )
    return Hand(twin=settings(LYING, across, start=OPEN)).close()


def test_a_firm_partner_hangs_on_and_falls_with_the_fibre() -> None:
    hand = crossed(1000.0)
    assert hand.lift().where(1) == "hanging"
    hand.bench.go(left_x=2600.0)
    (x0, *_), (x1, *_) = hand.fibre(1).ends_um
    assert (x0 + x1) / 2.0 == pytest.approx(-100.0, abs=20.0)
    hand.open()
    assert hand.where(0) == "plate" and hand.where(1) == "plate"


def test_a_loose_partner_stays_on_the_plate() -> None:
    hand = crossed(10.0).lift()
    assert hand.where(0) == "held" and hand.where(1) == "plate"
    assert "parted" in hand.heard.names and "dragged" not in hand.heard.names


# ---------------------------------------------------------------------------------- chance


def test_what_happens_to_a_grasp_does_not_depend_on_when_it_is_made() -> None:
    quick, slow = with_faults(), with_faults()
    for hand, pause_s in ((quick, 0.0), (slow, 37.0)):
        for _ in range(6):
            hand.bench.wait(pause_s)
            hand.close().lift(400.0).open()
            hand.bench.go(left_z=-1500.0)
    assert quick.heard.names == slow.heard.names
    assert {"missed", "slipped"} & set(quick.heard.names)


def with_faults() -> Hand:
    twin = settings(LYING, start=OPEN)
    handling = twin.handling.model_copy(
        update={"default_faults": True, "missed_grasp": 0.4, "slip_in_lift": 0.4, "fall_um": 5.0}
        | {"tool_offset_um": 1.0, "drift_um": 0.5, "fall_deg": 1.0, "fall_part": 0.0}
    )
    return Hand(twin=twin.model_copy(update={"handling": handling}))


def test_rates_of_trouble_are_those_of_the_settings() -> None:
    shipped = shipped_settings()
    fates = [
        draw_fate(shipped.handling, shipped.contact, f"{number} 0 1", faults=True)
        for number in range(4000)
    ]
    assert sum(each.missed for each in fates) == pytest.approx(320, abs=60)
    assert sum(each.slip_at_um < math.inf for each in fates) == pytest.approx(200, abs=50)
    assert sum(each.sticks for each in fates) == pytest.approx(240, abs=55)
    assert sum(each.break_strain < 0.01 for each in fates) == pytest.approx(32, abs=20)
    assert sum(each.loosen_strain < 0.01 for each in fates) == pytest.approx(48, abs=25)
    steep = [abs(math.degrees(math.atan(each.rise))) for each in fates]
    assert sum(each > 5.0 for each in steep) == pytest.approx(40, abs=22)
    assert np.median(steep) == pytest.approx(0.34, abs=0.05)
    calm = draw_fate(shipped.handling, shipped.contact, "0 0 1", faults=False)
    assert not (calm.missed or calm.sticks) and calm.rise == 0.0
    assert calm.slip_at_um == math.inf and calm.drop_after_um == math.inf


def test_without_faults_tools_are_where_they_are_drawn() -> None:
    assert before_the_fibre(Bench()).force_side.offsets.still


def test_faults_that_make_no_sense_are_refused() -> None:
    faults = Bench().scene.faults
    for name, how in (
        ("no_such", {}),
        ("missed_grasp", {"times": 0}),
        ("light_dimmed", {"amount": 3.0}),
        ("tip_bent", {"tool": "hammer"}),
        ("steps_lost", {"tool": "left.x"}),
        ("steps_lost", {"amount": 1.5}),
        ("sensor_drift", {"tool": "nose"}),
        ("sensor_drift", {"amount": math.nan}),
    ):
        with pytest.raises(ValueError, match=name) as refused:
            faults.inject(name, **how)  # type: ignore[arg-type]
        assert isinstance(refused.value, CosmicError), name
    assert faults.active == ()
