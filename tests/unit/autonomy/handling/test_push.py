"""The probe finds a held fibre and pushes it, however stiff it is and wherever it is."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from typing_extensions import override

from cosmic.autonomy.bending.fit import fit_bending
from cosmic.autonomy.handling import push, sight
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.force import ForceMean
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.handling.plate import Candidate, Reach
from cosmic.autonomy.handling.push import (
    NO_CONTACT,
    TOO_HIGH,
    PushSpans,
    StepBack,
    span_limits,
)
from cosmic.autonomy.handling.settings import HandlingSettings, PushSettings
from cosmic.autonomy.procedures.operation import OperationFailed, Steps
from cosmic.daqco.core.settings import LimitSettings
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import MoveCancelled, NotAvailable
from cosmic.vico.core.tool_settings import ToolSettings

GRIPPER = ToolSettings(
    name="left",
    x_axis="left.x",
    y_axis="left.y",
    z_axis="left.z",
    gap_axis="left.gripper",
    tip_um=(-4000.0, 0.0, 1500.0),
    forward=(1.0, 0.0),
    width_um=100.0,
)
PROBE = ToolSettings(
    name="probe",
    x_axis="probe.x",
    y_axis="probe.y",
    tip_um=(0.0, 5000.0, 700.0),
    forward=(0.0, -1.0),
    width_um=50.0,
)
CLAMP_UM, SENSOR_UN_UM, WIDTH_UM, ZERO_UN = 9.0, 800.0, 30.0, 1.3
STRIDE_UM = 0.66


class Done:
    """Something waited for that has ended."""

    done = True

    def __init__(self, result: object = None) -> None:
        self.result = result

    def wait(self, timeout_s: float | None = None) -> object:
        return self.result

    def cancel(self) -> None:
        """Nothing is running."""


class Going(Done):
    """An axis on its way, looked at every 0.2 um as samples come; it can be cancelled."""

    done = False

    def __init__(self, bench: "Bench", targets: dict[str, float]) -> None:
        super().__init__()
        self.bench, self.targets, self.cancelled = bench, targets, False

    @override
    def wait(self, timeout_s: float | None = None) -> object:
        here = {axis: self.bench.at_um[axis] for axis in self.targets}
        ahead = here.get("probe.y", 0.0) - self.targets.get("probe.y", 0.0)
        for part in np.linspace(0.0, 1.0, max(2, math.ceil(min(5.0 * abs(ahead), 2000.0)))):
            for axis, began in here.items():
                self.bench.at_um[axis] = began + float(part) * (self.targets[axis] - began)
            force = self.bench.force_un()
            self.bench.felt_un = ZERO_UN + force
            if ahead > 10.0:  # no step of a search is so long
                self.bench.at_once_un = max(self.bench.at_once_un, force)
            for each in tuple(self.bench.listeners):
                each()
            if self.cancelled:
                self._run_on()
                self.done = True
                raise MoveCancelled("cancelled")
        self.done = True
        return None

    @override
    def cancel(self) -> None:
        self.cancelled = True

    def _run_on(self) -> None:
        """Go as far as the probe goes until it has stopped."""
        bench = self.bench
        bench.at_um["probe.y"] -= bench.reaction_s * STRIDE_UM * bench.frequency_hz
        bench.at_once_un = max(bench.at_once_un, bench.force_un())


class Axis:
    """One of the bench's axes: it is where it was sent."""

    limits = (-5500.0, 5500.0)

    def __init__(self, bench: "Bench", name: str) -> None:
        self.bench, self.name = bench, name

    @property
    def position_um(self) -> float:
        return round(self.bench.at_um[self.name], 1)

    def set_closed_loop_frequency(self, frequency_hz: float) -> None:
        assert float(frequency_hz).is_integer(), "controllers take whole numbers"
        self.bench.frequency_hz = frequency_hz


class Daqco:
    """Notes whether the limit was armed."""

    running = True

    def __init__(self) -> None:
        self.armed: list[bool] = []
        self.limits: list[Any] = []

    def set_limit(self, limit: Any) -> None:
        self.armed.append(limit.armed)
        self.limits = [SimpleNamespace(settings=limit)]

    def disarm_limit(self, _channel: str) -> None:
        self.set_limit(self.limits[0].settings.model_copy(update={"armed": False}))


