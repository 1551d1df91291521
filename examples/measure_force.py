"""Push the probe into a fibre, record the force, read a stiffness, and be stopped by a limit."""

import tempfile
from pathlib import Path

import cosmic


def push(rig: cosmic.Rig, file: Path) -> None:
    """Drive the probe slowly against the fibre in the left gripper, and record it."""
    probe = rig.mico["probe.y"]
    rig.mico.move({"left.z": -800.0, "left.x": 3600.0})
    probe.move_to(-4940.0)
    probe.set_closed_loop_frequency(30)  # about 45 um/s: its position is read 20 times a second
    with rig.daqco.record(file, overwrite=True):
        probe.move_to(-5040.0)
    print(f"force at the end: {rig.daqco.latest()['force']:.0f} {rig.daqco.units['force']}")


def read_stiffness(file: Path) -> None:
    """Fit a line to force over position, where the probe touches."""
    with cosmic.open_recording(file) as recording:
        slope = recording.slope("force", "probe.y", high=-5000.0)
        print(f"{recording.rate_hz:g} Hz, complete: {recording.complete}")
        print(f"stiffness: {-slope.value:.2f} +- {slope.standard_error:.2f} {slope.unit}")


def be_stopped(rig: cosmic.Rig) -> None:
    """Go on pushing with a limit armed: the actuators stop by themselves."""
    rig.daqco.arm_limit("force", high=140.0, hysteresis=10.0)
    probe = rig.mico["probe.y"]
    probe.set_closed_loop_frequency(30)  # slowly: what overshoots the limit is speed times delay
    try:
        probe.move_to(-5200.0)
    except cosmic.StoppedError as stopped:
        print(f"stopped: {stopped}")
    limit = rig.daqco.limits[0]
    print(f"crossed: {limit.crossed}, after {limit.reaction_ms:.0f} ms")
    rig.reset_stop()
    probe.move_to(-4900.0)
    rig.daqco.reset_limit("force")  # until then it stays told that it was crossed


def main() -> None:
    """Do all of it on the simulated platform, in real time."""
    with tempfile.TemporaryDirectory() as folder, cosmic.connect(world="plain") as rig:
        file = Path(folder) / "push.h5"
        push(rig, file)
        read_stiffness(file)
        be_stopped(rig)


if __name__ == "__main__":
    main()
