"""A package that `cosmic new-device` writes is installed outside of the tree, and works at once."""

import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from contract.station_rig import free_port
from cosmic.app.cli import main
from cosmic.app.commands.new_device import KINDS, write_package
from cosmic.frame.errors import ConfigError
from system.served_program import served_program

ROOT = Path(__file__).resolve().parents[2]
NAME = "my_thing"


def installed(folder: Path, *packages: Path) -> dict[str, str]:
    """Install packages into a folder, and return an environment that has them."""
    subprocess.run(
        [
            *(sys.executable, "-m", "pip", "install", "-q", "--no-deps", "--no-index"),
            *("--no-build-isolation", "--target", str(folder), *map(str, packages)),
        ],
        check=True,
        timeout=100,
    )
    paths = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> dict[str, set[str]]:
    """What became of the tests of a package of each kind, all installed and run at once."""
    folder = tmp_path_factory.mktemp("packages")
    packages = {kind: folder / f"cosmic-my-{kind}" for kind in KINDS}
    for kind, package in packages.items():
        assert main(["new-device", kind, f"my_{kind}", "--out", str(folder)]) == 0
        assert (package / "README.md").is_file()
    environment = installed(folder / "site", *packages.values())
    environment |= {f"XDG_{each}_HOME": str(folder) for each in ("CONFIG", "DATA", "STATE")}
    report = folder / "report.xml"
    ran = subprocess.run(
        [
            *(sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"),
            *("--import-mode=importlib", f"--rootdir={folder}", f"--junitxml={report}"),
            *map(str, packages.values()),
        ],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=110,
        check=False,
    )
    assert ran.returncode in (0, 1), ran.stdout + ran.stderr  # else it was not collected
    found: dict[str, set[str]] = {kind: set() for kind in KINDS}
    for case in ElementTree.parse(report).iter("testcase"):
        kind = case.attrib["classname"].partition("cosmic-my-")[2].partition(".")[0]
        found[kind].add(next((f"{each.tag}: {each.text}" for each in case), "passed"))
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_a_new_package_passes_its_tests_at_once(outcomes: dict[str, set[str]], kind: str) -> None:
    assert outcomes[kind] == {"passed"}


def test_what_to_do_next_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["new-device", "controller", NAME, "--out", str(tmp_path)]) == 0
    assert str(tmp_path / "cosmic-my-thing" / "README.md") in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("My-Stage", "cannot be the name"),
        ("class", "cannot be the name"),
        ("cosmic", "name of a module already"),
        ("queue", "name of a module already"),
        ("scu3d", "already"),
    ],
)
def test_a_name_that_cannot_be_is_refused(name: str, reason: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=reason):
        write_package("controller", name, tmp_path)
    assert not list(tmp_path.iterdir())


def test_nothing_is_written_over(tmp_path: Path) -> None:
    write_package("controller", NAME, tmp_path)
    with pytest.raises(ConfigError, match="is there already"):
        write_package("controller", NAME, tmp_path)


