"""The chain runs what is on, in order, and one bad link does not stop the rest."""

import logging
from collections.abc import Mapping

import cv2
import numpy as np
import pytest

from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import ConfigError
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.core.vision.algorithms import FindTools, TrackFibre, TrackPoint, make_chain
from cosmic.vico.core.vision.chain import Chain, Registry, Results, Unavailable
from cosmic.vico.core.vision.fibre_tracking import FibreTrack
from cosmic.vico.core.vision.tool_types import ExpectedTool, GripperTips, NotSeen
from cosmic.vico.core.vision.tracking import Track
from cosmic.vico.hw.interface import Frame, Pixels, Roi
from unit.vico.tool_images import tool_image


def image(data: Pixels | None = None, number: int = 1) -> CameraImage:
    data = np.full((60, 80), 100, np.uint8) if data is None else data
    return CameraImage("cam", Frame(data, number, 0.1 * number, 0.1 * number), Circumstances())


class Mean:
    name = "mean"

    def run(self, image: CameraImage, results: Results) -> object:
        return float(image.data.mean())


class Double:
    name = "double"

    def run(self, image: CameraImage, results: Results) -> object:
        mean = results.get("mean")
        return 2.0 * mean if isinstance(mean, float) else Unavailable("there is no mean")


class Moody:
    """Raises while it is told to."""

    name = "moody"

    def __init__(self) -> None:
        self.raises = True
        self.runs = 0

    def run(self, image: CameraImage, results: Results) -> object:
        self.runs += 1
        if self.raises:
            raise ZeroDivisionError("divided the image by nothing")
        return "well"


class Meddler:
    name = "meddler"

    def run(self, image: CameraImage, results: Results) -> object:
        results["mean"] = 0.0  # type: ignore[index]
        return None


def test_each_sees_what_those_before_it_found() -> None:
    shown = image()
    analysis = Chain([Mean(), Double()]).run(shown)
    assert dict(analysis.results) == {"mean": 100.0, "double": 200.0}
    assert analysis.image is shown
    assert analysis.failures == {}
    assert list(analysis.durations_s) == ["mean", "double"]
    assert 0.0 <= sum(analysis.durations_s.values()) <= analysis.duration_s


def test_a_result_is_asked_for_by_name_and_kind() -> None:
    analysis = Chain([Double()]).run(image())
    assert analysis.get("double", float) is None
    assert analysis.get("double", Unavailable) == Unavailable("there is no mean")
    assert analysis.get("nobody", float) is None


def test_one_that_is_switched_off_does_not_run_until_it_is_switched_on() -> None:
    chain = Chain([Mean(), Double()], off=["mean"])
    assert [state.on for state in chain.states] == [False, True]
    assert list(chain.run(image()).results) == ["double"]
    chain.switch("mean", on=True)
    assert list(chain.run(image()).results) == ["mean", "double"]
    assert all(state.last_s is not None for state in chain.states)


def test_one_that_raises_is_named_and_the_rest_runs(caplog: pytest.LogCaptureFixture) -> None:
    chain = Chain([Moody(), Mean()])
    with caplog.at_level(logging.ERROR):
        analysis = chain.run(image(number=17))
    assert dict(analysis.results) == {"mean": 100.0}
    assert analysis.failures["moody"].text == "moody: divided the image by nothing"
    assert not analysis.failures["moody"].resting
    assert "moody failed on frame 17" in caplog.text


def test_after_three_failures_in_a_row_it_rests_says_why_and_is_tried_again(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = ManualClock()
    monkeypatch.setattr("cosmic.vico.core.vision.chain.WALL", clock)
    moody = Moody()
    chain = Chain([moody, Mean()])
    with caplog.at_level(logging.INFO):
        seen = [chain.run(image()).failures for _ in range(5)]
        assert moody.runs == 3
        assert [each["moody"].resting for each in seen if each] == [False, False, True]
        state = chain.states[0]
        assert state.on, "nobody switched it off"
        assert "3 times in a row, is tried again every 2 s: moody: divided" in state.reason
        clock.advance(2.1)
        chain.run(image())
        chain.run(image())
        assert moody.runs == 4
        assert caplog.text.count("moody failed") == 1, "it is said once"
        moody.raises = False
        clock.advance(2.1)
        assert chain.run(image()).results["moody"] == "well"
        assert chain.run(image()).results["moody"] == "well"
    assert chain.states[0].reason == ""
    assert caplog.text.count("moody works again") == 1


def test_failures_now_and_then_switch_nothing_off() -> None:
    moody = Moody()
    chain = Chain([moody])
    for number in range(12):
        moody.raises = number % 3 != 0
        chain.run(image())
    assert moody.runs == 12


def test_nobody_changes_what_another_found() -> None:
    analysis = Chain([Mean(), Meddler()]).run(image())
    assert dict(analysis.results) == {"mean": 100.0}
    assert "meddler" in analysis.failures


def test_names_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ConfigError, match="two algorithms are called 'mean'"):
        Chain([Mean(), Mean()])
    with pytest.raises(ConfigError, match="no algorithm 'blur'; there are: mean"):
        Chain([Mean()], off=["blur"])
    with pytest.raises(ConfigError, match="no algorithm 'blur'"):
        Chain([Mean()]).switch("blur", on=True)


