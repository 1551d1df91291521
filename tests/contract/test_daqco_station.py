"""What can go wrong between a station with boards and whoever uses them from elsewhere."""

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pytest

from contract.daqco_rig import (
    DaqcoRig,
    Home,
    daqco_rig,
    gather,
    hosted,
    remote_daqco,
    settings,
    used_locally,
    used_remotely,
)
from contract.station_rig import connected, free_port, listening, wait_until
from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.limits import Crossing
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import LimitSettings
from cosmic.frame.errors import ConfigError, NotAvailable, ProtocolError, RecordingError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.application import RemoteApplication
from cosmic.frame.network.errors import CallRefused, StationAway
from cosmic.frame.network.line_settings import Line as NetworkLine
from cosmic.frame.network.station import Station
from cosmic.frame.network.transport import Rule


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[DaqcoRig]:
    with daqco_rig("station", settings(tmp_path)) as made:
        yield made


# --- samples ----------------------------------------------------------------------------------


def test_nothing_is_lost_of_32_channels_at_15_khz(tmp_path: Path) -> None:
    wanted = settings(tmp_path, channels=32, rate_hz=15_000.0)
    with daqco_rig("station", wanted) as rig:
        firsts, lengths, end = gather(rig.daqco)
        needed = 5.0 * wanted.rate_hz
        assert wait_until(lambda: sum(list(lengths)) >= needed, 30.0)
        end()
        assert rig.remote is not None
        assert rig.daqco.missed == rig.daqco.counters.lost == 0
        assert (
            firsts[1:]
            == [first + length for first, length in zip(firsts[:-1], lengths[:-1], strict=True)][
                : len(firsts) - 1
            ]
        )
        assert not rig.home.failures


def test_samples_arrive_bit_for_bit(rig: DaqcoRig) -> None:
    there: dict[int, DataChunk] = {}
    here: dict[int, DataChunk] = {}
    rig.home.application.buffer.subscribe(lambda each: there.update({each.first_sample: each}))
    end = rig.daqco.subscribe(lambda each: here.update({each.first_sample: each}))
    assert wait_until(lambda: len(here) > 10)
    end()
    for first, chunk in here.items():
        if first in there:
            assert np.array_equal(chunk.volts, there[first].volts)
            assert chunk.time_s == there[first].time_s
            assert chunk.scales == there[first].scales


def test_acquisition_that_begins_anew_is_no_gap(rig: DaqcoRig) -> None:
    chunks: list[DataChunk] = []
    end = rig.daqco.subscribe(chunks.append)
    assert wait_until(lambda: len(chunks) > 5)
    rig.daqco.configure(rate_hz=2000.0)
    assert wait_until(lambda: chunks[-1].rate_hz == 2000.0)
    end()
    assert rig.daqco.counters.lost == 0


def test_an_old_report_that_comes_late_changes_nothing(rig: DaqcoRig) -> None:
    assert rig.remote is not None
    assert rig.station is not None
    old = rig.remote.transport.call("daqco", "state")
    rig.daqco.configure(rate_hz=2000.0)
    passed = Event()
    rig.remote.transport.subscribe("daqco/state", Rule.LATEST, lambda _: passed.set())
    rig.station.publish("daqco/state", old)
    assert passed.wait(5.0)
    assert rig.daqco.rate_hz == 2000.0


def test_crossings_and_failures_are_published_one_by_one(rig: DaqcoRig) -> None:
    assert rig.remote is not None
    crossings: list[object] = []
    failures: list[object] = []
    rig.remote.transport.subscribe("daqco/crossings", Rule.ALL, crossings.append)
    rig.remote.transport.subscribe("daqco/failures", Rule.ALL, failures.append)
    rig.daqco.arm_limit("force", high=30.0)
    rig.home.knob.level_v = 2.0
    assert wait_until(lambda: bool(crossings))
    assert isinstance(crossings[0], Crossing)
    rig.home.library.faults.inject("unplugged", board="Dev1")
    assert wait_until(lambda: bool(failures))
    assert wait_until(lambda: not rig.daqco.running)
    assert rig.daqco.problem == rig.home.application.problem == failures[0]
    assert not rig.daqco.away


