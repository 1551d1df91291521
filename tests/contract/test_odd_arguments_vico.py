"""Whatever a program hands to ViCo, here or at a station: it works, or the argument is named."""

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from contract.vico_rig import VicoRig, soon, vico_rig
from cosmic.frame.clock import WALL
from cosmic.vico.api.vico import Vico
from system.odd_arguments import LEFT_OUT, calls_of, complaint, tried

THINGS: dict[str, Callable[[Vico], object]] = {
    "vico": lambda vico: vico,
    "camera": lambda vico: vico.camera("top"),
    "lens": lambda vico: vico.lens,
    "light": lambda vico: vico.light,
}
LONGEST_S = 60.0
"""Nothing hangs: all that is tried with one thing takes less."""


@pytest.fixture(params=["home", "station"])
def rig(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[VicoRig]:
    monkeypatch.chdir(tmp_path)
    with vico_rig(request.param, tmp_path) as made:
        if made.client is not None:
            made.client.take_lease()
        yield made


def sensible(rig: VicoRig) -> dict[str, object]:
    return {
        "camera": "top", "name": "top", "key": "P1", "tool": "left", "what": "left",
        "point_px": (10.0, 10.0), "point_um": (80.0, 70.0), "timeout_s": 0.01, "since_s": 0.0,
        # No image comes here: not the 5 s that each waits by itself.
        "snap.timeout_s": 0.01, "find_fibres.timeout_s": 0.01, "next_image.timeout_s": 0.01,
        "settings": rig.vico.camera("top").settings, "path": Path("made.tif"),
        "format_name": "tiff", "interval_s": 1.0, "count": 1, "directory": Path(),
        "listener": lambda *_: None, "receiver": lambda *_: None, "wanted": lambda: True,
        "callback": None, "algorithm": "focus", "on": False, "zoom": 1.0, "target_counts": 3000,
        "percent": 50.0, "axis": "zoom",
    }  # fmt: skip


@pytest.mark.parametrize("thing", THINGS)
def test_odd_arguments_are_named_and_nothing_hangs(rig: VicoRig, thing: str) -> None:
    given, what = sensible(rig), THINGS[thing](rig.vico)
    begun_s, tries = WALL.now_s(), 0
    wrong: dict[str, None] = {}
    skipped = LEFT_OUT | {"made_companion", "set_up_proxy"}
    for call in calls_of(thing, what, given, skipped):
        for parameter, odd, error in tried(call):
            tries += 1
            if found := complaint(call, parameter, odd, error):
                wrong[found] = None
    assert not wrong, "\n".join(wrong)
    assert tries > 20
    assert WALL.now_s() - begun_s < LONGEST_S
    # It still works.
    camera = rig.vico.camera("top")
    camera.start()
    assert soon(lambda: camera.running)
    rig.home.camera.push(rig.home.camera.grey(5))
    assert soon(lambda: camera.latest() is not None)
