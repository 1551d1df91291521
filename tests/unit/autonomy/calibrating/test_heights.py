"""Heights from where plate and tips are in focus, on images that blur as a lens does."""

from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from typing_extensions import override

from cosmic.autonomy.calibrating.calibrated import POOR
from cosmic.autonomy.calibrating.heights import HeightByFocus
from cosmic.autonomy.calibrating.registry import CalibrationRegistry, CalibrationStanding
from cosmic.autonomy.handling.context import HEIGHTS, HandlingContext
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.frame.clock import ManualClock
from cosmic.vico.api.lens import LensHandle
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.core.tool_settings import ToolSettings
from cosmic.vico.hw.peripherals import LensState
from unit.autonomy.handling.test_push import GRIPPER, PROBE, Done

UM_COUNT, PLATE_COUNTS, LYING_UM = 0.38, 4050.0, 4.0


class Moved(Done):
    """A movement that has ended well."""

    def exception(self, timeout: float | None = 0.0) -> None:
        """Nothing went wrong."""


class Lens(LensHandle):
    """A focus that goes where it is sent."""

    def __init__(self) -> None:
        self.counts, self.zoomed = 4000, 0.58
        self.gone_counts = 0

    @override
    def state(self, axis: Any) -> LensState:
        return LensState(self.counts, 8000, moving=False, homed=True, at_home=False, at_limit=False)

    @override
    def seek_focus(self, target_counts: int) -> Any:
        self.gone_counts += abs(target_counts - self.counts)
        self.counts = target_counts
        return Moved()

    @override
    def zoom_to(self, zoom: float) -> Any:
        self.zoomed = zoom
        return Moved()


class Bench(HandlingContext):
    """A plate with a fibre, tips that are higher than their stages say, and a lens."""

    def __init__(self, *, up_um: float = 0.0, probe_up_um: float = 0.0, fibre: bool = True) -> None:
        bench: Any = self
        clock = ManualClock(auto_advance=True)
        super().__init__(bench, bench, bench, HandlingSettings(), clock, bench)
        self.at_um = {
            "left.x": 0.0,
            "left.y": 0.0,
            "left.z": 0.0,
            "probe.x": 0.0,
            "probe.y": 1000.0,
        }
        self.up, self.probe_up, self.with_fibre = up_um, probe_up_um, fibre
        self.lowest_um, self.lens = np.inf, Lens()
        self.random = np.random.default_rng(7)

    def __getitem__(self, name: str) -> Any:
        return SimpleNamespace(position_um=self.at_um.get(name, 0.0), limits=None)

    @override
    def tool(self, name: str) -> ToolSettings:
        return PROBE if name == "probe" else GRIPPER

    @override
    def go(self, targets: Any) -> Any:
        self.at_um |= targets
        self.lowest_um = min(self.lowest_um, 1500.0 + self.at_um["left.z"] + self.up)
        return Moved()

    @override
    def image(self) -> Any:
        focus_um = (self.lens.counts - PLATE_COUNTS) * UM_COUNT + LYING_UM
        image = np.full((60, 80), 165.0)
        if self.with_fibre:
            image = self._drawn(image, (10, 14), LYING_UM - focus_um)
        if abs(self.at_um["left.x"] - 4000.0) < 100.0:
            high = 1500.0 + self.at_um["left.z"] + self.up
            image = self._drawn(image, (24, 40), high - focus_um)
        if self.at_um["probe.y"] < -4900.0:
            image = self._drawn(image, (30, 38), 700.0 - 25.0 + self.probe_up - focus_um)
        noisy = image + self.random.normal(0.0, 0.3, image.shape)
        frame: Any = SimpleNamespace(data=np.clip(noisy, 0, 255).astype(np.uint8), exposed_s=0.0)
        return Done(CameraImage("top", frame, Circumstances()))

    def _drawn(self, image: Any, rows: tuple[int, int], off_um: float) -> Any:
        dark = np.zeros_like(image)
        dark[rows[0] : rows[1], :60] = 1.0
        deep = 1.0 if self.lens.zoomed >= 5.0 else 0.3
        sigma_px = float(np.hypot(1.5, 0.03 * deep * off_um))
        blurred = cv2.GaussianBlur(dark, (0, 0), sigma_px)
        return image * (1.0 - 0.7 * blurred)


def carried_out(bench: Bench) -> None:
    steps = HeightByFocus().run(bench)
    try:
        wish: Any = next(steps)
        while True:
            wish = steps.send(wish.wait() if hasattr(wish, "wait") else None)
    except StopIteration:
        pass


@pytest.mark.parametrize("up_um", [0.0, 40.0, -35.0])
def test_a_tip_that_is_not_where_the_file_has_it_is_found_in_height(up_um: float) -> None:
    bench = Bench(up_um=up_um, probe_up_um=6.0)
    carried_out(bench)
    assert bench.up_um(GRIPPER) == pytest.approx(up_um, abs=5.0)
    assert bench.up_um(PROBE) == pytest.approx(6.0, abs=6.0)
    assert bench.lowest_um > 250.0, "it is looked at far from the plate"
    entry = bench.calibration.registry.get(HEIGHTS, "left")
    assert entry is not None
    assert entry.values["counts_um"] == pytest.approx(1.0 / UM_COUNT, rel=0.02)
    assert 0.0 < entry.residual < 12.0


def test_the_focus_goes_up_from_the_plate_to_the_tips_and_not_to_and_fro() -> None:
    bench = Bench(up_um=40.0)
    carried_out(bench)
    reach = bench.settings.calibration.focus_reach_um / bench.settings.calibration.focus_um_count
    highest = bench.hold_tip_um / UM_COUNT
    # Four sweeps, each begun from below with the play taken up, and once the path up to the tips.
    assert bench.lens.gone_counts < 4.0 * (4.0 * reach + 200.0) + highest


def test_grasps_are_made_at_the_height_that_was_found() -> None:
    bench = Bench(up_um=40.0)
    carried_out(bench)
    bench.go_up(bench.grasp_um)
    assert bench.lowest_um == pytest.approx(bench.settings.places.grasp_um, abs=5.0)
    assert bench.height_now() == pytest.approx(bench.grasp_um)


def test_on_a_bare_plate_no_height_is_found_and_none_is_put_in_force() -> None:
    bench = Bench(fibre=False)
    with pytest.raises(OperationFailed, match="the plate and what lies on it: no focus found") as e:
        carried_out(bench)
    assert e.value.cause == POOR
    assert bench.calibration.up_um == {}
    (entry,) = bench.calibration.registry.entries
    assert bench.calibration.registry.standing(entry) is CalibrationStanding.POOR


def test_one_of_an_earlier_start_is_looked_at_and_taken_where_it_holds() -> None:
    first = Bench(up_um=40.0)
    carried_out(first)
    again = Bench(up_um=41.0)
    again.calibration.registry = later(first.calibration.registry)
    carried_out(again)
    assert again.up_um(GRIPPER) == first.up_um(GRIPPER), "taken from the registry"
    moved = Bench(up_um=70.0)
    moved.calibration.registry = later(first.calibration.registry)
    carried_out(moved)
    assert moved.up_um(GRIPPER) == pytest.approx(70.0, abs=5.0), "measured anew"


def later(registry: CalibrationRegistry) -> CalibrationRegistry:
    """Return the same registry after a restart."""
    again = CalibrationRegistry()
    for entry in registry.entries:
        again._known[entry.key] = entry
    return again
