"""A platform with many easy fibres, and campaigns on it that are struck while they run."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event
from typing import Any, Final

import pytest

import cosmic
import cosmic.app.platform as platform_module
from cosmic.app.rig import Rig
from cosmic.autonomy.campaign.campaign import Campaign
from cosmic.autonomy.procedures.run import ProcedureRun
from cosmic.autonomy.procedures.tree import OPERATION, NodeEvent, NodeState
from cosmic.frame.clock import WALL
from cosmic.twin.scene import Scene
from cosmic.twin.truth import TruthRecord, read_truth

CONFIG: Final = Path(cosmic.__file__).parents[2] / "config"
EASY: Final = """
[samples.easy]
single = 20
debris = 4
length_um = 1200.0
length_sigma_ln = 0.08
ei_n_m2 = 5e-11
ei_sigma_ln = 0.3
curl_deg = 8.0
radius_um = 4400.0
distance_um = 350.0
faults = false
"""
RECIPE: Final = """
procedure = "{procedure}"
[sample]
name = "easy"
[stop]
good = {good}
time_s = 3600.0
[parameters.push]
stop_un = 0.0
[parameters.push.spans]
count = 2
{more}
[output]
html = false
pdf = false
table = false
"""
TRANSPORT: Final = """
procedure = "transport"
[stop]
good = 1
time_s = 1800.0
[output]
html = false
pdf = false
table = false
"""
"""A recipe of one fibre that is only carried: the shortest campaign there is."""
GRACE_WALL_S: Final = 0.3
"""How long after a stop, on a busy machine, an axis may take to stand."""
CREEP_UM: Final = 0.05


@dataclass
class Bench:
    """The platform, and the truth about it."""

    rig: Rig
    scene: Scene
    home: Path
    names: Iterator[int] = field(default_factory=lambda: iter(range(10**6)))

    def recipe(self, procedure: str = "bend test", good: int = 1, more: str = "") -> Path:
        path = self.home / f"{next(self.names)}.toml"
        path.write_text(RECIPE.format(procedure=procedure, good=good, more=more), "utf-8")
        return path

    def campaign(self, recipe: Path, folder: str, *, forget: tuple[str, ...] = ()) -> Campaign:
        """Return a campaign in a folder; `forget` names calibrations to be made anew."""
        campaign = self.rig.campaign(recipe, self.home / folder)
        registry = campaign.work.calibration.registry
        for entry in registry.entries:
            if entry.name in forget:
                registry.refuse(entry, "forgotten by the test")
        return campaign

    @property
    def truth(self) -> TruthRecord:
        return read_truth(self.home / "truth.jsonl")

    def places(self) -> dict[str, float]:
        now_s = self.scene.clock.now_s()
        return {name: each.position_then(now_s) for name, each in self.scene.stages.items()}

    @property
    def moving(self) -> bool:
        now_s = self.scene.clock.now_s()
        return any(each.leg_then(now_s)[0] > 0.0 for each in self.scene.stages.values())

    def wandered(self, before: dict[str, float]) -> dict[str, float]:
        """Return how far each stage is from where it was, where that is more than creep."""
        now = self.places()
        return {
            name: now[name] - at for name, at in before.items() if abs(now[name] - at) > CREEP_UM
        }


@contextmanager
def bench(home: Path, *, rate: float, seed: int = 1) -> Iterator[Bench]:
    """Have the platform with the easy sample; its truth is in `home`."""
    config = home / "config"
    shutil.copytree(CONFIG, config)
    with (config / "twin.toml").open("a", encoding="utf-8") as twin:
        twin.write(EASY)
    scenes: list[Scene] = []
    make_scene = platform_module.make_scene

    def keep(*args: Any, **options: Any) -> Scene:
        scenes.append(make_scene(*args, **options))
        return scenes[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(platform_module, "make_scene", keep)
        rig = cosmic.connect(
            config, rate=rate, seed=seed, sample="easy", truth=home / "truth.jsonl"
        )
    with rig:
        yield Bench(rig, scenes[0], home)


class Strike:
    """Does something when an operation of a campaign begins, once; in the campaign's thread."""

    def __init__(self, campaign: Campaign, operation: str, do: Callable[[], object]) -> None:
        self.struck = Event()
        self._operation = operation
        self._do = do
        self._campaign = campaign
        self._run: ProcedureRun[Any] | None = None
        campaign.on_change(self._on_change)

    def _on_change(self) -> None:
        run = self._campaign.run
        if run is not None and run is not self._run:
            self._run = run
            run.subscribe(self._on_event)

    def _on_event(self, event: NodeEvent) -> None:
        begins = event.kind == OPERATION and event.state is NodeState.RUNNING
        if begins and event.name == self._operation and not self.struck.is_set():
            self.struck.set()
            self._do()


def wait_for(condition: Callable[[], bool], what: str, timeout_s: float = 240.0) -> None:
    until_s = WALL.now_s() + timeout_s
    while not condition():
        assert WALL.now_s() < until_s, f"{what}: not within {timeout_s:g} s"
        WALL.sleep(0.002)


def wait_for_operation(campaign: Campaign, operation: str, timeout_s: float = 120.0) -> None:
    """Wait until a campaign that runs is at an operation."""
    strike = Strike(campaign, operation, lambda: None)
    wait_for(lambda: strike.struck.is_set() or campaign.over, operation, timeout_s)
    assert not campaign.over, campaign.end_reason