def test_the_tutorial_of_the_own_stage_works_as_it_is_written(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "tutorials" / "your-own-stage.md").read_text(encoding="utf-8")
    script, expected = re.findall(r"```py\n(.*?)```\n\nIt prints (.*?)\. ", page, re.DOTALL)[0]
    write_package("controller", "my_stage", tmp_path)
    environment = installed(tmp_path / "site", tmp_path / "cosmic-my-stage")
    ran = subprocess.run(
        [sys.executable, "-c", script],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.splitlines() == re.findall("`(.*?)`", expected)


def test_the_stage_stands_beside_the_simulated_platform_and_moves_with_it(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "tutorials" / "your-own-stage.md").read_text(encoding="utf-8")
    beside = next(each for each in re.findall(r"```toml\n(.*?)```", page, re.DOTALL))
    write_package("controller", "my_stage", tmp_path)
    environment = installed(tmp_path / "site", tmp_path / "cosmic-my-stage")
    assert main(["init", str(tmp_path / "config")]) == 0
    file = tmp_path / "config" / "platform.toml"
    text = file.read_text(encoding="utf-8")
    text = text.replace('scene = "scenes/fiberstation.toml"', 'scene = ""', 1)
    controller, positioner = beside.split("[[mico.positioner]]", 1)
    text = text.replace("[mico.defaults]", f"{controller}[mico.defaults]", 1)
    text = text.replace(
        "[[mico.positioner]]", f"[[mico.positioner]]{positioner}\n[[mico.positioner]]", 1
    )
    file.write_text(text, encoding="utf-8")
    script = f"""
import cosmic
from cosmic.app.cli import main
assert main(["check", {str(file)!r}]) == 0
with cosmic.connect({str(file)!r}, applications=("mico",), rate=5) as rig:
    assert rig.simulated
    rig.mico.move({{"left.x": 40.0, "focus.z": 60.0}})
    print(round(rig.mico["left.x"].position_um), round(rig.mico["focus.z"].position_um))
"""
    ran = subprocess.run(
        [sys.executable, "-c", script],
        env=environment,
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.split()[-2:] == ["40", "60"]


def nudge_package(tmp_path: Path) -> tuple[Path, dict[str, str], str, str]:
    """Install what the how-to of an own application writes.

    Returns the platform file, the environment, and the scripts for here and for elsewhere.
    """
    page = (ROOT / "docs" / "how-to" / "your-own-application.md").read_text(encoding="utf-8")
    code, script, elsewhere = re.findall(r"```py\n(.*?)```", page, re.DOTALL)
    points, platform = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    package = tmp_path / "nudge"
    package.mkdir()
    (package / "nudge.py").write_text(code, encoding="utf-8")
    (package / "pyproject.toml").write_text(
        '[build-system]\nrequires = ["hatchling"]\nbuild-backend = "hatchling.build"\n'
        f'[project]\nname = "nudge"\nversion = "0.1"\n{points}',
        encoding="utf-8",
    )
    environment = installed(tmp_path / "site", package)
    assert main(["init", str(tmp_path / "config")]) == 0
    file = tmp_path / "config" / "platform.toml"
    text = file.read_text(encoding="utf-8")
    named, rest = platform.removeprefix("[platform]\n").split("\n", 1)
    text = text.replace('applications = ["mico", "daqco", "vico"]', named, 1)
    file.write_text(text.replace("[mico.defaults]", f"{rest}\n[mico.defaults]", 1), "utf-8")
    return file, environment, script, elsewhere


def test_the_how_to_of_an_application_and_a_contact_response_works(tmp_path: Path) -> None:
    _, environment, script, _ = nudge_package(tmp_path)
    touch = """
    import nudge
    before = len(nudge.Soft.seen)
    rig.mico.check({"left.z": -5400.0})
    assert all(set(each) == {"left_jaw_a", "plate"} for each in nudge.Soft.seen)
"""
    ran = subprocess.run(
        [sys.executable, "-c", script + touch],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.split()[-1:] == ["0"]


def test_the_application_of_the_how_to_is_used_from_another_process(tmp_path: Path) -> None:
    file, environment, _, elsewhere = nudge_package(tmp_path)
    line = free_port()
    variables = {"PYTHONPATH": environment["PYTHONPATH"]}
    more = ("--config", str(file), "--name", "lab", "--rate", "20")
    with served_program(tmp_path, free_port(), line, *more, variables=variables) as served:
        ran = subprocess.run(
            [sys.executable, "-c", elsewhere.replace("7447", str(line))],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        assert ran.returncode == 0, ran.stderr
        assert "1" in ran.stdout.split()  # the count; what was streamed may come before or after
        served.http.post("/api/control")
        assert served.http.post("/api/nudge/nudge", params={"wait": 20}).status_code == 200