class Bench(HandlingContext):
    """A fibre in the jaws, a probe, and the force of one on the other; no platform."""

    def __init__(
        self,
        ei_n_m2: float,
        *,
        off_um: float = 0.0,
        tilt: float = 0.0,
        there: bool = True,
        length_um: float = 1200.0,
    ) -> None:
        clock = ManualClock(auto_advance=True)
        settings = HandlingSettings(push=PushSettings(stop_un=140.0))
        bench: Any = self
        super().__init__(bench, Daqco(), bench, settings, clock, bench)  # type: ignore[arg-type]
        places = settings.places
        self.at_um = {
            "left.x": 4000.0,
            "left.y": places.hold_y_um,
            "left.z": -810.0,
            "probe.x": 0.0,
            "probe.y": 1000.0,
        }
        self.ei, self.off_um, self.there = ei_n_m2 * 1e18, off_um, there
        self.tilt, self.at_once_un, self.stiffer = tilt, 0.0, 1.0
        self.heights_um: list[float] = []
        self.reach_um, self.lost = math.inf, False
        self.listeners, self.felt_un, self.frequency_hz = list[Any](), ZERO_UN, 0.0
        self.peak_un, self.random = 0.0, np.random.default_rng(3)
        self.reaction_s = 0.0
        self.microscope = SimpleNamespace(name="microscope", problem="")
        line = np.column_stack([np.linspace(0.0, length_um, 61), np.zeros(61)])
        reach = Reach(Candidate(line, length_um, WIDTH_UM, 0.0, 60.0), 0.0, line, (250.0, 0.0))
        self.free_um = length_um - 250.0
        self.fibre = HeldFibre(1, reach, inside_um=250.0, free_um=self.free_um, held=True)

    def __getitem__(self, name: str) -> Axis:
        return Axis(self, name)

    def camera(self, _name: str) -> SimpleNamespace:
        return self.microscope

    @override
    def tool(self, name: str) -> ToolSettings:
        return PROBE if name == "probe" else GRIPPER

    @override
    def go(self, targets: Any) -> Any:
        if "left.z" in targets:
            self.heights_um.append(targets["left.z"])
            self.lost |= abs(targets["left.z"] - self.at_um["left.z"]) > self.reach_um
        elif targets.get("probe.y", 0.0) > self.at_um["probe.y"]:
            self.lost = False  # the probe is drawn back in front of it
        return Going(self, targets)

    def subscribe(self, listener: Any) -> Any:
        self.listeners.append(listener)
        return lambda: self.listeners.remove(listener)

    def farthest_un(self, low_un: float, high_un: float) -> float | None:
        return None if low_un <= self.felt_un <= high_un else self.felt_un

    def wanted(self, seconds: float, *, settle_s: float = 0.0) -> Done:
        self.clock.sleep(seconds + settle_s)
        std = 0.3 / math.sqrt(1000.0 * seconds)
        force = ZERO_UN + self.force_un() + self.random.normal(0.0, std)
        return Done(ForceMean(float(force), std, self.clock.now_s(), 40))

    def take_peak_un(self) -> float:
        return self.peak_un

    def force_un(self) -> float:
        """Return what the fibre pushes back with."""
        ahead = self.at_um["probe.x"] - 0.0
        surface = self.at_um["left.y"] + WIDTH_UM / 2.0 + self.off_um + self.tilt * ahead
        way = surface - (5000.0 + self.at_um["probe.y"])
        if not (self.there and not self.lost and way > 0.0 and 0.0 < ahead < self.free_um):
            return 0.0
        fibre = 3.0 * self.ei / (ahead + CLAMP_UM) ** 3
        fibre *= self.stiffer if ahead < 400.0 else 1.0
        force = way / (1.0 / fibre + 1.0 / SENSOR_UN_UM)
        self.peak_un = max(self.peak_un, force)
        return force


def carried_out(steps: Steps, clock: ManualClock | None = None) -> None:
    result: object = None
    while True:
        try:
            wish = steps.send(result)
        except StopIteration:
            return
        result = wish.wait(0.0) if hasattr(wish, "wait") else None
        if clock is not None and isinstance(wish, float):
            clock.sleep(wish)


