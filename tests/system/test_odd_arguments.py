"""Whatever a script hands over: it works, or the argument is named; nothing breaks inside."""

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
import pytest

import cosmic
from cosmic.autonomy.control.handle import ControlHandle
from cosmic.autonomy.control.pid import PidGains
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import LimitSettings
from cosmic.frame.arguments import checked
from cosmic.frame.config import read_toml
from cosmic.frame.errors import ArgumentError, ConfigError
from system.odd_arguments import LEFT_OUT, STORED, Call, calls_of, complaint, tried

HEAD = "cosmic-trajectory 1\nplatform FiberStation\n"
THINGS: dict[str, Callable[[cosmic.Rig], object]] = {
    "rig": lambda rig: rig,
    "mico": lambda rig: rig.mico,
    "axis": lambda rig: rig.mico["left.x"],
    "gripper": lambda rig: rig.mico["left.gripper"],
    "group": lambda rig: rig.mico.group("left.x", "left.y"),
    "poses": lambda rig: rig.mico.poses,
    "trajectories": lambda rig: rig.mico.trajectories,
    "teleoperation": lambda rig: rig.mico.teleoperation,
    "collision": lambda rig: rig.mico.collision,
    "daqco": lambda rig: rig.daqco,
    "channel": lambda rig: rig.daqco["force"],
    "vico": lambda rig: rig.vico,
    "camera": lambda rig: rig.vico.camera(),
    "lens": lambda rig: rig.vico.lens,
    "light": lambda rig: rig.vico.light,
    "control": lambda rig: rig.control,
    "calibrations": lambda rig: rig.calibrations,
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Where files go that are written by chance."""
    before, made = Path.cwd(), tmp_path_factory.mktemp("odd")
    os.chdir(made)
    yield made
    os.chdir(before)


@pytest.fixture(scope="module")
def rig(folder: Path) -> Iterator[cosmic.Rig]:
    with cosmic.connect(rate=50.0) as made:
        made.daqco.start()
        with made.daqco.record(folder / "made.h5"):
            made.mico["left.x"].move_by(5.0)
        yield made


@pytest.fixture(scope="module")
def sensible(rig: cosmic.Rig) -> dict[str, object]:
    """What arguments are where they are not the odd one, by name, or by place and name."""
    axis = rig.mico["left.x"]
    return {
        "name": "x", "names": "left.x", "axis": "left.x", "channel": "force", "text": "t",
        "target": 10.0, "distance": 1.0, "position": 0.0, "value": 1.0, "path": "p.h5",
        "targets": {"left.x": 10.0}, "distances": {"left.x": 1.0}, "first": "left.x",
        "second": "right.x", "one": "left_x", "other": "plate", "steps": 1, "index": 0,
        "frequency_hz": 5000, "direction": "forward", "jog.direction": 1,
        "hold_force.direction": 1, "run.wait": False,
        "follow.wait": False, "go.wait": False,
        "after": axis.move_by(0.0, wait=False), "listener": print,
        "callback": None, "receiver": lambda *_: None, "settings": rig.daqco.settings,
        "configure.settings": rig.vico.camera().settings, "rate_hz": 1000.0, "source": "made.h5",
        "export.target": "made.csv", "directory": ".",
        "limit": LimitSettings(channel="force", high=100.0),
        "scale": Scale("a", "uN", (0.0, 1.0)), "key": "top", "what": "left",
        "point_px": (10.0, 10.0),
        "since_s": 0.0, "format_name": "ffv1", "interval_s": 1.0, "count": 1, "target_counts": 10,
        "set_point": 1.0, "gains": PidGains(1.0), "speed": 1.0, "travel": 10.0, "tolerance": 1.0,
        "setpoint_un": 10.0, "device": "none", "profile": "p", "percent": 50.0, "zoom": 2.0,
        "algorithm": "focus", "on": False, "recipe": "quick", "folder": "out", "seconds": 0.01,
        "trajectory": rig.mico.trajectories.parse(f"{HEAD}left.x to 50 um\n"),
        "follow.path": rig.mico.plan_path({"left.x": 20.0}),
        "begin_detour.path": rig.mico.plan_path({"left.x": 20.0}), "hand": "left",
        "gripper": "left",
        "kind": "map", "work": None, "timeout_s": 0.01,
    }  # fmt: skip


@pytest.mark.parametrize("name", THINGS)
def test_odd_arguments_are_named_and_break_nothing(
    rig: cosmic.Rig, sensible: dict[str, object], name: str
) -> None:
    wrong: dict[str, None] = {}
    tries = 0
    for call in calls_of(name, THINGS[name](rig), sensible, LEFT_OUT | STORED):
        for link in rig.mico.links:
            rig.mico.unlink(link.first)
        if call.where.endswith(".stop"):
            continue
        for parameter, odd, error in tried(call):
            tries += 1
            if found := complaint(call, parameter, odd, error):
                wrong[found] = None
    rig.daqco.stop_recording()
    for loop in rig.control.loops:  # of an argument that was not odd enough
        loop.stop()
        loop.join()
    assert not wrong, "\n".join(wrong)
    assert tries > 0


HANDLES: dict[str, Callable[[cosmic.Rig], object]] = {
    "loop": lambda rig: rig.control.hold_force("force", "probe.y", 50.0, direction=-1),
    "jog": lambda rig: rig.mico["left.x"].jog(1),
    "movement": lambda rig: rig.mico["left.x"].move_by(5.0, wait=False),
    "group": lambda rig: rig.mico.move_by({"left.x": 5.0, "left.y": 5.0}, wait=False),
    "player": lambda rig: rig.mico.trajectories.run(
        rig.mico.trajectories.parse(f"{HEAD}left.x to 40 um\nleft.x to 60 um\n"), wait=False
    ),
    "lens task": lambda rig: rig.vico.lens.home() if rig.vico.lens else None,
    "campaign": lambda rig: rig.campaign("quick", "campaign"),
}
INSIDE_ONLY: Final = {"of", "followed"}
"""They make such a handle from what lies inside."""
WAITS: Final = {"wait", "exception", "result", "sent_result"}
"""Of what goes on for ever they would wait for ever, as they should."""


@pytest.mark.parametrize("name", HANDLES)
def test_odd_arguments_of_what_runs_are_named_and_break_nothing(
    rig: cosmic.Rig, sensible: dict[str, object], name: str
) -> None:
    rig.reset_stop()
    handle = HANDLES[name](rig)
    given = sensible | {"wait_settled.timeout_s": 0.01, "seconds": 0.1, "fraction": 0.5}
    wrong: dict[str, None] = {}
    tries = 0
    left_out = LEFT_OUT | INSIDE_ONLY | (WAITS if name in ("loop", "jog", "campaign") else set())
    for call in calls_of(name, handle, given, left_out):
        for parameter, odd, error in tried(call):
            tries += 1
            if found := complaint(call, parameter, odd, error):
                wrong[found] = None
    rig.stop("the test")
    rig.reset_stop()
    if isinstance(handle, ControlHandle):
        handle.join()
    assert not wrong, "\n".join(wrong)
    assert tries > 0


@pytest.mark.parametrize("consent", [False, True])
def test_odd_arguments_of_what_a_controller_stores_are_named(consent: bool) -> None:
    with cosmic.connect(applications=("mico",), rate=50.0) as rig:
        axis = rig.mico["left.x"]
        given: dict[str, object] = {"code": 1, "direction": "forward", "consent": consent}
        calls = [
            Call(f"axis.{name}", partial(getattr(axis, name), consent=consent), given)
            for name in sorted(STORED)
        ]
        wrong = [
            found
            for call in calls
            for parameter, odd, error in tried(call)
            if (found := complaint(call, parameter, odd, error))
        ]
    assert not wrong, "\n".join(wrong)


def test_stop_takes_any_reason_and_stops(rig: cosmic.Rig) -> None:
    stop: Any = rig.stop
    for reason in (None, b"5", 5, object(), "x" * 10_000):
        stop(reason)
        assert rig.stopped
        rig.reset_stop()


@pytest.mark.parametrize(
    "call",
    [
        pytest.param(Call("connect", cosmic.connect, {}), marks=pytest.mark.slow),
        Call("open_recording", cosmic.open_recording, {}),
        Call("Scale", Scale, {"name": "a", "unit": "uN", "coefficients": (0.0, 1.0)}),
        Call("LimitSettings", LimitSettings, {"channel": "force"}),
        Call("PidGains", PidGains, {"proportional": 1.0}),
    ],
    ids=lambda call: str(call.where),
)
def test_odd_arguments_of_what_is_made_are_named(call: Call, folder: Path) -> None:
    wrong = [
        found
        for parameter, odd, error in tried(call)
        if (found := complaint(call, parameter, odd, error))
    ]
    assert not wrong, "\n".join(wrong)


def test_a_number_of_numpy_is_a_number(rig: cosmic.Rig) -> None:
    axis = rig.mico["left.y"]
    for each in rig.daqco.limits:
        rig.daqco.disarm_limit(each.settings.channel)
    rig.reset_stop()
    for target in (np.float32(3.0), np.int64(4), np.float64(5.0), 6):
        axis.move_to(target)
        assert axis.details.position == pytest.approx(float(target), abs=1.0)


def test_a_file_that_lies_too_deep_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "deep.toml"
    path.write_text(f"a = {'[' * 100_000}{']' * 100_000}\n", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"deep\.toml: not read: .* too deep"):
        read_toml(path)


@checked
def taken(
    number: float = 0.0, count: int = 0, *, on: bool = False, text: str = "",
    timeout_s: float | None = 0.0,
    places: Sequence[float] = (), by: Mapping[str, float] | None = None, file: Path | str = "f",
) -> object:  # fmt: skip
    """Return what was taken."""
    return number, count, on, text, timeout_s, places, by, file


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("number", "5", "must be a number"),
        ("number", b"5", "must be a number"),
        ("number", True, "must be a number"),
        ("count", 1.0, "must be a whole number"),
        ("on", 1, "must be True or False"),
        ("text", b"t", "must be a text"),
        ("timeout_s", "1", "must be a number or None"),
        ("places", [1.0, "x"], "each is a number"),
        ("places", "12", "must be a list"),
        ("by", [("a", 1.0)], "must be a mapping"),
        ("file", 5, "must be a path"),
    ],
)
def test_what_is_of_a_wrong_kind_is_refused_by_name(name: str, value: object, message: str) -> None:
    take: Any = taken
    with pytest.raises(TypeError, match=rf"^taken: {name} .*{message}.*not "):
        take(**{name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("number", 10**400),
        ("timeout_s", math.inf),
        ("timeout_s", math.nan),
    ],
)
def test_what_nothing_can_be_done_with_is_refused_by_name(name: str, value: object) -> None:
    take: Any = taken
    with pytest.raises(ArgumentError, match=rf"^taken: {name} must be "):
        take(**{name: value})
