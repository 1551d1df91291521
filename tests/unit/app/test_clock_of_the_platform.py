"""Which platforms' time may wait for who is late, and what the window shows of it."""

import sys

import pytest

from cosmic.app.configuration.platform_file import PlatformFile, load_platform
from cosmic.app.platform import build_platform
from cosmic.frame.clock import WALL


def changed(section: str, **values: object) -> PlatformFile:
    file, _ = load_platform(None)
    part = getattr(file, section)
    return file.model_copy(update={section: part.model_copy(update=values)})


def test_the_time_of_a_platform_with_any_real_part_waits_for_nobody() -> None:
    file, _ = load_platform(None)
    assert file.all_simulated
    assert file.vico is not None
    real_camera = file.vico.camera[0].model_copy(update={"backend": "aravis"})
    real_lens = file.vico.lens.model_copy(update={"backend": "navitar"})
    assert not changed("mico", backend="scu3d").all_simulated
    assert not changed("daqco", backend="nidaqmx").all_simulated
    assert not changed("vico", camera=(*file.vico.camera, real_camera)).all_simulated
    assert not changed("vico", lens=real_lens).all_simulated


@pytest.mark.parametrize("rate", [1.0, 20.0])
def test_the_time_of_the_simulated_platform_waits(rate: float) -> None:
    platform = build_platform(None, applications=("daqco",), rate=rate)
    try:
        clock = platform.clock
        clock.horizon().move_to(clock.now_s())
        before_s = clock.now_s()
        WALL.sleep(0.01)
        assert clock.now_s() == before_s
        WALL.sleep(0.11)
        assert clock.rate_reached < 0.9 * rate
        assert sys.getswitchinterval() <= 0.001  # a stop wins the interpreter eleven times
    finally:
        platform.shut_down()
