"""A piezo on an analogue output: a value, a ramp that begins with the acquisition, and the stop.

The shipped platform is copied out; one output is named in it, and wired to an input, so that what
is given can be seen.
"""

import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
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
    daqco = platform["daqco"]
    daqco["options"] = {"wires": {"Dev1/ao0": "Dev1/ai7"}}
    daqco["channel"].append({"name": "monitor", "board": "Dev1", "input": "ai7"})
    daqco["output"] = [
        {"name": "piezo", "board": "Dev1", "output": "ao0", "low_v": 0.0, "high_v": 5.0},
        {"name": "lamp", "board": "Dev1", "output": "port0/line0"},
    ]
    platform_file.write_text(tomlkit.dumps(platform), "utf-8")
    return platform_file


def give_values(rig: "cosmic.Rig") -> None:
    """Give a voltage and set a line."""
    rig.daqco.set_output("piezo", 2.0)
    rig.daqco.set_line("lamp", high=True)


def play_with_the_samples(rig: "cosmic.Rig") -> None:
    """Give the value of a ramp to each sample, from sample 0 on."""
    rig.daqco.stop()
    ramp_v = np.linspace(0.0, 4.0, 401)
    rig.daqco.play("piezo", ramp_v, 1000.0, trigger="/Dev1/ai/StartTrigger")
    rig.daqco.start()


def main() -> list[str]:
    """Use the output in every way that there is and return what was seen."""
    seen = []
    with TemporaryDirectory() as folder:
        path = Path(folder) / "ramp.h5"
        with cosmic.connect(write_platform(Path(folder)), rate=5.0) as rig:
            give_values(rig)
            for each in rig.daqco.outputs:
                seen.append(f"{each.name} gives {each.value:g}")
            try:
                rig.daqco.set_output("piezo", 6.0)
            except cosmic.LimitError as refused:
                seen.append(f"refused: {refused}")

            play_with_the_samples(rig)
            with rig.daqco.record(path):
                while rig.daqco.outputs[0].playing:
                    time.sleep(0.01)
                played_s = rig.daqco.clock.now_s()
                while rig.daqco.latest_chunk.end_time_s < played_s:
                    time.sleep(0.01)
            with cosmic.open_recording(path) as recording:
                seen.append(f"the ramp ends at {recording.values('monitor')[-1]:.1f} V")

            rig.stop()
            try:
                rig.daqco.set_output("piezo", 1.0)
            except cosmic.StoppedError as refused:
                seen.append(f"refused: {refused}")
    return seen


if __name__ == "__main__":
    for line in main():
        print(line)
