"""What the log says of a movement: a sentence, and not the shape of an object."""

import pytest

from cosmic.mico.core.motion.orders import (
    Calibrate,
    Jog,
    Motion,
    MoveBy,
    MoveTo,
    Reference,
    Steer,
    Step,
    motion_text,
)
from cosmic.vico.hw.interface import CameraSettings, Roi


@pytest.mark.parametrize(
    ("motion", "text"),
    [
        (MoveTo(-5050.0, "um"), "moves to -5050.0 um"),
        (MoveBy(20.0, "deg"), "moves by +20.0 deg"),
        (Step(-100, 80.0, 1000), "makes -100 steps of 80 V"),
        (Jog(1, 200.0), "jogs right at 200 um/s"),
        (Steer(-1, 40.0, 0.1), "is steered left at 40 um/s"),
        (Calibrate(), "calibrates its sensor"),
        (Reference(), "looks for its reference"),
    ],
)
def test_a_movement_is_a_sentence(motion: Motion, text: str) -> None:
    assert motion_text(motion, directions=("right", "left"), speed_unit="um/s") == text


def test_settings_of_a_camera_are_read_by_people() -> None:
    settings = CameraSettings(0.02, 0.0, 15.0, Roi(0, 0, 1600, 1200))
    assert str(settings) == "20 ms, 0 dB, 15 Hz, 1600 x 1200 px, binning 1, Mono8, free run"