@pytest.mark.parametrize("off_um", [-30.0, 45.0])
@pytest.mark.parametrize("ei_n_m2", [1e-12, 5e-11, 4e-10])
def test_the_stiffness_is_found_and_the_sensor_spared(ei_n_m2: float, off_um: float):
    bench = Bench(ei_n_m2, off_um=off_um)
    carried_out(PushSpans().run(bench))
    fibre = bench.held_fibre()
    assert len(fibre.spans) == 5
    assert bench.peak_un <= 0.8 * 180.0
    fit = bench.settings.push.fit.model_copy(update={"fibre_width_um": 0.0, "edge_radius_um": 0.0})
    found = fit_bending(fibre.spans, settings=fit)
    assert found.ei_n_m2 == pytest.approx(ei_n_m2, rel=0.06 if ei_n_m2 < 2e-10 else 0.15)
    assert found.ei_low_n_m2 < ei_n_m2 < found.ei_high_n_m2


def test_stages_rest_before_the_first_push_while_the_fibre_is_looked_for():
    bench = Bench(5e-11, off_um=20.0)
    assert isinstance(bench.clock, ManualClock)
    carried_out(PushSpans().run(bench), bench.clock)
    first, second = bench.held_fibre().spans[:2]
    met = int(np.argmax(first.force_un - ZERO_UN > 0.6))
    rest_s = bench.settings.push.rest_s
    # It was looked for, and found, before what counts began; that took no time of its own.
    assert first.probe_um[met] - first.probe_um[1] < 15.0
    assert rest_s <= first.time_s[1] - first.time_s[0] <= rest_s + 0.5
    assert second.time_s[-1] - second.time_s[0] < first.time_s[-1] - first.time_s[0]


@pytest.mark.parametrize("off_um", [0.0, 1.5, 3.0, 4.5, 6.0, 7.5])
@pytest.mark.parametrize("ei_n_m2", [3e-11, 3e-10])
def test_a_fibre_is_slid_wherever_in_a_step_of_the_search_it_was_met(ei_n_m2: float, off_um: float):
    bench = Bench(ei_n_m2, off_um=off_um)
    carried_out(PushSpans().run(bench))
    spans = bench.held_fibre().spans
    assert [each.freed is not None for each in spans] == [True, False, True, False, True]


def test_every_other_span_is_slid_up_and_down_and_comes_back_to_where_it_was():
    bench = Bench(5e-11)
    carried_out(PushSpans().run(bench))
    spans = bench.held_fibre().spans
    assert [each.freed is not None for each in spans] == [True, False, True, False, True]
    for span in spans[::2]:
        assert span.freed is not None
        before = span.force_un[span.freed.after]
        assert before - ZERO_UN > 1.0
        # The bench has no friction: the force is what it was.
        assert span.freed.up_un.mean() == pytest.approx(before, abs=0.3)
        assert span.freed.down_un.mean() == pytest.approx(before, abs=0.3)
    assert sorted(bench.heights_um) == pytest.approx([-820.0] * 3 + [-810.0] * 6 + [-800.0] * 3)


@pytest.mark.parametrize("ei_n_m2", [1e-12, 5e-11, 4e-10])
def test_a_fibre_is_slid_where_it_is_pressed_far_enough_and_by_half_of_its_push(ei_n_m2: float):
    bench = Bench(ei_n_m2)
    carried_out(PushSpans().run(bench))
    slid = [each for each in bench.held_fibre().spans if each.freed is not None]
    assert slid
    for span in slid:
        assert span.freed is not None
        k_un_um = 1.0 / (
            (span.nominal_um + CLAMP_UM) ** 3 / (3.0 * ei_n_m2 * 1e18) + 1.0 / SENSOR_UN_UM
        )
        before_un = span.force_un[span.freed.after] - ZERO_UN
        # The search before may have gone farther than the push: it is not in its steps.
        pushed_un = span.force_un[span.freed.after + 1 :]
        pressed_um, stroke_um = before_un / k_un_um, float(np.ptp(pushed_un)) / k_un_um
        wanted_um = min(bench.settings.push.slide_um / 4.0, 0.5 * stroke_um)
        assert pressed_um > 0.65 * wanted_um
        # Of a soft fibre the force is small at first, and it is pressed until it is clear.
        assert pressed_um < 1.35 * max(wanted_um, bench.settings.push.slide_un / k_un_um) + 0.5
        assert pressed_um <= 0.6 * bench.settings.push.slide_um
        assert before_un <= 0.6 * bench.settings.push.limit_un


