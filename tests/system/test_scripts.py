"""The scripts of the repository: what a person starts first."""

import os
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
POSIX = pytest.mark.skipif(os.name != "posix", reason="needs a POSIX shell")


def batch(name: str) -> str:
    data = (ROOT / name).read_bytes()
    assert data.count(b"\n") == data.count(b"\r\n"), "a batch file needs the line ends of Windows"
    return data.decode("ascii")


def shell(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def test_the_steps_of_the_tests_are_the_same_on_windows() -> None:
    there = set(
        re.findall(r'call :(?:check|tests) (?:"not slow" |"slow" )?"([^"]+)"', batch("test.cmd"))
    )
    loop = re.search(r"for system in ([\w ]+);", shell("test"))
    assert loop is not None
    here = set(
        re.findall(r'^ *(?:if .*then )?(?:check|begin) "([^"]+)"', shell("test"), re.MULTILINE)
    )
    here.remove("mypy $system")
    here |= {f"mypy {each}" for each in loop[1].replace("win32", "linux").split()}
    assert there == here
    for words in (
        "-m benchmarks.guard",
        "-n auto --maxprocesses 4 --dist loadfile",
        "--last-failed",
    ):
        assert words in batch("test.cmd")
        assert words in shell("test").replace("\\\n        ", "")


def test_windows_installs_the_same_and_notices_the_same_changes() -> None:
    there, here = batch("tools/setup.cmd"), shell("tools/setup.sh")
    options = [
        set(
            re.findall(
                r"(?<=\s)--[\w-]+", "".join(re.findall(rf"-m pip install[\s\S]*?{end}", text))
            )
        )
        for text, end in ((there, r"\|\|"), (here, r'"\$@"'))
    ]
    options[1] |= set(re.findall(r"pip_install (--[\w-]+)", here))
    assert options[0] == options[1] != set()
    for words in ("constraints.txt", "pyproject.toml", "[dev]", "(3, 11)"):
        assert words in there
        assert words in here
    for stamp in ("run", "dev"):
        assert f".cosmic-{stamp}" in there
    assert r"tools\install_extras.py" in there
    assert "tools/install_extras.py" in here


def test_what_must_be_installed_is_looked_for_alike() -> None:
    known = runpy.run_path(str(ROOT / "tools" / "check_venv.py"))["PACKAGES"]
    found = re.search(r"find_spec, \(([^)]*)\)", shell("tools/setup.sh"))
    assert found is not None
    assert known == tuple(re.findall(r'"(\w+)"', found[1]))
    for question in ("place", "packages"):
        assert f'tools\\check_venv.py" {question} >nul' in batch("tools/setup.cmd")


def fits(venv: Path, question: str) -> bool:
    python = venv / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    script = ROOT / "tools" / "check_venv.py"
    alone = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    asked = subprocess.run([python, script, question], env=alone, check=False, timeout=60)
    return asked.returncode == 0


def test_an_environment_that_was_moved_or_lacks_something_is_noticed(tmp_path: Path) -> None:
    made = tmp_path / "a folder" / ".venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", made], check=True, timeout=60)
    (packages_of := next(made.rglob("site-packages"))).joinpath("pip.py").touch()
    assert fits(made, "place")
    assert not fits(made, "packages")
    for name in ("cosmic", "PySide6", "numpy", "pydantic"):
        packages_of.joinpath(f"{name}.py").touch()
    assert fits(made, "packages")
    moved = made.parent.rename(tmp_path / "another") / ".venv"
    assert not fits(moved, "place")
    shutil.rmtree(moved)
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", moved], check=True, timeout=60)
    assert not fits(moved, "place"), "it has no pip"


def test_extras_without_a_wheel_are_named_and_the_others_are_installed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = []

    def pip(command: list[str], **_: object) -> subprocess.CompletedProcess[str]:
        assert "--constraint" in command
        extras = command[-1].partition("[")[2].rstrip("]").split(",")
        asked.append(extras)
        return subprocess.CompletedProcess(command, int("video" in extras))

    monkeypatch.setattr(subprocess, "run", pip)
    assert runpy.run_path(str(ROOT / "tools" / "install_extras.py"))["main"]() == 0
    assert ["video"] in asked
    assert ["net"] in asked
    said = capsys.readouterr().err
    assert "for want of wheels for this computer: video." in said
    assert "pi, because installing it accepts PI's licence" in said
    assert not any({"pi", "dev", "docs"} & set(each) for each in asked)


@pytest.mark.parametrize("name", ["run.cmd", "test.cmd", "tools/setup.cmd"])
def test_a_batch_file_goes_to_labels_and_files_that_there_are(name: str) -> None:
    text = batch(name)
    labels = set(re.findall(r"^:(\w+)", text, re.MULTILINE))
    assert set(re.findall(r"goto (\w+)", text)) <= labels
    assert set(re.findall(r"call :(\w+)", text)) <= labels
    for script in re.findall(r'call "%~dp0([^"]+)"', text):
        assert (ROOT / script.replace("\\", "/")).is_file()


@pytest.fixture
def asked(tmp_path: Path) -> Path:
    """A system whose linker knows no library: what is asked of the package manager is noted."""
    script = tmp_path / "ask.sh"
    setup = shell("tools/setup.sh").replace("/sbin/ldconfig", str(tmp_path / "ldconfig"))
    (tmp_path / "setup.sh").write_text(setup, encoding="utf-8")
    (tmp_path / "ldconfig").write_text("#!/bin/sh\n", encoding="utf-8")
    (tmp_path / "ldconfig").chmod(0o755)
    script.write_text(
        f'root={tmp_path}; . {tmp_path}/setup.sh; find_needed "$1"; '
        'echo "needed:$needed"; echo "offered:$offered"\n',
        encoding="utf-8",
    )
    return script


def packages(script: Path, kind: str, display: str) -> dict[str, str]:
    sh = shutil.which("sh")
    assert sh is not None
    said = subprocess.run(
        [sh, str(script), kind],
        env={"PATH": os.environ["PATH"], "DISPLAY": display},
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    return dict(line.split(":", 1) for line in said.splitlines())


@POSIX
def test_what_a_window_needs_is_offered_before_there_is_a_display(asked: Path) -> None:
    found = packages(asked, "run", "")
    assert "libegl1" in found["needed"]
    assert "libxcb-cursor0" in found["offered"]
    assert "libxcb-cursor0" not in found["needed"], "it is no reason to end where none ever comes"


@POSIX
def test_with_a_display_what_a_window_needs_is_needed(asked: Path) -> None:
    assert "libxcb-cursor0" in packages(asked, "run", ":0")["needed"]


@POSIX
def test_the_tests_need_no_window(asked: Path) -> None:
    found = packages(asked, "dev", "")
    assert "libxcb-cursor0" not in found["needed"] + found["offered"]
