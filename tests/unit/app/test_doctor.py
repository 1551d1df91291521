"""What `cosmic doctor` says of this computer, and of one where something is missing."""

import json
import os
import re
import socket
import sys
from importlib import metadata
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cosmic.app.cli import main
from cosmic.app.diagnosis import computer, hardware
from cosmic.frame import platform_services
from cosmic.frame.config import shipped_config_dir


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """No process for Qt, no search for cameras on the network: one test below has both."""
    monkeypatch.setattr(computer, "windows", lambda: iter(()))
    monkeypatch.setattr(hardware, "_cameras", lambda *_names, **_needed: [])
    monkeypatch.chdir(tmp_path)


def page(capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, dict[str, Any]]:
    code = main(["doctor", "--json", *options])
    return code, json.loads(capsys.readouterr().out)


def finding(said: dict[str, Any], name: str) -> dict[str, str]:
    (found,) = (each for each in said["findings"] if each["name"] == name)
    return dict(found)


def changed(folder: Path, old: str, new: str) -> str:
    assert main(["init", str(folder)]) == 0
    file = folder / "platform.toml"
    text = file.read_text(encoding="utf-8")
    text, count = re.subn(old, new, text, count=1)
    assert count == 1
    file.write_text(text, encoding="utf-8")
    return str(folder)


