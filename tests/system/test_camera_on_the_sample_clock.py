"""A camera that the sample clock triggers: its images belong to samples, within one sample."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import tomlkit

import cosmic
from cosmic.app.cli import main
from cosmic.frame.config import shipped_config_dir
from cosmic.vico.core.image import CameraImage

RATE_HZ = 1000.0
IMAGES_HZ = 10.0


def write_platform(folder: Path, **trigger: object) -> Path:
    for each in shipped_config_dir().rglob("*"):
        if each.is_file():
            copy = folder / each.relative_to(shipped_config_dir())
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(each.read_bytes())
    path = folder / "platform.toml"
    platform = tomlkit.parse(path.read_text("utf-8")).unwrap()
    settings = {"camera": "microscope", "board": "Dev1", "rate_hz": IMAGES_HZ} | trigger
    platform["daqco"]["camera_trigger"] = settings
    platform["vico"]["camera"][0]["trigger"] = "hardware"
    path.write_text(tomlkit.dumps(platform), "utf-8")
    return path


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[cosmic.Rig]:
    with cosmic.connect(write_platform(tmp_path), rate=1.0) as opened:
        yield opened


def images(rig: cosmic.Rig, count: int) -> list[CameraImage]:
    camera = rig.vico.camera("microscope")
    return [camera.images.next(20.0, None) for _ in range(count)]


def test_image_times_agree_with_sample_numbers_within_one_sample(
    rig: cosmic.Rig, tmp_path: Path
) -> None:
    with rig.daqco.record(tmp_path / "run.h5"):
        taken = images(rig, 6)
    with cosmic.open_recording(tmp_path / "run.h5") as recording:
        exposures = {each.sample: each for each in recording.exposures}
        assert len(exposures) >= 5
        assert {each.camera for each in exposures.values()} == {"microscope"}
        first, last = min(exposures), max(exposures)
        inside = [each for each in taken if first <= (each.circumstances.sample or -1) <= last]
        assert len(inside) >= 4
        for image in inside:
            sample, sample_s = image.circumstances.sample, image.circumstances.sample_s
            assert sample is not None and sample_s is not None
            assert sample % (RATE_HZ / IMAGES_HZ) == 0
            assert exposures[sample].time_s == pytest.approx(sample_s, abs=1e-6)
            assert abs(image.frame.exposed_s - sample_s) < 1.0 / RATE_HZ


def test_a_trigger_for_a_camera_that_is_not_there_or_runs_free_is_a_mistake(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_platform(tmp_path, camera="telescope")
    assert main(["check", str(path)]) == 1
    assert "daqco.camera_trigger.camera: there is no camera 'telescope'" in capsys.readouterr().err
    text = write_platform(tmp_path).read_text(encoding="utf-8")
    path.write_text(text.replace('trigger = "hardware"', ""), encoding="utf-8")
    assert main(["check", str(path)]) == 1
    assert 'give microscope trigger = "hardware"' in capsys.readouterr().err


def test_a_trigger_that_is_too_fast_for_the_samples_is_refused_with_what_is_possible(
    tmp_path: Path,
) -> None:
    path = write_platform(tmp_path, rate_hz=400.0)
    with cosmic.connect(path, applications=("daqco",), rate=10.0) as rig:
        assert "camera_trigger: 400 Hz asked; at 1000 samples a second up to 250 Hz" in (
            rig.daqco.problem
        )
