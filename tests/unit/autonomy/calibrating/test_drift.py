"""What moved is followed; noise is not, and what moved far is measured anew."""

from typing import Any

import pytest

from cosmic.autonomy.calibrating.drift import DRIFT, CheckDrift, follow
from cosmic.autonomy.calibrating.registry import CalibrationEntry
from cosmic.autonomy.calibrations import Calibrations
from cosmic.autonomy.coordinate_transform import PlatformTransform
from cosmic.autonomy.handling.context import HEIGHTS, Calibration, HandlingContext, Measured
from cosmic.autonomy.handling.plate import PlateFrame
from cosmic.autonomy.handling.prepare import HELD, PLATE, PROBE
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.handling.tips import TipOff, shift_maps
from cosmic.frame.clock import ManualClock
from unit.autonomy.test_calibrations import plane

PIXEL = (900.0, 500.0)


class Work:
    """As much of the work as following a drift needs."""

    def __init__(self) -> None:
        self.settings = HandlingSettings()
        self.clock = ManualClock()
        self.calibration = Calibration(frame=PlateFrame((10.0, -5.0)))
        self.calibration.probe_off_um = self.calibration.seen_off_um = 1.0, 2.0
        self.gripper: Any = type("Tool", (), {"name": "left"})
        self.shared = self
        self.finished: list[object] = []
        self.vision = self
        self.first_camera = "top"
        self.transform = PlatformTransform.__new__(PlatformTransform)
        self.transform.calibrations = Calibrations(["top"], ["left"], None)
        self.transform.calibrations.add_plane("top", "left", plane(0.0, 12.0))
        registry = self.calibration.registry
        for name in (PLATE, HELD, PROBE):
            values = {"off_x_um": 1.0, "off_y_um": 2.0} if name == PROBE else {}
            registry.put(
                CalibrationEntry(
                    name, "left", values, 0.1, "px", 0.5, registry.now(), 0.0, registry.session
                )
            )
            self.calibration.made[name] = Measured(0.0, 0.1, "px")

    def place_um(self) -> list[float]:
        plane = self.transform.calibrations.get("top", "left").planes[0]
        return [float(each) for each in plane.fit.map.to_um(PIXEL)]


def followed(work: Any, gripper: tuple[float, float], probe: tuple[float, float]) -> Any:
    follow(work, TipOff(gripper, 0.2), TipOff(probe, 0.2))
    return work


def test_maps_and_rotation_centre_follow_a_gripper_that_moved() -> None:
    work = Work()
    x, y = work.place_um()
    followed(work, (3.0, -1.0), (4.0, 1.0))
    assert work.place_um() == pytest.approx([x - 3.0, y + 1.0])
    assert work.calibration.frame.centre_um == (7.0, -4.0)
    assert work.calibration.probe_off_um == (1.0, 2.0), "both went along"


def test_the_probe_is_followed_from_where_a_touch_has_it() -> None:
    work = Work()
    work.calibration.probe_off_um = 1.0, 4.5
    followed(work, (0.0, 0.0), (1.0, 4.0))
    assert work.calibration.probe_off_um == pytest.approx((1.0, 6.5))
    assert work.calibration.seen_off_um == (1.0, 4.0)
    entry = work.calibration.registry.get(PROBE, "left")
    assert entry is not None
    assert entry.values["off_y_um"] == pytest.approx(6.5)


def test_a_probe_with_a_fibre_at_its_edge_is_not_followed() -> None:
    work: Any = Work()
    x, y = work.place_um()
    follow(work, TipOff((3.0, -1.0), 0.2), TipOff((4.0, -18.0), 0.2, certain=False))
    assert work.calibration.probe_off_um == (1.0, 2.0)
    assert work.place_um() == pytest.approx([x - 3.0, y + 1.0])


def test_what_may_be_noise_is_left_alone() -> None:
    work = Work()
    before = work.place_um()
    followed(work, (0.5, 0.6), (1.7, 2.9))
    assert work.place_um() == before
    assert work.calibration.probe_off_um == (1.0, 2.0)
    entry = work.calibration.registry.get(DRIFT, "left")
    assert entry is not None
    assert entry.values["followed_from_um"] == 1.0
    unsure = Work()
    follow(unsure, TipOff((2.0, 0.0), 0.9), TipOff((3.0, 2.0), 0.9))  # type: ignore[arg-type]
    assert unsure.place_um() == before, "at that zoom 1 um cannot be told"