def test_a_fibre_that_left_the_probe_as_it_was_slid_is_measured_without():
    bench = Bench(5e-11)
    bench.reach_um = 5.0
    carried_out(PushSpans().run(bench))
    fibre = bench.held_fibre()
    assert fibre.slid_off
    assert len(bench.heights_um) == 4, "once, and never again"
    assert [each.freed for each in fibre.spans] == [None] * 5


def test_the_standard_is_round_and_is_not_slid():
    bench = Bench(5e-11)
    bench.held_fibre().standard = True
    carried_out(PushSpans().run(bench))
    assert bench.heights_um == []


def push_without_camera(
    bench: Bench, operation: PushSpans, wall: ManualClock, *, back_after: int = 0
) -> None:
    """Push while the camera is lost, and time passes between the spans."""
    spans = bench.held_fibre().spans
    bench.microscope.problem = "it was unplugged"
    before, steps = len(spans), operation.run(bench)
    result: object = None
    while True:
        try:
            wish = steps.send(result)
        except StopIteration:
            return
        if len(spans) > before:
            before = len(spans)
            wall.advance(0.6 * sight.GIVE_UP_WALL_S)
            if before == back_after:
                bench.microscope.problem = ""
        result = wish.wait(0.0) if hasattr(wish, "wait") else None


def test_a_fibre_is_not_pushed_on_where_the_camera_stays_lost(monkeypatch: pytest.MonkeyPatch):
    wall = ManualClock()
    monkeypatch.setattr(sight, "WALL", wall)
    bench = Bench(5e-11)
    with pytest.raises(NotAvailable, match="no image of microscope: it was unplugged"):
        push_without_camera(bench, PushSpans(), wall)
    assert len(bench.held_fibre().spans) == 2
    assert bench.force_un() == 0.0, "the probe stands off the fibre"


def test_a_camera_that_comes_back_ends_no_push(monkeypatch: pytest.MonkeyPatch):
    wall = ManualClock()
    monkeypatch.setattr(sight, "WALL", wall)
    bench = Bench(5e-11)
    push_without_camera(bench, PushSpans(), wall, back_after=1)
    assert len(bench.held_fibre().spans) == 5


def test_a_fibre_that_need_not_be_seen_afterwards_is_pushed_without_a_camera(
    monkeypatch: pytest.MonkeyPatch,
):
    wall = ManualClock()
    monkeypatch.setattr(sight, "WALL", wall)
    bench = Bench(5e-11)
    push_without_camera(bench, PushSpans(seen_after=False), wall)
    assert len(bench.held_fibre().spans) == 5


def places_um(bench: Bench) -> list[float]:
    """Return where a fibre was pushed, from the jaws."""
    carried_out(PushSpans().run(bench))
    return [each.nominal_um for each in bench.held_fibre().spans]


@pytest.mark.parametrize(("longest_um", "farthest_um"), [(900.0, 900.0), (400.0, 400.0)])
def test_the_standard_is_bent_as_far_out_as_its_own_settings_say(
    longest_um: float, farthest_um: float
):
    bench = Bench(1.8e-10, length_um=2000.0)
    beam = bench.settings.standard.model_copy(update={"longest_um": longest_um})
    bench.settings = bench.settings.model_copy(update={"standard": beam})
    assert places_um(bench)[0] == pytest.approx(600.0, abs=5.0), "where fibres are pushed"
    bench.held_fibre().standard = True
    places = places_um(bench)
    assert places[0] == pytest.approx(farthest_um, abs=5.0)
    assert places[-1] < 300.0
    assert np.ptp(bench.held_fibre().spans[0].force_un) > 55.0, "by as much more, far out"


