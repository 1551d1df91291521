"""A campaign runs where the cameras are, with the axes and the force at a station."""

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from contract.station_rig import free_port
from cosmic.app import platform as platforms
from cosmic.app.configuration.network import NetworkSettings, serving
from cosmic.app.platform import Uses, build_platform
from cosmic.app.rig import Rig
from cosmic.app.stations.address import StationAddress
from cosmic.app.stations.host import StationHost
from cosmic.autonomy.campaign.campaign import CampaignPhase
from cosmic.frame.clock import RatedClock
from cosmic.frame.errors import MoveRefused
from cosmic.twin.scene import Scene
from system.campaign_bench import TRANSPORT


class OneWorld:
    """Gives both programs the same simulated scene and its clock, as a real platform does."""

    def __init__(self) -> None:
        self._scene: Scene | None = None
        self._clock: RatedClock | None = None
        self._make_scene = platforms.make_scene

    def make_scene(self, *args: Any, **more: Any) -> Scene:
        if self._scene is None:
            self._scene = self._make_scene(*args, **more)
        return self._scene

    def make_clock(self, rate: float, *, waits: bool) -> RatedClock:
        if self._clock is None:
            self._clock = RatedClock(rate, waits=waits)
        return self._clock


@pytest.fixture
def rig() -> Iterator[Rig]:
    """The program with the cameras, which uses the axes and the force of a station."""
    world, rate = OneWorld(), 8.0
    with (
        ExitStack() as at_end,
        patch.object(platforms, "make_scene", world.make_scene),
        patch.object(platforms, "RatedClock", world.make_clock),
    ):
        there = build_platform(applications=("mico", "daqco"), rate=rate, sample="three-dry")
        at_end.callback(there.shut_down)
        there.initialize()
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        how = serving(NetworkSettings(), "fiberstation", there.path, listen=endpoint)
        host = StationHost(there, how)
        at_end.callback(host.close)
        uses = Uses((StationAddress("fiberstation", endpoint),))
        here = build_platform(rate=rate, sample="three-dry", uses=uses)
        found = Rig(here)
        at_end.callback(found.close)
        here.initialize()
        assert list(here.own) == ["vico"]
        yield found


def test_cameras_here_know_where_the_axes_of_the_station_are(rig: Rig) -> None:
    assert rig.calibrations.entries == ()
    image = rig.vico.camera().next_image(timeout_s=30.0)
    positions = image.circumstances.positions
    assert positions["left.x"] == pytest.approx(rig.mico["left.x"].position_um, abs=1.0)


def test_nothing_is_handled_before_the_control_was_taken(rig: Rig, tmp_path: Path) -> None:
    recipe = tmp_path / "transport.toml"
    recipe.write_text(TRANSPORT, encoding="utf-8")
    campaign = rig.campaign(recipe, tmp_path / "out")
    before = rig.mico["left.z"].position_um
    campaign.run_here()
    assert campaign.phase is CampaignPhase.FAILED
    assert "take control first" in campaign.end_reason
    assert rig.mico["left.z"].position_um == pytest.approx(before, abs=0.1)
    with pytest.raises(MoveRefused):
        rig.mico["left.z"].move_by(1.0)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_a_fibre_is_handled_with_the_axes_of_a_station(rig: Rig, tmp_path: Path) -> None:
    recipe = tmp_path / "transport.toml"
    recipe.write_text(TRANSPORT, encoding="utf-8")
    rig.take_control()
    campaign = rig.campaign(recipe, tmp_path / "out")
    campaign.run_here()
    assert campaign.phase is CampaignPhase.ENDED, campaign.end_reason
    assert campaign.progress.good == 1
