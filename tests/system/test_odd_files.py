"""Whatever stands in a file that somebody hands over: it is read, or the file is named."""

import os
import random
from collections.abc import Callable, Iterator
from pathlib import Path
from threading import Thread

import pytest

from cosmic.app.cli import main
from cosmic.app.configuration.check import find_mistakes
from cosmic.app.configuration.platform_file import load_platform
from cosmic.app.configuration.references import kept_mistakes
from cosmic.autonomy.campaign.opening import read_recipe
from cosmic.autonomy.recorded.steps import load_recorded
from cosmic.frame.config import load_model
from cosmic.frame.errors import CosmicError
from cosmic.mico.core.collision.scene_loader import load_scene
from cosmic.mico.core.poses import read_poses
from cosmic.mico.core.teleoperation.profile_book import ProfileBook
from cosmic.mico.core.teleoperation.settings import TeleoperationSettings
from cosmic.mico.core.trajectory.reader import load as load_trajectory
from cosmic.mico.hw.recorded_input import read_events
from cosmic.twin.settings import TwinSettings

DEEP = 50_000
ODD: dict[str, bytes] = {
    "empty": b"",
    "binary": bytes(range(256)) * 40,
    "zeros": b"\0" * 4096,
    "not UTF-8": b"name = '\xff\xfe'\n",
    "deep arrays": b"a = " + b"[" * DEEP + b"]" * DEEP,
    "deep tables": b"a = " + b"{b = " * DEEP + b"1" + b"}" * DEEP,
    "deep keys": b".".join([b"a"] * 3000) + b" = 1",
    "huge number": b"a = 1" + b"0" * 10_000,
    "huge exponent": b"a = 1e999999",
    "huge text": b"a = '" + b"x" * 3_000_000 + b"'",
    "many keys": b"\n".join(b"k%d = %d" % (n, n) for n in range(20_000)),
    "huge line": b"left.x to " + b"9" * 100_000 + b" um\n",
    "odd date": b"a = 0001-01-01T00:00:00+23:59",
    "nan": b"[platform]\nname = nan\n[home]\n'left.x' = nan\n",
    "wrong kinds": b"platform = 1\nmico = []\nprofile = 'x'\nstop = true\nprocedure = {}\n",
    "deep XML": b"<robot name='r'>" + b"<link>" * DEEP,
}
LOADERS: dict[str, Callable[[Path], object]] = {
    "platform": load_platform,
    "twin": lambda path: load_model(path, TwinSettings),
    "scene": load_scene,
    "recipe": read_recipe,
    "poses": read_poses,
    "profiles": lambda path: ProfileBook(TeleoperationSettings(), path),
    "trajectory": load_trajectory,
}


def complaint(load: Callable[[Path], object], path: Path) -> str:
    """Return what is wrong with how a file was refused; empty where nothing is."""
    try:
        load(path)
    except CosmicError as exc:
        return "" if path.name in str(exc) else f"does not name the file: {str(exc)[:200]}"
    except Exception as exc:  # noqa: BLE001 - that is what is looked at
        return f"{type(exc).__name__}: {str(exc)[:200]}"
    return ""


def mutated(text: bytes, seed: int) -> bytes:
    """Return `text` with some of it lost, doubled, replaced or exchanged."""
    dice = random.Random(seed)
    changed = bytearray(text)
    for _ in range(dice.randint(1, 6)):
        at = dice.randrange(len(changed))
        length = dice.randint(1, 30)
        what = dice.randrange(4)
        if what == 0:
            del changed[at : at + length]
        elif what == 1:
            changed[at:at] = changed[at : at + length]
        elif what == 2:
            changed[at] = dice.randrange(256)
        else:
            changed[at : at + 1] = dice.choice([b"[", b'"', b"=", b"nan", b"-1", b"{}", b"1e400"])
    return bytes(changed)


@pytest.fixture
def folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Iterator[Path]:
    """A copy of the shipped configuration."""
    folder = tmp_path / "config"
    assert main(["init", str(folder)]) == 0
    capsys.readouterr()
    return folder


@pytest.mark.parametrize("name", LOADERS)
def test_an_odd_file_is_refused_by_name_whatever_reads_it(name: str, tmp_path: Path) -> None:
    wrong = []
    for what, content in ODD.items():
        path = tmp_path / f"{what.replace(' ', '_')}.toml"
        path.write_bytes(content)
        if found := complaint(LOADERS[name], path):
            wrong.append(f"{what}: {found}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
@pytest.mark.parametrize("name", [*LOADERS, "inputs", "recorded"])
def test_a_pipe_in_the_place_of_a_file_is_refused_and_not_waited_for(
    name: str, tmp_path: Path
) -> None:
    loaders = LOADERS | {"inputs": read_events, "recorded": load_recorded}
    path = tmp_path / "pipe.toml"
    os.mkfifo(path)
    writer = Thread(target=path.write_bytes, args=(b"",))  # who waits for it gets an end
    writer.start()
    try:
        with pytest.raises(CosmicError, match=r"pipe\.toml.*is a pipe or a device"):
            loaders[name](path)
    finally:
        reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        writer.join()
        os.close(reader)


SHIPPED = {
    "platform": "platform.toml",
    "twin": "twin.toml",
    "scene": "scenes/fiberstation.toml",
    "urdf": "scenes/fiberstation.urdf",
    "srdf": "scenes/fiberstation.srdf",
    "recipe": "recipes/ping-pong.toml",
}


@pytest.mark.parametrize("name", SHIPPED)
def test_a_damaged_file_of_the_configuration_is_read_or_refused_by_name(
    name: str, folder: Path
) -> None:
    file = folder / SHIPPED[name]
    scene = folder / SHIPPED["scene"]
    whole = file.read_bytes()
    wrong = []
    seeds = 8 if "scenes" in SHIPPED[name] else 40  # a scene takes its time
    contents = [mutated(whole, seed) for seed in range(seeds)]
    contents += [ODD[each] for each in ("binary", "deep arrays", "deep XML", "empty")]
    for number, content in enumerate(contents):
        file.write_bytes(content)
        try:
            if name in ("scene", "urdf", "srdf"):
                load_scene(scene)
            else:
                LOADERS[name](file)
        except CosmicError as exc:
            if file.stem not in str(exc):
                wrong.append(f"{number}: does not name the file: {str(exc)[:200]}")
        except Exception as exc:  # noqa: BLE001 - that is what is looked at
            wrong.append(f"{number}: {type(exc).__name__}: {str(exc)[:200]}")
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("what", ["binary", "deep tables", "nan", "wrong kinds"])
def test_check_names_odd_files_beside_a_platform_and_breaks_at_none(
    folder: Path, what: str
) -> None:
    for name in ("poses.toml", "profiles.toml", "recipes/odd.toml"):
        (folder / name).write_bytes(ODD[what])
    file, path = load_platform(folder)
    assert all(str(folder) in line for line in kept_mistakes(file, path))
    assert all(str(folder) in line for line in find_mistakes(folder))
