"""What `cosmic check` says of two devices of one name, and of devices that are not there."""

from pathlib import Path

import pytest

from cosmic.app.cli import main

CAMERA = '[[vico.camera]]\nname = "other"\nkey = "Sim1"\n'
DRIVER = '[[daqco.driver]]\nbackend = "{}"\n'
CONTROLLER = '[[mico.controller]]\nbackend = "simulated"\n{}serials = [9]\n'
CONTACT = '[[mico.contact]]\nbodies = ["{}", "{}"]\nresponse = "refuse"\n'
RESPONSE = CONTACT.format("left_jaw_a", "plate")


def checked(folder: Path, replaced: str, by: str, capsys: pytest.CaptureFixture[str]) -> str:
    """Check a copy of the simulated platform with something replaced, and return what is said."""
    assert main(["init", str(folder)]) == 0
    file = folder / "platform.toml"
    text = file.read_text(encoding="utf-8")
    assert replaced in text
    file.write_text(text.replace(replaced, by, 1), encoding="utf-8")
    capsys.readouterr()
    assert main(["check", str(file)]) == 1
    return capsys.readouterr().err


@pytest.mark.parametrize(
    ("before", "added", "said"),
    [
        ("[[vico.camera]]", CAMERA, "'other' and 'microscope' are the same camera, 'Sim1'"),
        ("[[daqco.channel]]", DRIVER.format("simulated"), "'simulated' is there twice"),
        ("[[daqco.channel]]", DRIVER.format("nidaqmx") * 2, "'nidaqmx' is there twice"),
        (
            "[[daqco.channel]]",
            DRIVER.format("simulated") + 'options = { product = "T7" }\n',
            "two boards are named 'Dev1'",
        ),
        ("[mico.defaults]", CONTROLLER.format(""), "'simulated' is there twice"),
        ("[mico.defaults]", CONTROLLER.format('library = "a"\n'), "would both move the twin"),
        ("[mico.defaults]", 2 * RESPONSE, "left_jaw_a and plate have a response already"),
        ("[mico.defaults]", CONTACT.format("jaw", "plate"), "there is no body 'jaw'"),
        (
            "[mico.defaults]",
            CONTACT.format("left_jaw_a", "left_jaw_b"),
            "left_jaw_a and left_jaw_b are not watched",
        ),
    ],
)
def test_what_is_there_twice_is_refused(
    before: str, added: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said in checked(tmp_path / "config", before, f"{added}\n{before}", capsys)


@pytest.mark.parametrize(
    ("replaced", "by", "said"),
    [
        ('board = "Dev1"', 'board = "Dev9"', "no board 'Dev9'; there are Dev1, Dev2"),
        ('input = "ai0"', 'input = "ai99"', "Dev1 has no input 'ai99'; it has ai0 to ai31"),
    ],
)
def test_a_simulated_board_or_input_that_is_not_there_is_named(
    replaced: str, by: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert said in checked(tmp_path / "config", replaced, by, capsys)


def test_a_contact_without_a_scene_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    named = 'scene = "scenes/fiberstation.toml"'
    folder = tmp_path / "config"
    assert main(["init", str(folder)]) == 0
    file = folder / "platform.toml"
    text = file.read_text(encoding="utf-8").replace(named, 'scene = ""', 1)
    file.write_text(text.replace("[mico.defaults]", f"{RESPONSE}\n[mico.defaults]", 1), "utf-8")
    assert main(["check", str(file)]) == 1
    assert "name one in platform.scene" in capsys.readouterr().err