def test_a_standard_that_is_not_met_far_out_is_tried_where_fibres_are_before_it_is_tilted(
    monkeypatch: pytest.MonkeyPatch,
):
    bench = Bench(1.8e-10, length_um=2000.0)
    fibre = bench.held_fibre()
    fibre.standard = True
    tried: list[tuple[float, int]] = []
    for _ in range(4):
        tried.append((span_limits(bench).longest_um, fibre.tilts))
        not_met = OperationFailed(NO_CONTACT, "the probe met nothing")
        bench.failures.append(("push the spans", not_met))
        monkeypatch.setattr(push, "see_it_follow", lambda *_: iter(()))
        carried_out(StepBack().run(bench))
    assert tried == [(900.0, 0), (600.0, 0), (330.0, 1), (330.0, 2)]


def test_the_standard_is_bent_as_its_own_diameter_bears_and_not_as_wide_as_it_looks():
    strokes = []
    for width_um in (10.0, 80.0):
        bench = Bench(5e-11)
        beam = bench.settings.standard.model_copy(update={"width_um": width_um})
        bench.settings = bench.settings.model_copy(update={"standard": beam})
        bench.held_fibre().standard = True
        carried_out(PushSpans().run(bench))
        shortest = bench.held_fibre().spans[-1]
        strokes.append(float(np.ptp(shortest.probe_um[shortest.force_un > ZERO_UN + 3.0])))
    assert strokes[1] < 0.6 * strokes[0]


def test_a_fibre_nearer_than_foreseen_is_come_up_to_again_from_further_back():
    bench = Bench(5e-11, off_um=60.0)
    carried_out(PushSpans().run(bench))
    assert bench.peak_un <= 0.8 * 180.0
    for span in bench.held_fibre().spans:
        assert span.force_un[0] == pytest.approx(ZERO_UN, abs=0.6), "each begins without contact"


@pytest.mark.parametrize("ei_n_m2", [2e-11, 1.5e-10, 4e-10])
@pytest.mark.parametrize("tilt", [-0.04, -0.011, 0.0, 0.013, 0.04])
def test_a_fibre_that_was_met_is_never_run_into_at_the_next_span(ei_n_m2: float, tilt: float):
    for off_um in (-11.0, -7.0, -3.0, 1.0, 5.0):
        bench = Bench(ei_n_m2, off_um=off_um, tilt=tilt)
        carried_out(PushSpans().run(bench))
        assert bench.at_once_un == 0.0, off_um
        # Nor is it looked for from far away: that takes long in the small steps of a short span.
        for span in bench.held_fibre().spans[1:]:
            assert np.sum(span.loading) < 56, "ten of them for the slide"


def test_a_fibre_that_is_suddenly_much_stiffer_ends_its_push_and_not_the_campaign():
    bench = Bench(5e-11)
    bench.stiffer = 30.0
    with pytest.raises(OperationFailed, match="more than 125 uN ends a push") as failed:
        carried_out(PushSpans().run(bench))
    assert failed.value.cause == TOO_HIGH
    assert bench.peak_un < bench.settings.push.stop_un - ZERO_UN
    assert bench.force_un() == 0.0, "the probe has gone back"
    assert not bench.listeners


def pushed_where_it_moves(bench: Bench, off_um: float, *, after: int) -> None:
    """Push a fibre that lies so far off once so many spans were pushed."""
    steps = PushSpans().run(bench)
    result: object = None
    while True:
        try:
            wish = steps.send(result)
        except StopIteration:
            break
        bench.off_um = off_um if len(bench.held_fibre().spans) >= after else 0.0
        result = wish.wait(0.0) if hasattr(wish, "wait") else None


def test_a_fibre_that_has_moved_towards_the_probe_is_hardly_touched_by_its_approach():
    bench = Bench(1.5e-10)
    pushed_where_it_moves(bench, 30.0, after=1)
    assert 0.0 < bench.at_once_un < 12.0
    assert len(bench.held_fibre().spans) == 5
    assert bench.frequency_hz == bench.settings.frequency_hz


@pytest.mark.parametrize("ei_n_m2", [2e-11, 1.5e-10, 4e-10])
def test_a_fibre_that_has_moved_is_felt_before_the_probe_could_be_stopped_too_late(ei_n_m2: float):
    bench = Bench(ei_n_m2)
    bench.reaction_s = 0.03  # samples come in chunks, and a call takes its time
    pushed_where_it_moves(bench, 12.0, after=4)
    assert bench.at_once_un < bench.settings.push.limit_un
    assert len(bench.held_fibre().spans) == 5


