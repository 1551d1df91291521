"""The simulated platform hosted at a station, and MiCo as a program elsewhere sees it."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace

from contract.station_rig import connected, connected_in_memory, free_port, listening
from cosmic.app.platform import build_platform
from cosmic.frame.clock import WALL
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.host import Host
from cosmic.frame.network.line_settings import Line
from cosmic.frame.network.station import Station
from cosmic.frame.network.transport import Transport
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.client import MicoClient
from cosmic.mico.api.mico import Mico, mico_of


@dataclass(frozen=True)
class HostedMico:
    """A station with MiCo; `mico` commands it as its own operator does."""

    station: Station
    application: MicoApplication
    mico: Mico
    endpoint: str = ""

    def begin_anew(self) -> None:
        """Leave nothing of the test before: everything stands, and nobody else holds the lease."""
        self.station.lease.take_over()
        self.station.lease.offer()
        manager = self.application.manager
        manager.stop("between two tests")
        wait_for(lambda: not any(state.in_motion for state in manager.states().values()))
        manager.reset_stop()
        for axis in self.mico:
            axis.clear_zero()
            self.mico.unlink(axis.key)
            if axis.details.kind != "open-loop":
                axis.set_closed_loop_frequency(manager.settings.defaults.closed_loop_frequency_hz)
        self.mico.move({"left.x": 0.0, "left.y": 0.0, "right.x": 0.0})


@contextmanager
def hosted_mico(rate: float = 20.0, *, cold: bool = False) -> Iterator[HostedMico]:
    """Host the shipped platform as the station "fibres", which does not listen yet."""
    platform = build_platform(applications=("mico",), rate=rate, cold=cold)
    application = platform.mico
    assert application is not None
    with ExitStack() as stack:
        stack.callback(platform.shut_down)
        platform.initialize()
        station = Station("fibres", platform.policy)
        side = Host("mico", Mico(application, "station"))
        stack.callback(side.close)
        station.host("mico", side)
        yield HostedMico(station, application, Mico(application))


@contextmanager
def reachable(hosted: HostedMico) -> Iterator[HostedMico]:
    """Let clients in over a line."""
    endpoint = hosted.endpoint or f"tcp/127.0.0.1:{free_port()}"
    with listening(hosted.station, Line(endpoint, listens=True, station="fibres")):
        yield replace(hosted, endpoint=endpoint)


@contextmanager
def transport_to(hosted: HostedMico, how: str, name: str = "vision") -> Iterator[Transport]:
    """Connect a client: `how` is "memory" or "zenoh"."""
    joined = (
        connected(hosted.endpoint, name)
        if how == "zenoh"
        else connected_in_memory(hosted.station, name)
    )
    with joined as client:
        yield client


@contextmanager
def remote_mico(
    hosted: HostedMico, how: str, name: str = "vision", *, takes_lease: bool = True
) -> Iterator[tuple[Mico, MicoClient, Transport]]:
    """MiCo of the station as a program elsewhere has it."""
    with transport_to(hosted, how, name) as transport:
        if takes_lease:
            transport.take_lease()
        application = MicoClient(transport, FailurePolicy())
        try:
            application.initialize()
            assert not application.failure, application.failure
            yield mico_of(application), application, transport
        finally:
            application.shut_down()


def wait_for(condition: Callable[[], object], timeout_s: float = 20.0) -> None:
    until_s = WALL.now_s() + timeout_s
    while not condition():
        assert WALL.now_s() < until_s, "it did not happen"
        WALL.sleep(0.005)
