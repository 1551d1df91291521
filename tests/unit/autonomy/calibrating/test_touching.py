"""The probe feels for a jaw: it finds it, presses lightly, and says where touch is no use."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typing_extensions import override

from cosmic.autonomy.calibrating.calibrated import POOR
from cosmic.autonomy.calibrating.touching import TOUCH, TouchJaw
from cosmic.autonomy.handling.context import HandlingContext, Measured
from cosmic.autonomy.handling.force import ForceMean
from cosmic.autonomy.handling.prepare import PROBE
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.frame.clock import ManualClock
from cosmic.vico.core.tool_settings import ToolSettings
from unit.autonomy.handling.test_push import GRIPPER, Daqco, Done
from unit.autonomy.handling.test_push import PROBE as PROBE_TOOL

SENSOR_UN_UM = 800.0


class Axis:
    """One of the bench's axes; steps of the probe are small and not alike."""

    limits = None

    def __init__(self, bench: "Bench", name: str) -> None:
        self.bench, self.name = bench, name

    @property
    def position_um(self) -> float:
        return self.bench.at_um[self.name]

    def set_estimate(self, position: float, *, std_um: float | None) -> None:
        self.bench.at_um[self.name] = position

    def steps(
        self, steps: int, *, frequency_hz: float, wait: bool, amplitude_v: float = 100.0
    ) -> Any:
        step_um = 1.0 if self.name.endswith("gripper") else self.bench.step_um
        self.bench.at_um[self.name] += steps * step_um * (1.0 + 0.1 * self.bench.random.random())
        return Moved()


class Moved(Done):
    """A movement that has ended well."""

    def exception(self, timeout: float | None = 0.0) -> None:
        """Nothing went wrong."""


class Axes:
    """The axes of a bench, as MiCo has them."""

    settings = SimpleNamespace(positioner=[SimpleNamespace(name="left.gripper", step_um=1.0)])

    def __init__(self, bench: "Bench") -> None:
        self.collision = bench
        self._bench = bench

    def __getitem__(self, name: str) -> Axis:
        return Axis(self._bench, name)


class Bench(HandlingContext):
    """Closed jaws, a probe whose tip is off, and the force of one on the other; no platform."""

    def __init__(self, *, off_um: float = 1.7, seen_um: float = 1.0, step_um: float = 0.08) -> None:
        clock = ManualClock(auto_advance=True)
        bench: Any = self
        axes: Any = Axes(self)
        settings = HandlingSettings()
        super().__init__(axes, Daqco(), bench, settings, clock, bench)  # type: ignore[arg-type]
        self.at_um = {
            "left.x": 0.0,
            "left.y": 0.0,
            "left.z": 0.0,
            "left.gripper": 300.0,
            "probe.x": 0.0,
            "probe.y": 1000.0,
        }
        self.off_um, self.step_um, self.peak_un = off_um, step_um, 0.0
        self.random = np.random.default_rng(5)
        self.allowed: list[str] = []
        self.calibration.made[PROBE] = Measured(0.0, 0.1, "px")
        self.calibration.probe_off_um = 0.5, seen_um

    @contextmanager
    def contact(self, name: str) -> Iterator[None]:
        self.allowed.append(name)
        yield

    @override
    def tool(self, name: str) -> ToolSettings:
        return PROBE_TOOL if name == "probe" else GRIPPER

    @override
    def go(self, targets: Any) -> Any:
        self.at_um |= targets
        return Moved()

    def wanted(self, seconds: float, *, settle_s: float = 0.0) -> Done:
        self.clock.sleep(seconds)
        face = 600.0 + 100.0
        depth = face - (5000.0 + self.at_um["probe.y"] + self.off_um)
        force = SENSOR_UN_UM * max(0.0, depth) if self.off_um > -900.0 else 0.0
        self.peak_un = max(self.peak_un, force)
        noise = float(self.random.normal(0.0, 0.3 / math.sqrt(1000.0 * seconds)))
        return Done(ForceMean(0.7 + force + noise, 0.05, self.clock.now_s(), 10))


def carried_out(bench: Bench) -> None:
    steps = TouchJaw().run(bench)
    try:
        wish: Any = next(steps)
        while True:
            wish = steps.send(wish.wait() if hasattr(wish, "wait") else None)
    except StopIteration:
        pass


def test_touch_finds_where_the_probe_is_and_presses_lightly() -> None:
    bench = Bench()
    carried_out(bench)
    off_x, off_y = bench.calibration.probe_off_um
    assert off_x == 0.5, "it feels in one direction only"
    assert off_y == pytest.approx(bench.off_um, abs=0.1)
    assert bench.peak_un < 0.8 * 180.0
    entry = bench.calibration.registry.get(TOUCH, "left")
    assert entry is not None
    assert entry.residual <= 0.1
    assert entry.values["apart_um"] == pytest.approx(0.7, abs=0.1)


def test_the_contact_is_allowed_while_it_lasts_and_the_limit_armed() -> None:
    bench = Bench()
    carried_out(bench)
    assert set(bench.allowed) == {"grasp", "touch"}
    assert bench.daqco.armed == [True, False]  # type: ignore[attr-defined]
    assert bench.at_um["probe.y"] + 5000.0 == bench.settings.places.probe_away_y_um
    assert not bench.calibration.touching


def test_what_is_far_from_where_the_image_shows_it_is_refused_with_numbers() -> None:
    bench = Bench(off_um=13.0, seen_um=1.0)
    with pytest.raises(OperationFailed, match=r"disagree by 12\.\d um, at most 10 um") as failed:
        carried_out(bench)
    assert failed.value.cause == POOR
    assert bench.calibration.registry.get(TOUCH, "left") is None
    assert bench.peak_un < 0.8 * 180.0


def test_what_is_felt_too_early_ends_it_before_any_further_step() -> None:
    bench = Bench(off_um=-19.05)
    with pytest.raises(OperationFailed, match="contact force before the expected jaw position"):
        carried_out(bench)
    assert bench.peak_un < 0.8 * 180.0


def test_where_nothing_is_felt_it_ends_and_says_so() -> None:
    with pytest.raises(OperationFailed, match="no contact within 4"):
        carried_out(Bench(off_um=-999.0))


def test_steps_that_are_too_long_to_be_safe_are_noticed_before_anything_is_touched() -> None:
    bench = Bench(step_um=0.4)
    with pytest.raises(OperationFailed, match=r"step of the probe went .* um, .* um are safe"):
        carried_out(bench)
    assert bench.peak_un == 0.0


def test_without_an_image_of_both_nothing_is_touched() -> None:
    bench = Bench()
    del bench.calibration.made[PROBE]
    with pytest.raises(OperationFailed, match="probe and gripper must be in one image"):
        carried_out(bench)
    assert bench.allowed == []
