"""A held fibre is followed while its gripper moves, and known again after it was hidden."""

import numpy as np
import pytest

from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.core.vision.algorithms import TrackHeldFibres, make_chain
from cosmic.vico.core.vision.chain import Unavailable
from cosmic.vico.core.vision.held_tracking import HeldFibreTracker, HeldTrack
from cosmic.vico.core.vision.tool_types import ExpectedTool
from cosmic.vico.core.vision.tracking import TrackState
from cosmic.vico.hw.interface import Frame
from unit.vico.vision.drawn_fibres import arc
from unit.vico.vision.test_held_fibre import FRONT_PX, MIDDLE_PX, jaws_and

LENGTH = 230.0


def frame(shift: int, *, length: float = LENGTH, width: float = 9.0, seed: int = 0) -> np.ndarray:
    """Return jaws and a fibre that have moved down by `shift`."""
    line = arc((160.0, MIDDLE_PX - 0.5), 0.0, 60.5, 0.0)
    free = arc((FRONT_PX - 0.5, MIDDLE_PX - 0.5), 0.0, length, 0.4)
    image = jaws_and(np.concatenate([line, free[1:]]), width)
    noise = np.random.default_rng(seed).normal(0.0, 2.0, image.shape)
    return np.clip(np.roll(image, shift, axis=0) + noise, 0, 255).astype(np.uint8)


def gripper(shift: float) -> ExpectedTool:
    return ExpectedTool((FRONT_PX, MIDDLE_PX + shift), (1.0, 0.0), 50.0, gap_px=10.0, reach_px=30.0)


def tip(shift: float) -> np.ndarray:
    end = arc((FRONT_PX - 0.5, MIDDLE_PX - 0.5), 0.0, LENGTH, 0.4)[-1]
    return end + np.array([0.0, shift])


def test_tip_and_free_length_of_a_moving_fibre_are_followed() -> None:
    tracker = HeldFibreTracker()
    errors = []
    for number, shift in enumerate(range(0, 60, 6)):
        track = tracker.follow(frame(shift, seed=number), gripper(shift + 3.0))
        assert track.state is TrackState.FOUND, track.reason
        assert track.shape is not None and track.tip_std_px is not None
        assert track.shape.length_px == pytest.approx(LENGTH, abs=1.0)
        assert track.shape.clamps[0].angle_deg == pytest.approx(0.0, abs=1.0)
        errors.append(np.array(track.tip_px) - tip(shift))
    assert track.velocity_px == pytest.approx((0.0, 6.0), abs=0.3)
    assert np.abs(np.mean(errors, axis=0)).max() < 0.5
    assert np.std(errors, axis=0).max() < 0.25


def test_a_fibre_is_known_again_after_it_was_hidden_and_another_is_not_taken_for_it() -> None:
    tracker = HeldFibreTracker()
    for number in range(3):
        tracker.follow(frame(0, seed=number), gripper(0.0))
    hidden = frame(0)
    hidden[:, int(FRONT_PX) + 30 :] = 150
    lost = tracker.follow(hidden, gripper(0.0))
    assert lost.state is TrackState.LOST and lost.tip_px is None
    shorter = tracker.follow(frame(0, length=170.0), gripper(0.0))
    assert shorter.state is TrackState.LOST
    assert "length of what is held differs by -2" in shorter.reason
    again = tracker.follow(frame(12, seed=8), gripper(12.0))
    assert again.state is TrackState.FOUND, again.reason
    assert again.tip_px == pytest.approx(tuple(tip(12.0)), abs=0.6)
    assert again.velocity_px == (0.0, 0.0)
    tracker.forget()
    assert tracker.follow(frame(0, length=170.0), gripper(0.0)).state is TrackState.FOUND


def test_the_chain_follows_what_each_gripper_holds() -> None:
    chain = make_chain()
    for state in chain.states:
        chain.switch(state.name, on=state.name == "held fibre")
    link = chain.algorithm("held fibre")
    assert isinstance(link, TrackHeldFibres)
    image = CameraImage("top", Frame(frame(0), 1, 0.0, 0.0), Circumstances())
    assert isinstance(chain.run(image).results["held fibre"], Unavailable)
    probe = ExpectedTool((400.0, 100.0), (0.0, 1.0), 30.0)
    link.expect = lambda _: {"left": gripper(0.0), "probe": probe}
    found = chain.run(image).results["held fibre"]
    assert set(found) == {"left"}
    assert isinstance(found["left"], HeldTrack)
    assert found["left"].shape.length_px == pytest.approx(LENGTH, abs=1.0)
