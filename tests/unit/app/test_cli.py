import os
import subprocess
import sys
from pathlib import Path

import pytest

import cosmic
from cosmic.app.cli import main


@pytest.fixture
def folder(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """A copy of the shipped configuration."""
    folder = tmp_path / "config"
    assert main(["init", str(folder)]) == 0
    capsys.readouterr()
    return folder


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")


def complaints(capsys: pytest.CaptureFixture[str]) -> list[str]:
    said = capsys.readouterr().err.splitlines()
    assert not [line for line in said if "Traceback" in line]
    return said


def test_it_reports_its_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--version"])
    assert ended.value.code == 0
    assert capsys.readouterr().out == f"cosmic {cosmic.__version__}\n"


# check


def test_the_shipped_configuration_is_ok(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(folder / "platform.toml")]) == 0
    assert capsys.readouterr().out.rstrip().endswith("ok")
    assert main(["check", str(folder)]) == 0


def test_check_names_every_mistake_with_file_key_and_reason(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    platform, twin = folder / "platform.toml", folder / "twin.toml"
    edit(platform, "closed_loop_frequency_hz = 5000", 'closed_loop_frequency_hz = "fast"')
    edit(platform, 'stop_key = "F12"', 'stop_kee = "F12"')
    edit(twin, "step_at_100v = 1.5", "step_at_100v = -1.5")
    assert main(["check", str(platform)]) == 1
    said = complaints(capsys)
    assert len(said) == 3
    assert f"{platform}: platform.stop_kee: unknown key" in said[0]
    assert "mico.defaults.closed_loop_frequency_hz: " in said[1]
    assert f"{twin}: kinds.linear.step_at_100v: " in said[2]


@pytest.mark.parametrize(
    ("old", "new", "wanted"),
    [
        ("limits_um = [-5500.0", "limits_um = [-6500.0", "limits_um: -6500 to 5500 reaches beyond"),
        ("limits_deg = [-160.0, 160.0]", "limits_deg = [-160.0, 171.0]", "limits_deg: "),
        ('forward_key = "D"', 'forward_key = "Dee"', "forward_key: 'Dee' is not the name of a key"),
        ('forward_key = "D"', 'forward_key = "F12"', "taken by platform.stop_key"),
        ('stop_key = "F12"', 'stop_key = "Esc"', "platform.stop_key: the key 'Esc' is taken"),
        ("device = 3\nchannel = 1", "device = 3\nchannel = 2", "has no stage"),
        ("device = 3\nchannel = 1", "device = 9\nchannel = 1", "has no stage"),
        ('applications = ["mico", ', 'applications = ["miko", ', "unknown application 'miko'"),
        ('twin = "twin.toml"', 'twin = "none.toml"', "none.toml: there is no such file"),
    ],
)
def test_check_finds(
    folder: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, wanted: str
) -> None:
    platform = folder / "platform.toml"
    edit(platform, old, new)
    assert main(["check", str(platform)]) == 1
    said = complaints(capsys)
    assert [line for line in said if wanted in line], said


def test_check_finds_a_kind_that_the_twin_does_not_have_there(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    platform = folder / "platform.toml"
    edit(
        platform,
        'name = "left.gripper"\ntitle = "Gripper"\ndevice = 2\nchannel = 2',
        'name = "left.gripper"\ntitle = "Gripper"\ndevice = 3\nchannel = 2',
    )
    edit(
        platform,
        'name = "table.rotation"\ntitle = "Table"\ndevice = 3\nchannel = 0',
        'name = "table.rotation"\ntitle = "Table"\ndevice = 2\nchannel = 2',
    )
    assert main(["check", str(platform)]) == 1
    said = complaints(capsys)
    assert any("kind: rotary, but the twin's stage" in line for line in said)


def test_check_of_what_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", str(tmp_path / "no.toml")]) == 1
    assert "there is no such file" in complaints(capsys)[0]


# init


# scene


def test_the_shipped_scene_is_ok(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scene", "check", str(folder / "scenes" / "fiberstation.toml")]) == 0
    assert capsys.readouterr().out.rstrip().endswith("ok")


def test_a_mistake_in_the_scene_is_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = folder / "scenes" / "fiberstation.toml"
    platform = folder / "platform.toml"
    text = platform.read_text(encoding="utf-8").replace('"left.x"', '"left.q"')
    platform.write_text(text, encoding="utf-8")
    assert main(["scene", "check", str(folder / "scenes" / "nothing.toml")]) == 1
    assert "nothing.toml" in complaints(capsys)[0]
    assert main(["check", str(folder)]) == 1
    said = complaints(capsys)
    assert any("left.q moves nothing" in line for line in said), said
    assert any("drives left.x, which is not a positioner" in line for line in said)
    edit(scene, 'joint = "left_x"', 'joint = "nowhere"')
    assert main(["scene", "check", str(scene)]) == 1
    assert any("nowhere" in line for line in complaints(capsys))


def test_soft_limits_beyond_the_scenes_hard_stops_are_a_mistake(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    edit(folder / "scenes" / "fiberstation.urdf", 'upper="0.006"', 'upper="0.005"')
    assert main(["check", str(folder)]) == 1
    assert any("beyond the hard stops of scenes" in line for line in complaints(capsys))


def test_a_scene_needs_a_task(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["scene"])
    assert "TASK" in capsys.readouterr().err


def test_init_copies_the_configuration_and_never_overwrites(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    platform = folder / "platform.toml"
    platform.write_text("mine", encoding="utf-8")
    assert main(["init", str(folder)]) == 1
    assert any("exists already" in line for line in complaints(capsys))
    assert platform.read_text(encoding="utf-8") == "mine"


def test_init_into_a_file_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "file"
    file.touch()
    assert main(["init", str(file)]) == 1
    assert complaints(capsys)


# Stations


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        (["--applications", "miko"], "unknown application 'miko'; known are mico, daqco, vico"),
        (["--listen", "tcp/0.0.0.0:7447"], "only tls with certificates is allowed"),
        (["--listen", "tls/0.0.0.0:7447"], "tls needs certificates"),
        (["--listen", "somewhere"], "'somewhere' is not an endpoint"),
        (["--name", "fibre station"], "letters, digits, - and _"),
        (["--certificates", "nowhere"], "nowhere/authority.pem: there is no such file"),
        (["--connect", "fibervision"], "no station 'fibervision' was used before; used were: none"),
        (["--connect", "=tcp/1"], "'=tcp/1' is not a station; it reads NAME=tcp/"),
        (["--config", "nowhere.toml"], "nowhere.toml: there is no such file"),
    ],
)
def test_a_station_that_cannot_be_says_why(
    arguments: list[str], wanted: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["serve", *arguments]) == 1
    assert wanted in "\n".join(complaints(capsys))


@pytest.mark.parametrize(
    ("section", "wanted"),
    [
        ('listen = "tcp/0.0.0.0:7447"', "only tls with certificates is allowed"),
        ('certificates = "keys/here"', "keys/here/authority.pem: there is no such file"),
        ('move = ["a desk"]', "letters, digits, - and _"),
    ],
)
def test_check_finds_what_keeps_a_platform_from_serving(
    folder: Path, section: str, wanted: str, capsys: pytest.CaptureFixture[str]
) -> None:
    platform = folder / "platform.toml"
    with platform.open("a", encoding="utf-8") as file:
        file.write(f"\n[network]\n{section}\n")
    assert main(["check", str(platform)]) == 1
    said = complaints(capsys)
    assert wanted in said[0]
    assert f"{platform}: network: " in said[0]


def test_a_window_serves_when_the_command_line_or_the_file_says_so(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What it is told is impossible, so that it says so and never opens."""
    quick = ["daqco", "--config", str(folder), "--offscreen", "0"]
    assert main([*quick, "--serve", "--listen", "tcp/0.0.0.0:7447"]) == 1
    assert "only tls with certificates" in complaints(capsys)[0]
    edit(folder / "platform.toml", "[mico]\n", '[network]\nserve = true\nname = "a b"\n\n[mico]\n')
    assert main(quick) == 1
    assert "letters, digits" in complaints(capsys)[0]


def test_whoever_wants_to_serve_other_computers_hears_what_to_do(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["serve", "--listen", "tcp/192.168.1.5:7447"]) == 1
    said = "\n".join(complaints(capsys))
    assert "cosmic certificates FOLDER --stations" in said
    assert "[network]" in said


def test_an_application_that_the_platform_file_leaves_out_cannot_be_served(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    edit(folder / "platform.toml", '["mico", "daqco", "vico"]', '["mico"]')
    assert main(["serve", "--applications", "daqco", "--config", str(folder)]) == 1
    assert "describes no daqco" in complaints(capsys)[0]


def test_certificates_are_made_for_each_station(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target = tmp_path / "made"
    arguments = ["certificates", str(target), "--stations", "fiberstation,vision"]
    assert main([*arguments, "--address", "fiberstation=192.168.1.5"]) == 0
    said = capsys.readouterr().out
    for name in ("fiberstation", "vision"):
        assert f"{target / name}: for {name}" in said
        assert (target / name / "key.pem").stat().st_mode & 0o077 == 0, "nobody else reads it"
    assert str(target / "authority") in said
    assert main(arguments) == 1
    assert "is there already" in complaints(capsys)[0]


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        (["--stations", ","], "name at least one"),
        (["--stations", "one,one"], "is listed twice"),
        (["--stations", "one/two"], "letters, digits, - and _"),
        (["--stations", "one", "--address", "192.168.1.5"], "it reads STATION=HOST"),
        (["--stations", "one", "--address", "two=192.168.1.5"], "not among the stations"),
    ],
)
def test_certificates_that_cannot_be_made_say_why(
    tmp_path: Path, arguments: list[str], wanted: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["certificates", str(tmp_path / "made"), *arguments]) == 1
    assert wanted in complaints(capsys)[0]
    assert not (tmp_path / "made").exists()


# What is not there, or not understood


@pytest.mark.parametrize(
    "arguments",
    [
        ["--nonsense"],
        ["nonsense"],
        ["check"],
        ["--rate", "fast"],
        ["--size", "big"],
        ["--offscreen", "-1"],
        ["--offscreen", "nan"],
        ["--screenshot", "x.png"],
        ["--theme", "pink"],
        ["sample-size", "--spread", "-0.5"],
        ["sample-size", "--spread", "nan"],
        ["sample-size", "--spread", "1e9"],
        ["sample-size", "--spread", "0.5", "--precision", "0"],
        ["sample-size", "--spread", "0.5", "--precision", "-5"],
        ["sample-size", "--spread", "0.5", "--precision", "nan"],
        ["sample-size", "--spread", "0.5", "--precision", "wide"],
        ["sample-size", "--spread", "0.5", "--shared-percent", "-1"],
        ["sample-size", "--spread", "0.5", "--shared-percent", "nan"],
        ["blind-trial", "--fibres", "0"],
        ["blind-trial", "--fibres", "-1"],
        ["blind-trial", "--sessions", "0"],
        ["blind-trial", "--sessions", "2000"],
        ["calibrate-force"],
        ["calibrate-force", "--weights", "1,2", "--beam", "1e-11"],
        ["calibrate-force", "--weights", "1,-2"],
        ["calibrate-force", "--weights", "nan"],
        ["calibrate-force", "--weights", "1", "--rounds", "0"],
        ["calibrate-force", "--weights", "1", "--expanded-percent", "nan"],
        ["calibrate-force", "--beam", "-1"],
        ["calibrate-force", "--beam", "0"],
        ["calibrate-force", "--beam", "nan"],
        ["simulate", "scu-serial", "--link", "x", "--seconds", "nan"],
    ],
)
def test_a_wrong_command_line_is_explained(
    arguments: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as left:
        main(arguments)
    assert left.value.code == 2
    assert "error: " in capsys.readouterr().err


@pytest.mark.parametrize("command", ["setup", "serve", "calibrate"])
def test_a_platform_file_named_before_the_command_is_the_one_that_is_read(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--config", "/no/such/place", command]) == 1
    assert complaints(capsys) == ["cosmic: /no/such/place: there is no such file"]


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        (["--config", "/no/such/place"], "there is no such file"),
        (["--rate", "0"], "rate: "),
        (["--rate", "nan"], "rate: "),
        (["mico", "--rate", "-3"], "rate: "),
    ],
)
def test_a_window_that_cannot_start_says_why(
    arguments: list[str], wanted: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*arguments, "--offscreen", "1"]) == 1
    assert wanted in complaints(capsys)[0]


def test_a_missing_library_is_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    edit(folder / "platform.toml", 'backend = "simulated"', 'backend = "scu3d"')
    edit(folder / "platform.toml", 'library = ""', 'library = "/no/such/library.so"')
    assert main(["--config", str(folder), "--offscreen", "1"]) == 1
    assert "/no/such/library.so" in complaints(capsys)[0]


def test_without_a_display_it_says_so_instead_of_crashing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for variable in ("QT_QPA_PLATFORM", "DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    assert main([]) == 1
    assert "there is no display" in complaints(capsys)[0]


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        (["calibrate", "--certificates", "nosuch"], "--connect names; name one, or leave it out"),
        (["--offscreen", "0", "--certificates", "nosuch"], "add --serve or --connect"),
        (["calibrate-force", "--beam", "6e-11", "--out", "r.json"], "only readings of --weights"),
        (["calibrate-force", "--weights", "1", "--out", "no/r.json"], "--out no/r.json: name a"),
        (["simulate", "library", "scu3d", "--layout", "???", "--out", "x"], "device 1 is '???'"),
        (["simulate", "library", "scu3d", "--rate", "nan", "--out", "x"], "a clock's rate must"),
        (["simulate", "library", "scu3d", "--out", "afile"], "afile/libscu3dcontrol.c: cannot be"),
    ],
)
def test_what_cannot_be_done_is_refused_before_it_begins(
    arguments: list[str],
    wanted: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "afile").touch()
    assert main(arguments) == 1
    said = complaints(capsys)
    assert wanted in said[-1], said
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        (["export", "."], ".: is a directory"),
        (["export", "/"], "/: is a directory"),
        (["session", "pack", "afile", "--output", "afile/a.zip"], "afile is not a folder"),
        (["new-device", "camera", "cam", "--out", "afile"], "cannot be written (Not a directory)"),
        (["audit", "bytes.toml"], "bytes.toml: is not an audit trail"),
        (["audit", "afile"], "afile: is not an audit trail"),
    ],
)
def test_a_path_that_cannot_be_used_is_named_in_a_line(
    arguments: list[str],
    wanted: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "afile").write_text("some text\n", encoding="utf-8")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe\x00name\n")
    assert main(arguments) == 1
    (said,) = complaints(capsys)
    assert wanted in said


def test_a_calibration_that_is_not_there_is_answered_with_those_that_are(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["calibrate", "--anew", "nosuch"]) == 1
    said = complaints(capsys)[-1]
    assert "there is no calibration 'nosuch'; there are: " in said
    assert "rotation centre" in said


def test_what_all_fibres_share_is_printed_as_it_was_given(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["sample-size", "--spread", "0.5", "--shared-percent", "50"]) == 0
    assert "shared by all: ±50.0 %" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("error", "wanted"),
    [
        (FileNotFoundError(2, "No such file or directory", "a.toml"), "a.toml: No such file or"),
        (NotADirectoryError(20, "Not a directory", b"a/b"), "a/b: Not a directory"),
        (OSError("the bus is gone"), "the bus is gone"),
    ],
)
def test_what_the_system_refuses_is_a_line_with_its_path(
    error: OSError,
    wanted: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def refused(_: object) -> None:
        raise error

    monkeypatch.setattr("cosmic.app.commands.check.find_mistakes", refused)
    assert main(["check", "platform.toml"]) == 1
    (said,) = complaints(capsys)
    assert said.startswith(f"cosmic: {wanted}")


# The whole program


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "cosmic", *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ,
        check=False,
    )


@pytest.mark.parametrize("command", [pytest.param([], marks=pytest.mark.slow), ["mico"]])
def test_an_image_of_the_window_is_saved_without_a_display(
    tmp_path: Path, command: list[str]
) -> None:
    image = tmp_path / "window.png"
    options = ("--offscreen", "0.5", "--screenshot", str(image), "--size", "1366x768")
    done = run(*command, *options, "--theme", "light")
    assert (done.returncode, done.stderr) == (0, "")
    head = image.read_bytes()[:24]
    assert head[:4] == b"\x89PNG"
    size = int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")
    assert size == (1366, 768)


def test_an_image_that_cannot_be_saved_is_an_error(tmp_path: Path) -> None:
    done = run("mico", "--offscreen", "0.2", "--screenshot", str(tmp_path / "no" / "window.png"))
    assert done.returncode == 1
    assert "cannot be saved" in done.stderr


def test_importing_the_command_line_loads_no_widgets() -> None:
    code = "import sys, cosmic.app.cli; sys.exit('PySide6.QtWidgets' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=60).returncode == 0


# export


def test_a_recording_that_is_not_there_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["export", str(tmp_path / "nothing.h5"), "--to", "tdms"]) == 1
    assert "nothing.h5" in complaints(capsys)[0]