def test_the_simulated_platform_needs_nothing_that_is_missing(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.undo()
    assert main(["doctor"]) == 0
    said = capsys.readouterr().out
    for area in ("Python", "Packages", "Windows", "Ports", "Time", "Disk", "Permissions"):
        assert f"\n{area}\n" in said
    assert f"for {shipped_config_dir() / 'platform.toml'}" in said
    assert said.endswith("Nothing that this platform file needs is missing.\n")


def test_it_leaves_nothing_on_the_disk(capsys: pytest.CaptureFixture[str]) -> None:
    _, said = page(capsys)
    assert finding(said, "recordings")["state"] == "good"
    assert not list(Path.cwd().iterdir())


def test_a_library_that_the_platform_file_needs_is_a_problem(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    code, said = page(capsys)
    assert (code, finding(said, "scu3d")["state"]) == (0, "note")
    old = re.escape('backend = "simulated"') + ".*\n" + re.escape('library = ""')
    config = changed(tmp_path / "config", old, 'backend = "scu3d"\nlibrary = "/nowhere/scu.so"')
    capsys.readouterr()
    code, said = page(capsys, "--config", config)
    assert code == 1
    assert said["problems"] >= 1
    found = finding(said, "scu3d")
    assert found["state"] == "problem"
    assert "/nowhere/scu.so" in found["advice"]
    assert main(["doctor", "--config", config]) == 1
    assert "!!  scu3d" in capsys.readouterr().out


def test_a_second_driver_of_boards_that_is_missing_is_a_problem(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    code, said = page(capsys)
    assert (code, finding(said, "labjack")["state"]) == (0, "note")
    second = '[[daqco.driver]]\nbackend = "labjack"\n\n[[daqco.scale]]\nname = "FT-S540"'
    old = re.escape('[[daqco.scale]]\nname = "FT-S540"')
    config = changed(tmp_path / "config", old, second)
    capsys.readouterr()
    code, said = page(capsys, "--config", config)
    assert code == 1
    found = finding(said, "labjack")
    assert found["state"] == "problem" and "Install LJM" in found["advice"]


def test_devices_that_answer_are_listed_with_their_library(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    closed: list[bool] = []
    controller = SimpleNamespace(
        name="SCU3DControl 1.5.16", find_devices=lambda: (71, 72), close=lambda: closed.append(True)
    )
    monkeypatch.setattr(hardware, "make_controller", lambda *_a, **_k: controller)
    _, said = page(capsys)
    assert "SCU3DControl 1.5.16" in finding(said, "scu3d")["found"]
    assert "71, 72" in finding(said, "scu3d")["found"]
    assert closed


def test_a_driver_that_breaks_is_a_finding_and_the_page_is_written(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_arguments: object) -> None:
        raise ZeroDivisionError("in the driver")

    monkeypatch.setattr(hardware, "make_library", broken)
    code, said = page(capsys)
    assert code == 0
    assert "ZeroDivisionError" in finding(said, "nidaqmx")["found"]


def test_packages_that_are_missing_are_named_with_what_installs_them(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    lines = ["numpy>=2", "no-such-thing>=1", 'nor-this; extra == "net"', 'odd; os_name == "x"']
    monkeypatch.setattr(metadata, "requires", lambda _name: lines)
    code, said = page(capsys)
    assert code == 1
    assert finding(said, "needed")["found"] == "missing: no-such-thing"
    assert finding(said, "needed")["advice"] == "pip install no-such-thing"
    assert finding(said, "extra net")["state"] == "note"
    assert "cosmic[net]" in finding(said, "extra net")["advice"]


def test_a_port_that_is_taken_is_reported(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        number = other.getsockname()[1]
        listen = f'[network]\nlisten = "tcp/127.0.0.1:{number}"\n\n[mico]'
        config = changed(tmp_path / "config", r"\[mico\]", listen)
        capsys.readouterr()
        code, said = page(capsys, "--config", config)
        assert (code, finding(said, "network")["state"]) == (0, "note")
    _, said = page(capsys, "--config", config)
    assert finding(said, "network")["state"] == "good"


def test_a_serial_port_that_may_not_be_used_says_which_group_to_join(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(hardware, "list_ports", lambda: ("/dev/ttyUSB7",))
    monkeypatch.setattr(os, "access", lambda path, *_mode: path != "/dev/ttyUSB7")
    _, said = page(capsys)
    assert "dialout" in finding(said, "/dev/ttyUSB7")["advice"]


def test_a_folder_that_is_not_there_is_a_problem(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    config = changed(tmp_path / "config", 'directory = ""', 'directory = "/nowhere/at/all"')
    capsys.readouterr()
    code, said = page(capsys, "--config", config)
    assert code == 1
    assert "/nowhere/at/all" in finding(said, "recordings")["advice"]


def test_waits_that_end_late_are_reported(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = SimpleNamespace(now_s=iter(number * 0.0156 for number in range(10**6)).__next__)
    clock.sleep = lambda _duration_s: None
    monkeypatch.setattr(computer, "WALL", clock)
    monkeypatch.setattr(platform_services, "tick_finely", lambda: True)
    _, said = page(capsys)
    assert finding(said, "clock")["state"] == "note"
    assert "1.6e+04 us" in finding(said, "clock")["found"]


def test_without_qt_libraries_it_says_what_qt_says(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.undo()
    monkeypatch.setattr(hardware, "_cameras", lambda *_names, **_needed: [])
    monkeypatch.setenv("DISPLAY", ":7777")
    monkeypatch.setenv("QT_QPA_PLATFORM", "no-such-plugin")
    code, said = page(capsys)
    assert code == 1
    assert finding(said, "Qt")["state"] == "problem"
    assert "no-such-plugin" in finding(said, "Qt")["found"]


def test_both_libraries_of_smaract_are_looked_for(capsys: pytest.CaptureFixture[str]) -> None:
    _, said = page(capsys)
    for library, file in (("scu3d", "scu3d"), ("smaractctl", "smaractctl")):
        assert file in finding(said, library)["advice"].lower()
        assert finding(said, library)["state"] == "note"


def test_what_a_platform_file_names_and_nobody_brings_is_a_problem(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "config"
    assert main(["init", str(folder)]) == 0
    file = folder / "platform.toml"
    text = file.read_text(encoding="utf-8")
    text = text.replace('[daqco]\nbackend = "simulated"', '[daqco]\nbackend = "their_board"', 1)
    text = text.replace("[platform]\n", '[platform]\nrequires = ["their-package>=1"]\n', 1)
    file.write_text(text, encoding="utf-8")
    capsys.readouterr()
    assert main(["doctor", "--config", str(folder)]) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert "!! their-package>=1 not installed" in said
    assert "!! their_board acquisition board their_board: not there" in said
    assert "there is no acquisition board 'their_board'" in said