def test_all_samples_are_sent_only_while_somebody_wants_them(
    rig: DaqcoRig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosmic.frame.network.remote_stream.LINGER_S", 0.0)
    assert rig.station is not None
    bus = rig.station.bus
    firsts, _lengths, end = gather(rig.daqco)
    assert wait_until(lambda: bool(firsts) and bus.wanted("daqco/chunks"))
    end()
    assert wait_until(lambda: not bus.wanted("daqco/chunks"))
    assert bus.wanted("daqco/display")


def test_a_receiver_that_hangs_delays_neither_calls_nor_the_newest_samples(rig: DaqcoRig) -> None:
    entered, go_on = Event(), Event()

    def hang(_chunk: DataChunk) -> None:
        entered.set()
        go_on.wait(10.0)

    end = rig.daqco.subscribe(hang)
    assert entered.wait(5.0)
    before = rig.daqco.counters.samples
    with pytest.raises(NotAvailable):
        rig.daqco.mark("still answers")
    assert wait_until(lambda: rig.daqco.counters.samples > before)
    go_on.set()
    end()


# --- files ------------------------------------------------------------------------------------


OUTSIDE = ["../run.h5", "/tmp/run.h5", "run.txt", "~no_one/run.h5", "run\0.h5", "link/run.h5"]


def test_files_outside_of_the_folder_for_recordings_are_refused(
    rig: DaqcoRig, tmp_path_factory: pytest.TempPathFactory
) -> None:
    outside = tmp_path_factory.mktemp("outside")
    (rig.daqco.directory / "link").symlink_to(outside)
    for name in OUTSIDE:
        with pytest.raises(RecordingError):
            rig.daqco.start_recording(name)
        with pytest.raises(RecordingError):
            rig.daqco.export(Path("run.h5"), Path(name)).wait(5.0)
    assert not rig.daqco.recording.active
    assert not list(outside.iterdir())
    with rig.daqco.record("run.h5"):
        pass
    assert rig.daqco.recording.path == rig.daqco.directory / "run.h5"
    assert (rig.daqco.directory / "run.h5").exists()
    _cannot_be_moved(rig)


def _cannot_be_moved(rig: DaqcoRig) -> None:
    before = rig.daqco.settings
    with pytest.raises(RecordingError):
        rig.daqco.apply(before.model_copy(update={"directory": "/"}))
    with pytest.raises(ConfigError, match="platform file"):
        rig.daqco.apply(before.model_copy(update={"backend": "nidaqmx"}))
    assert rig.home.application.settings == before
    with pytest.raises(RecordingError, match="other stations may use"):
        rig.daqco.free_bytes(Path("/"))
    with pytest.raises(RecordingError):
        rig.daqco.recordings(Path("/"))
    assert rig.daqco.recordings(rig.daqco.directory) == (rig.daqco.directory / "run.h5",)


def forged_scale(name: str, coefficients: tuple[Any, ...]) -> Scale:
    """Return a scale as only another program could send it."""
    made = object.__new__(Scale)
    for field_name, value in (("name", name), ("unit", "V"), ("coefficients", coefficients)):
        object.__setattr__(made, field_name, value)
    return made


BAD_CALLS: list[tuple[str, dict[str, Any]]] = [
    ("apply", {"settings": {"rate_hz": 1000.0}}),
    ("apply", {"settings": {"channel": "all of them"}}),
    ("apply", {"settings": 5}),
    ("set_limit", {"limit": {"channel": "force", "high": 1.0, "armed": True}}),
    ("set_limit", {"limit": LimitSettings(channel="x", low=0.0, high=1.0, armed=True)}),
    ("set_limit", {"limit": LimitSettings(channel="force", high=1.0), "armed": True}),
    ("set_limit", {"limit": LimitSettings.model_construct(channel="force", low=2.0, high=1.0)}),
    ("set_limit", {"limit": LimitSettings.model_construct(channel="force", high=1.0, armed=1)}),
    ("set_scale", {"channel": "force", "scale": "a"}),
    ("set_scale", {"channel": "force", "scale": forged_scale("a", ())}),
    ("set_scale", {"channel": "force", "scale": forged_scale("a", ("1",))}),
    ("set_scale", {"channel": "force", "scale": forged_scale("", (1.0,))}),
    ("name_recording", {"base": "a/b", "option": "time", "directory": "."}),
    ("close", {}),
    ("on_hosted", {"station": None}),
]


def test_calls_that_make_no_sense_are_refused_and_change_nothing(rig: DaqcoRig) -> None:
    before = rig.home.application.settings
    assert rig.remote is not None
    for function, arguments in BAD_CALLS:
        with pytest.raises((CallRefused, ConfigError, ProtocolError)):
            rig.remote.transport.call("daqco", function, arguments)
    assert rig.home.application.settings == before
    assert not rig.home.application.guard.limits
    assert not rig.home.failures
    assert rig.daqco.running


# --- the station goes and comes back ----------------------------------------------------------


@dataclass
class Line:
    """A station that can be taken off the line and put back."""

    home: Home
    endpoint: str
    remote: RemoteApplication[Daqco]
    daqco: Daqco
    stops: list[str] = field(default_factory=list)
    crossings: list[Crossing] = field(default_factory=list)
    served: ExitStack = field(default_factory=ExitStack)

    def up(self) -> None:
        self.served.enter_context(hosted(self.home, self.endpoint))

    def down(self) -> None:
        self.served.close()


@pytest.fixture
def line(tmp_path: Path) -> Iterator[Line]:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with ExitStack() as stack:
        home = stack.enter_context(used_locally(settings(tmp_path)))
        served = stack.enter_context(ExitStack())
        served.enter_context(hosted(home, endpoint))
        transport = stack.enter_context(connected(endpoint))
        remote = stack.enter_context(used_remotely(transport))
        made = Line(home, endpoint, remote, remote.api, served=served)
        remote.api.guard.trip = made.stops.append
        remote.api.on_crossing(made.crossings.append)
        yield made


def test_a_station_that_goes_says_why_and_goes_on_by_itself_when_it_is_back(line: Line) -> None:
    daqco = line.daqco
    firsts, _lengths, end = gather(daqco)
    assert wait_until(lambda: len(firsts) > 3)
    line.down()
    assert wait_until(lambda: bool(daqco.away))
    assert daqco.problem.count("away") == 1
    assert not daqco.running
    assert daqco.settings == line.home.application.settings
    with pytest.raises(NotAvailable, match="away"):
        daqco.latest()
    with pytest.raises(StationAway):
        daqco.configure(rate_hz=500.0)
    with pytest.raises(StationAway):
        daqco.start_recording("run.h5")
    with pytest.raises(StationAway):
        daqco.export(Path("run.h5"), Path("run.csv")).wait(5.0)
    before = len(firsts)
    line.up()
    assert wait_until(lambda: not daqco.away and daqco.running, 10.0)
    assert wait_until(lambda: len(firsts) > before + 3)
    end()
    assert wait_until(lambda: daqco.latest_chunk is not None)
    assert daqco.latest()["force"] == pytest.approx(10.0, abs=0.1)
    daqco.configure(rate_hz=2000.0)
    assert daqco.rate_hz == 2000.0
    assert line.stops == []


def test_a_station_that_falls_silent_while_a_limit_is_armed_counts_as_a_crossing(
    line: Line,
) -> None:
    line.daqco.arm_limit("force", high=30.0)
    line.down()
    assert wait_until(lambda: bool(line.stops))
    assert "silent" in line.stops[0]
    assert wait_until(lambda: bool(line.crossings))
    assert line.daqco.limits[0].crossed
    assert "silent" in line.daqco.limits[0].reason
    assert line.daqco.limits[0].reaction_ms is None
    line.up()
    assert wait_until(lambda: not line.daqco.away, 10.0)
    assert line.daqco.limits[0].crossed, "it stays told until somebody resets it"
    line.daqco.reset_limit("force")
    assert not line.daqco.limits[0].crossed
    assert all("silent" in each for each in line.stops)


def test_a_limit_crossed_while_the_line_was_cut_is_reported_when_it_is_back(line: Line) -> None:
    line.daqco.arm_limit("force", high=30.0)
    line.down()
    assert wait_until(lambda: bool(line.stops))
    line.home.knob.level_v = 2.0
    assert wait_until(lambda: line.home.application.guard.limits["force"].tripped)
    line.up()
    assert wait_until(lambda: any("reached" in each for each in line.stops), 10.0)
    assert wait_until(lambda: any(each.sample >= 0 for each in line.crossings))


def test_whoever_comes_later_hears_of_a_limit_that_still_is_crossed(
    rig: DaqcoRig,
) -> None:
    assert rig.remote is not None
    application = rig.home.application
    Daqco(application).arm_limit("force", high=30.0)
    rig.home.knob.level_v = 2.0
    assert wait_until(lambda: application.guard.limits["force"].beyond)
    stops: list[str] = []
    transport = rig.remote.transport
    late = remote_daqco(transport, rig.home.policy)
    late.api.guard.trip = stops.append
    try:
        late.initialize()
        assert wait_until(lambda: bool(stops))
    finally:
        late.shut_down()


def test_a_station_without_daqco_is_reported_as_the_reason() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    line = NetworkLine(endpoint, listens=True, station="fibres")
    with (
        listening(Station("fibres", FailurePolicy()), line),
        connected(endpoint) as transport,
        used_remotely(transport, initialize=False) as remote,
    ):
        remote.initialize_later()
        assert wait_until(lambda: "hosts no 'daqco'" in remote.api.away)
        assert remote.api.channels == ()
        with pytest.raises(NotAvailable):
            remote.api.latest()