def test_one_line_above_a_class_adds_it_to_every_chain() -> None:
    registry = Registry()

    @registry.add
    class Brightness:
        name = "brightness"

        def run(self, image: CameraImage, results: Results) -> object:
            return int(image.data.max())

    chain = registry.chain()
    assert chain.names == ("brightness",)
    assert chain.run(image()).results["brightness"] == 100
    assert chain.algorithm("brightness") is not registry.chain().algorithm("brightness")
    assert isinstance(chain.algorithm("brightness"), Brightness)


# --- what is built in -------------------------------------------------------------------------


def only(*names: str) -> Chain:
    chain = make_chain()
    for other in set(chain.names) - set(names):
        chain.switch(other, on=False)
    return chain


def test_the_focus_measure_says_when_its_region_is_not_on_the_image() -> None:
    chain = only("focus")
    textured = np.random.default_rng(0).integers(0, 255, (60, 80), np.uint8)
    assert chain.run(image(textured)).get("focus", float)
    chain.algorithm("focus").region = Roi(50, 0, 60, 60)  # type: ignore[attr-defined]
    found = chain.run(image(textured)).get("focus", Unavailable)
    assert found is not None
    assert "must lie within the image" in found.reason


def strand(bend_px: float = 30.0, shift: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    x = np.linspace(60.0, 540.0, 200)
    y = 200.0 + bend_px * np.sin(x / 90.0)
    return np.column_stack([x, y]) + shift


def drawn(*lines: np.ndarray, width_px: int = 10, seed: int = 0) -> np.ndarray:
    image = np.full((400, 600), 150, np.uint8)
    for line in lines:
        points = np.rint(line * 16.0).astype(np.int32)
        cv2.polylines(image, [points], False, 80, width_px, cv2.LINE_AA, shift=4)
    blurred = cv2.GaussianBlur(image, (0, 0), 1.2).astype(np.float64)
    return np.clip(blurred + np.random.default_rng(seed).normal(0, 2, image.shape), 0, 255).astype(
        np.uint8
    )


def test_fibres_are_found_on_grey_and_on_coloured_images() -> None:
    grey = drawn(strand())
    for data in (grey, np.ascontiguousarray(np.stack([grey] * 3, axis=2))):
        analysis = only("fibres").run(image(data))
        (fibre,) = analysis.results["fibres"]  # type: ignore[misc]
        assert fibre.width_px == pytest.approx(11.0, abs=1.5)


def test_a_fibre_that_was_found_is_followed_until_it_is_ended() -> None:
    chain = only("fibres", "fibre track")
    tracker = chain.algorithm("fibre track")
    assert isinstance(tracker, TrackFibre)
    first = chain.run(image(drawn(strand(), strand(shift=(0.0, 120.0)))))
    assert first.get("fibre track", Unavailable) == Unavailable("no fibre is followed")
    fibres = first.results["fibres"]
    mine = min(fibres, key=lambda each: each.ends_px[0, 1])  # type: ignore[attr-defined]
    tracker.follow(mine)
    moved = chain.run(image(drawn(strand(shift=(6.0, 10.0)), strand(shift=(0.0, 120.0)), seed=1)))
    track = moved.get("fibre track", FibreTrack)
    assert track is not None
    assert track.moved_px == pytest.approx((6.0, 10.0), abs=1.0)
    chain.switch("fibres", on=False)
    assert chain.run(image(drawn())).get("fibre track", Unavailable) is not None
    tracker.end()
    ended = chain.run(image(drawn())).get("fibre track", Unavailable)
    assert ended == Unavailable("no fibre is followed")


def test_a_point_is_followed_or_refused_without_a_failure() -> None:
    chain = only("place track")
    tracker = chain.algorithm("place track")
    assert isinstance(tracker, TrackPoint)
    tracker.follow((590.0, 20.0))
    refused = chain.run(image(drawn(strand()))).get("place track", Unavailable)
    assert refused is not None
    assert "within the image" in refused.reason
    line = strand()
    tracker.follow((60.0, float(line[0, 1])))
    assert chain.run(image(drawn(line))).get("place track", Track) is not None
    track = chain.run(image(drawn(strand(shift=(5.0, 0.0)), seed=1))).get("place track", Track)
    assert track is not None
    assert track.position_px == pytest.approx((65.0, line[0, 1]), abs=0.5)


def test_tools_are_looked_for_where_they_are_expected() -> None:
    chain = only("tools")
    finder = chain.algorithm("tools")
    assert isinstance(finder, FindTools)
    drawing = tool_image(1, gap=80.0)
    nobody = chain.run(image(drawing.image)).get("tools", Unavailable)
    assert nobody is not None
    away = ExpectedTool((-5.0, 0.0), (1.0, 0.0), 20.0)
    finder.expected = {"left": drawing.expected, "probe": away}
    tools = chain.run(image(drawing.image)).results["tools"]
    assert isinstance(tools, Mapping)
    assert isinstance(tools["left"], GripperTips)
    assert isinstance(tools["probe"], NotSeen)


def test_everything_built_in_runs_on_an_empty_image_without_a_failure() -> None:
    chain = make_chain()
    before = ("focus", "fibres", "fibre track", "place track", "tools", "tips")
    assert chain.names == (*before, "held fibre")
    analysis = chain.run(image(np.full((400, 600), 150, np.uint8)))
    assert analysis.failures == {}
    assert analysis.results["fibres"] == ()
