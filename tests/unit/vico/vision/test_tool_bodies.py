"""Jaws and the probe are not told as fibres where they are known; what they hold is."""

from collections.abc import Mapping

import numpy as np
import pytest

from cosmic.vico.api.camera_shown import Seen
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.core.vision.algorithms import FindFibres, TrackHeldFibres, make_chain
from cosmic.vico.core.vision.chain import Analysis
from cosmic.vico.core.vision.fibre import Fibre
from cosmic.vico.core.vision.held_tracking import HeldTrack
from cosmic.vico.core.vision.tool_types import ExpectedTool
from cosmic.vico.hw.interface import Frame
from unit.vico.vision.drawn_fibres import arc, drawn_image
from unit.vico.vision.test_held_fibre import FRONT_PX, MIDDLE_PX, gripper_on, jaws_and

PROBE = ExpectedTool((420.0, 120.0), (-1.0, 0.0), 14.0, reach_px=40.0)
PROBE_LINE = arc((420.0, 120.0), 0.0, 400.0, 0.0)
LOOSE = arc((120.0, 300.0), 0.3, 260.0, 0.4)
JAWS = ExpectedTool((FRONT_PX, MIDDLE_PX), (1.0, 0.0), 50.0, gap_px=10.0, reach_px=30.0)


def taken(data: np.ndarray) -> CameraImage:
    return CameraImage("cam", Frame(data, 1, 0.1, 0.1), Circumstances())


def fibres_on(data: np.ndarray, tools: Mapping[str, ExpectedTool]) -> tuple[Fibre, ...]:
    link = make_chain().algorithm("fibres")
    assert isinstance(link, FindFibres)
    link.expect = lambda _image: tools
    found = link.run(taken(data), {})
    assert isinstance(found, tuple)
    return found


def is_on(fibre: Fibre, line: np.ndarray) -> bool:
    middle = fibre.centre_line_px[len(fibre.centre_line_px) // 2]
    return bool(np.linalg.norm(line - middle, axis=1).min() < 3.0)


def test_a_known_probe_is_no_fibre_and_a_fibre_beside_it_is() -> None:
    data = drawn_image([PROBE_LINE, LOOSE], [14.0, 9.0])
    told = fibres_on(data, {})
    assert [is_on(each, PROBE_LINE) for each in told].count(True) == 1
    (fibre,) = fibres_on(data, {"probe": PROBE})
    assert fibre.certain
    assert is_on(fibre, LOOSE)


@pytest.mark.parametrize("off", [(0.0, 60.0), (60.0, 0.0), (0.0, -60.0)])
def test_a_probe_that_is_not_where_it_is_expected_is_still_found(off: tuple[float, float]) -> None:
    x, y = PROBE.tip_px
    elsewhere = ExpectedTool((x + off[0], y + off[1]), PROBE.forward, PROBE.width_px)
    told = fibres_on(drawn_image([PROBE_LINE], [14.0]), {"probe": elsewhere})
    assert any(is_on(each, PROBE_LINE) for each in told)


def test_a_certain_fibre_below_a_tool_is_never_left_out() -> None:
    line = arc((450.0, 122.0), 0.02, 150.0, 0.0)
    told = fibres_on(drawn_image([line], [9.0]), {"probe": PROBE})
    assert [each.certain for each in told] == [True]


def test_the_free_part_of_what_shut_jaws_hold_is_followed() -> None:
    jaws = arc((0.0, MIDDLE_PX), 0.0, FRONT_PX, 0.0)
    free = arc((FRONT_PX - 4.0, MIDDLE_PX), 0.0, 304.0, 0.3)
    data = drawn_image([jaws, free], [40.0, 9.0])
    open_jaws = ExpectedTool((FRONT_PX, MIDDLE_PX), (1.0, 0.0), 20.0, scale_um_px=7.1)
    shut = open_jaws.with_jaws_shut()
    link = make_chain().algorithm("held fibre")
    assert isinstance(link, TrackHeldFibres)
    link.expect = lambda _image: {"left": shut}
    tracks = link.run(taken(data), {})
    assert isinstance(tracks, Mapping)
    track = tracks["left"]
    assert isinstance(track, HeldTrack)
    assert track.shape is not None, track.reason
    assert track.shape.length_px == pytest.approx(300.0, abs=2.0)
    assert track.scale_um_px == 7.1


def test_what_jaws_hold_stays_a_fibre_until_its_free_part_is_known() -> None:
    line = np.concatenate(
        [
            arc((160.0, MIDDLE_PX - 0.5), 0.0, 60.0 + 0.5, 0.0),
            arc((FRONT_PX - 0.5, MIDDLE_PX - 0.5), 0.0, 300.0, 0.3)[1:],
        ]
    )
    data = jaws_and(line)
    gripper_on(data)
    chain = make_chain()
    for name in ("fibres", "held fibre"):
        link = chain.algorithm(name)
        link.expect = lambda _image: {"left": JAWS}  # type: ignore[attr-defined]
    for state in chain.states:
        chain.switch(state.name, on=state.name == "fibres")
    assert len(Seen.of(chain.run(taken(data))).fibres) == 1
    chain.switch("held fibre", on=True)
    analysis: Analysis = chain.run(taken(data))
    tracks = analysis.results["held fibre"]
    assert isinstance(tracks, Mapping)
    assert isinstance(tracks["left"], HeldTrack)
    seen = Seen.of(analysis)
    assert [each.name for each in seen.held] == ["left"]
    assert seen.held[0].length_px == pytest.approx(300.0, abs=2.0)
    assert seen.fibres == ()
