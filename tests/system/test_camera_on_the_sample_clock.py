"""A camera that the sample clock triggers: its images belong to samples, within one sample."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import tomlkit

import cosmic
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
