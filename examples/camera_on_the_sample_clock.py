"""A camera that exposes at samples: each image belongs to the force that was felt just then.

The shipped platform is copied out; the microscope is triggered by a counter of the board that reads
the force.
"""

from pathlib import Path
from tempfile import TemporaryDirectory

import tomlkit

import cosmic
from cosmic.frame.config import shipped_config_dir


def write_platform(folder: Path) -> Path:
    """Write the files of the platform into `folder` and return the platform file."""
    for each in shipped_config_dir().rglob("*"):
        if each.is_file():
            copy = folder / each.relative_to(shipped_config_dir())
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(each.read_bytes())
    platform_file = folder / "platform.toml"
    platform = tomlkit.parse(platform_file.read_text("utf-8")).unwrap()
    trigger = {"camera": "microscope", "board": "Dev1", "counter": "ctr0", "rate_hz": 10.0}
    platform["daqco"]["camera_trigger"] = trigger
    platform["vico"]["camera"][0]["trigger"] = "hardware"
    platform_file.write_text(tomlkit.dumps(platform), "utf-8")
    return platform_file


def image_and_force(rig: "cosmic.Rig", path: "Path") -> tuple[int, float]:
    """Record while an image is taken; return its sample and the force of that sample."""
    camera = rig.vico.camera("microscope")
    with rig.daqco.record(path):
        rig.daqco["force"].read()
        image = camera.images.next(20.0, rig.daqco.clock.now_s())
        camera.images.next(20.0, None)
    sample = image.circumstances.sample
    assert sample is not None
    with cosmic.open_recording(path) as recording:
        (exposure,) = [each for each in recording.exposures if each.sample == sample]
        force_un = recording.values("force", start_s=exposure.time_s)[0]
    return sample, float(force_un)


def main() -> tuple[int, float]:
    """Take one image with its force."""
    with TemporaryDirectory() as folder:
        platform = write_platform(Path(folder))
        with cosmic.connect(platform) as rig:
            return image_and_force(rig, Path(folder) / "push.h5")


if __name__ == "__main__":
    taken_at, felt_un = main()
    print(f"the image was taken at sample {taken_at}, at {felt_un:.1f} uN")
