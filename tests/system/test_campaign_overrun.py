"""A real board that loses samples during a campaign, over a driver that a test stands in for."""

import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Thread
from typing import Any

import pytest

from contract.fake_nidaqmx import FakeNidaqmx
from cosmic.app.cli import main
from cosmic.app.commands import campaign as campaign_command
from cosmic.app.stations import hosting
from cosmic.autonomy.campaign.campaign import Campaign
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.api.recording import open_recording
from cosmic.daqco.core.limits import LimitGuard
from cosmic.daqco.hw.nidaqmx_library import NidaqmxLibrary
from cosmic.frame.clock import WALL
from system.campaign_bench import CONFIG, EASY, wait_for, wait_for_operation

# The command makes a Qt application where there is none; of the wrong kind for tests with windows.
pytestmark = pytest.mark.usefixtures("qapp")

NO_FORCE_V = 2.5
LOST = 123
TOLD = re.compile(
    r"computer overloaded, 1[2-9]\d samples of each channel \(1[2-9]\d ms\) were lost"
)
"""Those, and what had arrived and was not read yet."""
RECIPE = """
procedure = "transport"
[sample]
name = "easy"
[stop]
count = 3
[parameters.push]
stop_un = 0.0
"""


@dataclass
class Boards:
    """Two boards that take 1000 samples a second, until they are made to lose some."""

    driver: FakeNidaqmx = field(default_factory=FakeNidaqmx)
    losing: Event = field(default_factory=Event)
    ended: Event = field(default_factory=Event)

    def acquire(self) -> None:
        taken_s = WALL.now_s()
        while not self.ended.wait(0.01):
            samples = int((WALL.now_s() - taken_s) * 1000.0)
            taken_s += samples / 1000.0
            self.driver.take(samples)
            if self.losing.is_set():
                self.driver.take(10_000 + LOST, events=False)  # its buffer holds 10 000
                self.losing.clear()


@pytest.fixture
def boards(monkeypatch: pytest.MonkeyPatch) -> Iterator[Boards]:
    made = Boards()
    made.driver.levels_v["Dev1/ai0"] = NO_FORCE_V
    monkeypatch.setattr(
        hosting, "make_library", lambda _, clock, **__: NidaqmxLibrary(clock, api=made.driver)
    )
    # A test on a busy computer is no judge of silence.
    monkeypatch.setattr(LimitGuard, "look_for_silence", lambda _: None)
    thread = Thread(target=made.acquire, name="boards")
    thread.start()
    yield made
    made.ended.set()
    thread.join()


def platform(folder: Path, *, armed: bool) -> Path:
    """Return a copy of the shipped platform with real boards."""
    config = folder / "config"
    shutil.copytree(CONFIG, config)
    with (config / "twin.toml").open("a", encoding="utf-8") as twin:
        twin.write(EASY)
    file = config / "platform.toml"
    text = file.read_text(encoding="utf-8")
    daqco = text.index("[daqco]")
    changed = (
        text[daqco:]
        .replace('backend = "simulated"', 'backend = "nidaqmx"', 1)
        .replace("chunk_s = 0.002", "chunk_s = 0.01", 1)
        .replace("armed = true", f"armed = {str(armed).lower()}", 1)
    )
    file.write_text(text[:daqco] + changed, encoding="utf-8")
    return config


def run(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    strike: Callable[[Campaign, Daqco], None],
    *,
    armed: bool,
) -> int:
    """Run `cosmic campaign`, and call `strike` while it makes ready."""

    class StrikingBar:
        def __init__(self, campaign: Campaign, *_: Any) -> None:
            self.campaign = campaign

        def follow(self) -> None:
            wait_for_operation(self.campaign, "make ready")
            daqco = self.campaign.work.daqco
            with daqco.record(folder / "all.h5"):
                strike(self.campaign, daqco)
            wait_for(lambda: self.campaign.over, "the end")
            (limit,) = daqco.limits
            assert limit.settings.armed is armed, "the campaign leaves it as it was"

    monkeypatch.setattr(campaign_command, "Bar", StrikingBar)
    recipe = folder / "one.toml"
    recipe.write_text(RECIPE, encoding="utf-8")
    config = platform(folder, armed=armed)
    out = str(folder / "out")
    arguments = ["campaign", str(recipe), "--out", out, "--config", str(config), "--rate", "1"]
    return main(arguments)


def overrun(boards: Boards, daqco: Daqco) -> None:
    """Lose samples, and wait until both boards acquire again by themselves."""
    samples(daqco, 50)
    before = boards.driver.starts
    boards.losing.set()
    wait_for(lambda: boards.driver.starts >= before + 2 and daqco.running, "a restart")
    samples(daqco, 50)


def samples(daqco: Daqco, least: int) -> None:
    """Wait until so many more have arrived."""
    arrived: list[int] = []
    forget = daqco.subscribe(lambda chunk: arrived.append(chunk.samples))
    wait_for(lambda: sum(arrived) >= least, "samples")
    forget()


def check_marked_once(file: Path) -> None:
    """Have a recording be whole but for one gap, which it tells."""
    with open_recording(file) as recording:
        (note,) = [each.text for each in recording.events if each.kind == "overload"]
        assert TOLD.match(note), note
        assert len(recording.overruns) == 1
        assert recording.samples >= 100
        assert recording.complete


def test_with_a_limit_armed_an_overrun_stops_the_campaign_first_and_it_does_not_end_well(
    tmp_path: Path,
    boards: Boards,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    running_at_stop: list[bool] = []

    def strike(campaign: Campaign, daqco: Daqco) -> None:
        latch = campaign.work.mico.application.manager.latch
        before = boards.driver.starts
        # When the probe is parked the campaign disarms what is armed; the gripper moves after that.
        arm = [campaign.work.mico[f"left.{axis}"] for axis in "xyz"]
        wait_for(lambda: any(axis.details.in_motion for axis in arm), "a parked probe")
        daqco.arm_limit("force", low=-150.0, high=150.0, hysteresis=5.0)
        latch.subscribe(lambda state: running_at_stop.append(boards.driver.starts > before))
        overrun(boards, daqco)
        assert TOLD.match(latch.state.reason), latch.state.reason

    assert run(tmp_path, monkeypatch, strike, armed=True) == 3
    assert running_at_stop[0] is False, "it acquired again before it stopped"
    assert TOLD.search(capsys.readouterr().err)
    assert not CampaignReader(tmp_path / "out").fibres()
    check_marked_once(tmp_path / "all.h5")


def test_without_a_limit_a_campaign_outlives_an_overrun(
    tmp_path: Path,
    boards: Boards,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def strike(campaign: Campaign, daqco: Daqco) -> None:
        overrun(boards, daqco)
        assert not campaign.over, campaign.end_reason
        assert not campaign.work.mico.application.manager.latch.state.latched
        campaign.abort("that was enough")

    assert run(tmp_path, monkeypatch, strike, armed=False) == 3
    output = capsys.readouterr().err
    assert "acquisition restarted after an overrun: " in output
    assert "that was enough" in output
    check_marked_once(tmp_path / "all.h5")
