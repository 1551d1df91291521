"""A board whose driver does not return from the end of acquisition holds neither window nor end."""

import logging
from collections.abc import Callable
from pathlib import Path
from threading import Event

import pytest

from contract.daqco_rig import settings, used_locally
from contract.station_rig import wait_until
from cosmic.daqco.hw.sim_board import SimulatedBoard
from cosmic.frame.clock import WALL
from cosmic.frame.errors import DeviceTimeout


@pytest.fixture
def release(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """Have `stop` of a board hang from now on; returns what lets it go."""
    released, whole = Event(), SimulatedBoard.stop

    def hangs(board: SimulatedBoard) -> None:
        released.wait(30.0)
        whole(board)

    monkeypatch.setattr(SimulatedBoard, "stop", hangs)
    return released.set


def test_a_board_whose_stop_hangs_is_named_and_can_be_used_once_it_returns(
    release: Callable[[], None], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with used_locally(settings(tmp_path)) as home:
        application = home.application
        assert wait_until(lambda: application.buffer.samples > 0)
        try:
            began_s = WALL.now_s()
            application.stop_acquisition()
            assert WALL.now_s() - began_s < 8.0
            assert "Dev1: stop does not return" in caplog.text
            with pytest.raises(DeviceTimeout, match="Dev1: stop still has not returned"):
                application.start_acquisition()
        finally:
            release()

        def starts() -> bool:
            try:
                application.start_acquisition()
            except DeviceTimeout:
                return False
            return True

        assert wait_until(starts)
        assert wait_until(lambda: application.running)


def test_a_board_whose_stop_hangs_at_the_end_is_left_behind(
    release: Callable[[], None], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with used_locally(settings(tmp_path)) as home:
        assert wait_until(lambda: home.application.buffer.samples > 0)
        core = home.application._core
        assert core is not None
        began_s = WALL.now_s()
    try:
        assert WALL.now_s() - began_s < 8.0
        told = [each for each in caplog.records if each.levelno >= logging.ERROR]
        assert [each.getMessage() for each in told] == [
            "Dev1: stop does not return; check cable and driver"
        ]
    finally:
        release()
        assert core.join()
