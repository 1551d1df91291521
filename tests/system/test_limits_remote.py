"""A force limit stops axes that another process has, whichever of the two has the boards."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

import pytest

import cosmic
from contract.station_rig import free_port, wait_until
from cosmic.app.configuration.network import NetworkSettings, serving
from cosmic.app.platform import Platform, Uses, build_platform
from cosmic.app.rig import Rig
from cosmic.app.stations.address import StationAddress
from cosmic.app.stations.host import StationHost
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.frame.failure import Failure


@contextmanager
def served(*applications: str, name: str = "there") -> Iterator[tuple[Platform, StationHost, str]]:
    """Serve applications from here; what a process of its own would do."""
    platform = build_platform(applications=applications)
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with ExitStack() as at_end:
        at_end.callback(platform.shut_down)
        platform.initialize()
        settings = NetworkSettings()
        host = StationHost(platform, serving(settings, name, platform.path, listen=endpoint))
        at_end.callback(host.close)
        yield platform, host, endpoint


def test_boards_here_stop_axes_there_and_say_so_where_they_cannot() -> None:
    with served("mico") as (there, host, endpoint):
        uses = Uses((StationAddress("there", endpoint),))
        here = build_platform(applications=("daqco",), uses=uses)
        failures: list[Failure] = []
        here.policy.subscribe(failures.append)
        with Rig(here) as rig:
            here.initialize()
            assert there.mico is not None
            latch = there.mico.manager.latch
            rig.daqco.arm_limit("force", low=-500.0, high=-400.0)
            assert wait_until(lambda: latch.state.reason), "the force is about 0"
            assert "force" in (latch.state.reason or "")

            rig.daqco.remove_limit("force")
            host.close()
            assert wait_until(lambda: rig.stations["there"].away)
            rig.daqco.arm_limit("force", low=-500.0, high=-400.0)
            assert wait_until(lambda: [each for each in failures if "stop at there" in each.where])


def test_boards_there_stop_axes_here_and_their_silence_does_as_well() -> None:
    with (
        served("daqco") as (_, host, endpoint),
        cosmic.connect(applications=("mico",), stations={"there": endpoint}) as rig,
    ):
        assert StationAddress.known("there").endpoint == endpoint, "it is remembered"
        rig.daqco.arm_limit("force", low=-500.0, high=-400.0)
        assert wait_until(lambda: rig.stopped)
        assert "force" in (rig.stopped or "")
        rig.daqco.remove_limit("force")
        rig.reset_stop()

        rig.daqco.arm_limit("force", low=-200.0, high=200.0)
        assert rig.stopped is None
        host.close()
        assert wait_until(lambda: rig.stopped), "nobody can say that the limit holds"


def test_an_application_that_two_stations_host_is_used_at_neither() -> None:
    with served("daqco") as (_, _, first), served("daqco", name="other") as (_, _, second):
        there = StationAddress("there", first)
        with pytest.raises(ConfigError, match="both there and other host daqco"):
            build_platform(uses=Uses((there, StationAddress("other", second))))
        with pytest.raises(ConfigError, match="there: this station is named twice"):
            build_platform(uses=Uses((there, there)))


def test_a_taken_port_is_said_to_be_taken() -> None:
    with served("daqco") as (platform, _, endpoint):
        how = serving(NetworkSettings(), "another", platform.path, listen=endpoint)
        with pytest.raises(NotAvailable, match="another program listens there already"):
            StationHost(platform, how)