def test_a_fibre_that_is_not_there_is_reported_with_the_position():
    bench = Bench(5e-11, there=False)
    with pytest.raises(OperationFailed, match="600 um from the jaws") as failed:
        carried_out(PushSpans().run(bench))
    assert failed.value.cause == NO_CONTACT


def test_the_limit_is_armed_while_the_probe_pushes_and_not_longer():
    for bench in (Bench(5e-11), Bench(5e-11, there=False)):
        steps = PushSpans().run(bench)
        try:
            carried_out(steps)
        except OperationFailed as failure:
            assert failure.cause == NO_CONTACT
        assert bench.daqco.armed == [True, False]  # type: ignore[attr-defined]


def test_an_abort_in_the_middle_of_a_push_disarms_it_too():
    bench = Bench(5e-11)
    steps = PushSpans().run(bench)
    steps.send(next(steps).wait())  # type: ignore[union-attr]
    steps.close()
    assert bench.daqco.armed == [True, False]  # type: ignore[attr-defined]


def test_a_soft_fibre_gets_shorter_spans_once_the_first_has_shown_it():
    bench = Bench(1e-12)
    carried_out(PushSpans().run(bench))
    nominal = [span.nominal_um for span in bench.held_fibre().spans]
    assert nominal[0] > 1.5 * nominal[1]


def test_a_soft_fibre_is_pushed_as_far_as_planned_where_the_search_stepped_farther_than_that():
    bench = Bench(1e-12)
    carried_out(PushSpans().run(bench))
    span = bench.held_fibre().spans[-1]
    assert span.freed is not None
    pushed = span.force_un[span.freed.after + 1 :] - ZERO_UN
    assert np.count_nonzero(pushed > 0.6) >= 6


@pytest.mark.parametrize("ei_n_m2", [5e-11, 4e-10])
def test_each_span_is_read_on_the_fibre_both_ways(ei_n_m2: float):
    bench = Bench(ei_n_m2)
    carried_out(PushSpans().run(bench))
    for span in bench.held_fibre().spans:
        height = span.force_un - span.force_un[0]
        back = height[~span.loading]
        assert np.sum(back > 0.05 * height.max()) >= 3, span.nominal_um
        assert np.sum(back < 0.05 * height.max()) >= 3, "and where it is left"


def test_a_limit_that_was_armed_before_is_as_it_was_after_the_push():
    bench = Bench(5e-11)
    mine = LimitSettings(channel="force", low=-150.0, high=150.0, hysteresis=5.0, armed=True)
    bench.daqco.set_limit(mine)
    carried_out(PushSpans().run(bench))
    assert bench.daqco.armed == [True, True, True]  # type: ignore[attr-defined]
    assert bench.daqco.limits[0].settings == mine


@pytest.mark.parametrize("ending", ["not met", "aborted", "no force"])
def test_a_second_push_that_fails_leaves_the_spans_that_the_result_stands_on(
    ending: str, monkeypatch: pytest.MonkeyPatch
):
    bench = Bench(5e-11)
    carried_out(PushSpans().run(bench))
    fibre = bench.held_fibre()
    before, fibre.bending = list(fibre.spans), fit_bending(fibre.spans)
    steps = PushSpans().run(bench)
    if ending == "aborted":
        steps.send(next(steps).wait())  # type: ignore[union-attr]
        steps.close()
    else:
        bench.there = False
        if ending == "no force":
            monkeypatch.setattr(push, "LOOKS", 0)
        with pytest.raises(OperationFailed):
            carried_out(steps)
    assert fibre.spans == before
    assert fibre.bending is not None


def test_a_second_push_takes_the_place_of_the_first_with_its_result():
    bench = Bench(5e-11)
    carried_out(PushSpans().run(bench))
    fibre = bench.held_fibre()
    before, fibre.bending = list(fibre.spans), fit_bending(fibre.spans)
    carried_out(PushSpans().run(bench))
    assert len(fibre.spans) == 5
    assert not any(each in before for each in fibre.spans)
    assert fibre.bending is None
