"""Whatever a program hands to DAQCo at a station: it works, or ends in an error that names it."""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from contract.daqco_rig import DaqcoRig, hosted, used_locally, used_remotely, with_outputs
from contract.station_rig import connected, free_port, wait_until
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import LimitSettings
from cosmic.frame.clock import WALL
from cosmic.frame.file_names import NameOption
from system.odd_arguments import LEFT_OUT, calls_of, complaint, tried

LONGEST_S = 60.0
"""Nothing hangs: all that is tried with one thing takes less."""


@pytest.fixture
def rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[DaqcoRig]:
    monkeypatch.chdir(tmp_path)
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    with (
        used_locally(with_outputs(tmp_path)) as home,
        hosted(home, endpoint) as station,
        connected(endpoint) as transport,
        used_remotely(transport) as remote,
    ):
        transport.take_lease()
        yield DaqcoRig(home, remote.api, remote, station)


def sensible(rig: DaqcoRig) -> dict[str, object]:
    return {
        "channel": "force", "channels": rig.daqco.settings.channel, "text": "t", "path": "p.h5",
        "receiver": lambda *_: None, "listener": lambda *_: None, "settings": rig.daqco.settings,
        "rate_hz": 1000.0, "source": Path("made.h5"), "target": Path("made.csv"),
        "directory": Path(), "folder_problem.directory": ".", "scale": Scale("a", "uN", (0.0, 1.0)),
        "limit": LimitSettings(channel="force", high=100.0), "base": "run",
        "option": NameOption.TIME, "when": datetime.now(UTC), "action": lambda: None,
        "on_result": lambda *_: None, "timeout_s": 0.01, "name": "piezo", "volts": 1.0,
        "play.volts": np.ones(3), "set_line.name": "lamp", "high": True, "reason": "r",
        "wall_s": 1.0, "callback": None, "play.rate_hz": 100.0,
    }  # fmt: skip


@pytest.mark.parametrize("thing", ["daqco", "channel"])
def test_odd_arguments_are_named_and_nothing_hangs(rig: DaqcoRig, thing: str) -> None:
    given = sensible(rig)
    what = rig.daqco if thing == "daqco" else rig.daqco["force"]
    begun_s, tries = WALL.now_s(), 0
    wrong: dict[str, None] = {}
    skipped = LEFT_OUT | {"made_companion", "set_up_proxy", "take_lease_of", "prepare"}
    for call in calls_of(thing, what, given, skipped):
        for parameter, odd, error in tried(call):
            tries += 1
            rig.home.application.outputs.reset()
            if found := complaint(call, parameter, odd, error):
                wrong[found] = None
    assert not wrong, "\n".join(wrong)
    assert tries > 100 or thing == "channel"
    assert WALL.now_s() - begun_s < LONGEST_S
    # It still works.
    rig.daqco.start()
    assert wait_until(lambda: rig.daqco.running, 5.0)
    rig.daqco.set_output("piezo", 2.0)
    level = rig.home.library.output_level("Dev1", "ao0")
    assert level.at(WALL.now_s()) == 2.0
