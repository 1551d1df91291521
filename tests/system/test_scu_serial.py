"""A simulated SCU on a pseudo terminal: CoSMic drives it through the gate, others by themselves."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
import serial

import cosmic
from cosmic.app.cli import main

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no pseudo terminals")

PLATFORM = """
[platform]
name = "two serial SCUs"
applications = ["mico"]

[mico]
backend = "scu-serial"
serials = [1801000002, 1801000001]

[mico.options]
ports = ["{0}", "{1}"]
answer_s = 5.0
keep_alive_s = 30.0
"""
AXIS = """
[[mico.positioner]]
name = "{0}"
device = {1}
channel = {2}
kind = "{3}"
"""
LIMITS = {"linear": "limits_um = [-4000, 4000]\n", "rotary": "limits_deg = [-100, 100]\n"}


@pytest.fixture(scope="module")
def links(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Path, Path]]:
    folder = tmp_path_factory.mktemp("lines")
    paths = folder / "first", folder / "second"
    command = [sys.executable, "-m", "cosmic", "simulate", "scu-serial"]
    command += ["--layout", "LLN,RNN", "--baud", "115200", "--seconds", "120"]
    command += [part for path in paths for part in ("--link", str(path))]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        said = [process.stdout.readline() for _ in paths]
        assert said == [f"SCU {1801000001 + n} at {path}\n" for n, path in enumerate(paths)]
        yield paths
        process.terminate()
        assert process.wait(10) == 0
    assert not any(path.is_symlink() for path in paths)


@pytest.fixture
def rig(links: tuple[Path, Path], tmp_path: Path) -> Iterator[cosmic.Rig]:
    axes = [("x", 1, 0, "linear"), ("y", 1, 1, "linear"), ("table", 0, 0, "rotary")]
    text = PLATFORM.format(*links)
    text += "".join(AXIS.format(*axis) + LIMITS[axis[3]] for axis in axes)
    file = tmp_path / "platform.toml"
    file.write_text(text, encoding="utf-8")
    assert main(["check", str(file)]) == 0
    with cosmic.connect(file, applications=("mico",)) as opened:
        yield opened


def test_axes_on_serial_lines_move_through_the_gate(rig: cosmic.Rig) -> None:
    x, table = rig.mico["x"], rig.mico["table"]
    assert x.move_to(120.0) == pytest.approx(120.0, abs=1.0)
    assert table.move_to(3.0) == pytest.approx(3.0, abs=0.05)
    reached = rig.mico.move({"x": 20.0, "y": -20.0, "table": -1.0}, match_arrival=True)
    assert reached == pytest.approx({"x": 20.0, "y": -20.0, "table": -1.0}, abs=1.0)
    with pytest.raises(cosmic.LimitError):
        x.move_to(4500.0)
    moving = x.move_to(3000.0, wait=False)
    rig.stop()
    assert isinstance(moving.exception(10), cosmic.StoppedError)
    rig.reset_stop()
    assert x.position_um < 2900.0


def test_a_program_with_pyserial_alone_talks_to_the_same_unit(links: tuple[Path, Path]) -> None:
    with serial.Serial(str(links[0]), 9600, timeout=0.2) as port:
        port.read(1000)  # what was under way to the one before
        port.timeout = 5

        def ask(text: str) -> str:
            port.write(f":{text}\n".encode())
            return port.readline().decode().strip()

        assert ask("E0") == ":E0"
        assert ask("I") == ":ISmarAct SCU-3D"
        assert ask("GSP2") == ":SP2N"
        assert ask("XYZ:E") == ":E2"
        assert ask("GP7:E") == ":E3"
        assert ask("MAA0A5:E") == ":E20"
        assert ask("MPA0P10.0:M0") == ":M0T"
        assert ask("S99:E") == ":E0"
        assert ask("SCLF0F4000:GCLF0") == ":CLF0F4000"
        assert ask("SCLF0F99999:E") == ":E17"


def test_a_place_that_cannot_be_a_link_is_refused_in_words(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "taken"
    file.write_text("mine", encoding="utf-8")
    assert main(["simulate", "scu-serial", "--link", str(file)]) == 1
    assert "is there already" in capsys.readouterr().err
    assert file.read_text("utf-8") == "mine"
    assert main(["simulate", "scu-serial"]) == 1
    assert "--link" in capsys.readouterr().err
