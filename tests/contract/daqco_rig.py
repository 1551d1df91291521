"""DAQCo at home, and from another station over either transport, with a source that tests turn."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from contract.station_rig import connected, free_port, listening
from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.core.settings import (
    ChannelSettings,
    DaqcoSettings,
    OutputSettings,
    ScaleSettings,
)
from cosmic.daqco.hw.interface import Source
from cosmic.daqco.hw.sim_library import SimulatedLibrary
from cosmic.frame.clock import WallClock
from cosmic.frame.failure import Failure, FailurePolicy
from cosmic.frame.network.application import RemoteApplication
from cosmic.frame.network.host import Host
from cosmic.frame.network.line_settings import Line
from cosmic.frame.network.station import Station
from cosmic.frame.network.transport import Transport

LONGEST_SILENCE_S = 1.0
FORCE = ScaleSettings(name="Probe", unit="uN", coefficients=(0.0, 20.0))
OUTPUTS = (
    OutputSettings(name="piezo", board="Dev1", output="ao0", low_v=0.0, high_v=5.0),
    OutputSettings(name="lamp", board="Dev1", output="port0/line3"),
)


class Knob(Source):
    """A voltage that a test sets."""

    def __init__(self) -> None:
        self.level_v = 0.5

    @override
    def volts(self, times_s: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return np.full(times_s.shape, self.level_v)


@dataclass
class Home:
    """The application that has the boards."""

    application: DaqcoApplication
    library: SimulatedLibrary
    knob: Knob
    policy: FailurePolicy
    failures: list[Failure] = field(default_factory=list)


@dataclass
class DaqcoRig:
    """`daqco` is what is tested; `remote` is None at home."""

    home: Home
    daqco: Daqco
    remote: RemoteApplication[Daqco] | None = None
    station: Station | None = None


def settings(folder: Path, channels: int = 2, rate_hz: float = 1000.0) -> DaqcoSettings:
    """Return a channel "force" in micronewtons and others in volts."""
    others = tuple(
        ChannelSettings(
            name=f"channel{number}",
            board="Dev1" if number < 16 else "Dev2",
            input=f"ai{number % 16}",
        )
        for number in range(1, channels)
    )
    force = ChannelSettings(name="force", board="Dev1", input="ai0", scale="Probe")
    return DaqcoSettings(
        rate_hz=rate_hz,
        silence_s=LONGEST_SILENCE_S,  # a machine that is busy with other tests falls silent as well
        directory=str(folder),
        scale=(FORCE,),
        channel=(force, *others),
    )


def with_outputs(folder: Path) -> DaqcoSettings:
    """Return `settings` with a voltage "piezo" and a line "lamp"."""
    return settings(folder).model_copy(update={"output": OUTPUTS})


@contextmanager
def used_locally(wanted: DaqcoSettings) -> Iterator[Home]:
    """Acquire with a simulated board."""
    clock, knob, policy = WallClock(), Knob(), FailurePolicy()
    library = SimulatedLibrary(clock, {("Dev1", "ai0"): knob})
    application = DaqcoApplication(library, wanted, clock=clock, policy=policy)
    home = Home(application, library, knob, policy)
    policy.subscribe(home.failures.append)
    application.initialize()
    try:
        yield home
    finally:
        application.shut_down()


@contextmanager
def hosted(home: Home, endpoint: str) -> Iterator[Station]:
    """Offer it on a station, which listens at `endpoint`."""
    station, side = Station("fibres", home.policy), Host("daqco", Daqco(home.application))
    station.host("daqco", side)
    with ExitStack() as stack:
        stack.callback(side.close)
        line = Line(endpoint, listens=True, station="fibres")
        stack.enter_context(listening(station, line))
        yield station


def remote_daqco(transport: Transport, policy: FailurePolicy) -> RemoteApplication[Daqco]:
    return RemoteApplication("DAQCo", Daqco, transport, policy, name="daqco")


@contextmanager
def used_remotely(
    transport: Transport, *, initialize: bool = True
) -> Iterator[RemoteApplication[Daqco]]:
    """Use it over a transport."""
    remote = remote_daqco(transport, FailurePolicy())
    try:
        if initialize:
            remote.initialize()
        yield remote
    finally:
        remote.shut_down()


@contextmanager
def daqco_rig(where: str, wanted: DaqcoSettings, *, may_move: bool = False) -> Iterator[DaqcoRig]:
    """Yield DAQCo; `where` is "home" or "station", `may_move` with the lease."""
    with ExitStack() as stack:
        home = stack.enter_context(used_locally(wanted))
        if where == "home":
            yield DaqcoRig(home, Daqco(home.application))
            return
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        station = stack.enter_context(hosted(home, endpoint))
        transport = stack.enter_context(connected(endpoint))
        remote = stack.enter_context(used_remotely(transport))
        if may_move:
            transport.take_lease()
        yield DaqcoRig(home, remote.api, remote, station)


def gather(daqco: Daqco) -> tuple[list[int], list[int], Callable[[], None]]:
    """Return first samples and lengths of the chunks that come, and what ends it."""
    firsts: list[int] = []
    lengths: list[int] = []

    def take(chunk: object) -> None:
        assert hasattr(chunk, "first_sample")
        assert hasattr(chunk, "samples")
        firsts.append(chunk.first_sample)
        lengths.append(chunk.samples)

    return firsts, lengths, daqco.subscribe(take)
