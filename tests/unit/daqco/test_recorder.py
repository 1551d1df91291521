"""A recorder over an acquisition of chunks given by hand: what belongs to a chunk is with it."""

from collections.abc import Callable
from pathlib import Path
from threading import Lock
from types import SimpleNamespace

import numpy as np
import pytest

from cosmic.daqco.api.recorder import Recorder
from cosmic.daqco.api.recording import open_recording
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.limits import LimitGuard
from cosmic.daqco.core.recording_format import AxisPosition
from cosmic.frame.clock import WALL
from cosmic.frame.events import Event
from cosmic.frame.failure import FailurePolicy
from unit.daqco.recording_helpers import chunks, header, volts_of

HEAD = header()


class StartsFirst:
    """A lock before which a recording begins, as another thread may have it."""

    def __init__(self) -> None:
        self._lock = Lock()
        self.begin: Callable[[], None] | None = None

    def __enter__(self) -> None:
        begin, self.begin = self.begin, None
        if begin is not None:
            begin()
        self._lock.acquire()

    def __exit__(self, *_error: object) -> None:
        self._lock.release()


@pytest.mark.parametrize("begins", ["between two chunks", "while a chunk comes"])
def test_the_only_chunk_of_a_recording_has_positions(tmp_path: Path, begins: str) -> None:
    came: Event[DataChunk] = Event()
    settings = SimpleNamespace(channel=HEAD.channels)
    scales = dict(zip((each.name for each in HEAD.channels), HEAD.scales, strict=True))
    acquisition = SimpleNamespace(
        clock=SimpleNamespace(now_s=lambda: HEAD.start_s + 1.0, rate=1.0),
        running=True,
        rate_hz=HEAD.rate_hz,
        clock_agreement=(),
        settings=settings,
        buffer=SimpleNamespace(subscribe=came.subscribe, samples=0),
        guard=LimitGuard(WALL),
        scales=lambda: scales,
        exposures_in=lambda _chunk: (),
        before_change=lambda _check: None,
    )
    recorder = Recorder(acquisition, FailurePolicy())  # type: ignore[arg-type]
    where_um = [5.0]
    recorder.position_source = lambda: [
        AxisPosition(WALL.now_s(), "probe.y", where_um[0], "um", "known")
    ]
    recorder._handing_over = lock = StartsFirst()  # type: ignore[assignment]
    given = chunks(HEAD, volts_of(2, 30))
    came.emit(next(given))  # positions are not due again for a while
    path = tmp_path / "one.h5"
    if begins == "between two chunks":
        recorder.start(path)
    else:
        lock.begin = lambda: recorder.start(path)
    came.emit(next(given))
    where_um[0] = 6.0  # and no chunk comes any more
    recorder.stop()
    with open_recording(path) as recording:
        times_s, where, _ = recording.positions("probe.y")
        assert times_s[0] <= times_s[1]
        np.testing.assert_array_equal(where, [5.0, 6.0])