@pytest.mark.parametrize("probe", [(50.0, 0.0), (float("nan"), 0.0)])
def test_what_moved_far_or_nowhere_is_measured_anew(probe: tuple[float, float]) -> None:
    work = followed(Work(), (0.0, 0.0), probe)
    assert work.calibration.made == {}
    assert work.calibration.registry.get(PLATE, "left") is None


def test_it_is_looked_at_only_after_so_many_fibres() -> None:
    work: Any = Work()
    looked = []
    for _ in range(11):
        work.finished.append(object())
        work.go = work.go_up = None
        try:
            list(CheckDrift().run(work))
        except (AttributeError, TypeError):
            looked.append(len(work.finished))
    assert looked == [work.settings.calibration.drift_fibres]


def test_a_run_of_the_zoom_moves_the_maps_of_that_zoom_and_not_the_plate() -> None:
    work: Any = Work()
    calibrations = work.transform.calibrations
    calibrations.add_plane("top", "left", plane(500.0, 12.0))
    before = [each.fit.map.centre_um for each in calibrations.get("top", "left").planes]
    shift_maps(work, TipOff((3.0, -1.0), 0.2, zoom_counts=500.0), lens=True)
    after = [each.fit.map.centre_um for each in calibrations.get("top", "left").planes]
    assert after[0] == before[0]
    assert after[1] == pytest.approx((before[1][0] - 3.0, before[1][1] + 1.0))
    assert work.calibration.frame.centre_um == (10.0, -5.0)


def test_drift_is_found_on_the_image_before_the_zoom_ran() -> None:
    work: Any = Work()
    x, y = work.place_um()
    here = TipOff((2.0, 0.0), 0.2, zoom_counts=0.0)
    at_zoom = TipOff((30.0, -20.0), 0.2, zoom_counts=500.0)
    follow(work, at_zoom, TipOff((32.0, -17.0), 0.2, zoom_counts=500.0), here)
    assert work.place_um() == pytest.approx([x - 2.0, y])
    assert work.calibration.frame.centre_um == (8.0, -5.0)
    assert work.calibration.probe_off_um == pytest.approx((2.0, 3.0)), "1 um each further"


def context() -> HandlingContext:
    nothing: Any = None
    return HandlingContext(
        mico=nothing,
        daqco=nothing,
        vico=nothing,
        settings=HandlingSettings(),
        clock=ManualClock(),
        forces=nothing,
    )


def test_grasps_go_no_lower_than_measured_heights_bear_and_have_them_measured_anew() -> None:
    work, lowest = context(), HandlingSettings().places.lowest_um
    work.calibration.made[HEIGHTS] = Measured(0.0, 2.0, "um")
    heights = []
    while HEIGHTS in work.calibration.made:
        work.learn_height(held=False)
        heights.append(work.grasp_um)
    assert min(heights) == pytest.approx(lowest)
    assert work.grasp_um == HandlingSettings().places.grasp_um


def test_a_height_that_is_wrong_by_what_is_usual_presses_no_jaw_deep_into_the_plate() -> None:
    """Heights were 3.7 um off at worst in campaigns; 1 um is what a jaw may press."""
    work = context()
    work.calibration.made[HEIGHTS] = Measured(0.0, 2.0, "um")
    work.calibration.up_um["left"] = 0.4
    heights = []
    for _ in range(6):  # the tries at one fibre go on where heights are to be measured anew
        work.learn_height(held=False)
        heights.append(work.grasp_um)
    assert HEIGHTS not in work.calibration.made
    assert 3.7 - min(heights) <= 1.0


def test_where_no_height_was_measured_grasps_feel_their_way_down() -> None:
    work = context()
    for _ in range(9):
        work.learn_height(held=False)
    assert work.grasp_um == pytest.approx(7.0 - HandlingSettings().places.stray_um)
