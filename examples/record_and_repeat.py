"""Record movements to a readable file, rehearse it, and let the platform make them again.

Then the same for the other assembly, and at another position by a named pose.
"""

import tempfile
from pathlib import Path

import cosmic
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.trajectory.model import Trajectory, TrajectoryError


def record(mico: Mico, path: Path) -> None:
    """Record what a script does; a window, keys or a gamepad are recorded the same way."""
    mico.poses.teach("fibre", "Left assembly")
    with mico.trajectories.record(path, title="Over the fibre", relative_to="fibre", timed=False):
        mico["left.z"].move_by(400.0)
        mico.move_by({"left.x": -300.0, "left.y": 150.0})
        mico["left.gripper"].steps(80)
        mico["left.z"].move_by(-400.0)
    print(path.read_text(encoding="utf-8"))


def rehearse(mico: Mico, trajectory: Trajectory) -> None:
    """See what it would do, without moving anything."""
    found = mico.trajectories.rehearse(trajectory)
    print(f"rehearsed: allowed {found.allowed}, {found.lines} statements")
    print(f"  smallest clearance {found.clearance_um:.0f} um at line {found.clearance_line}")
    print(f"  about {found.duration_s:.1f} s, left.x ends at {found.end['left.x']:.0f} um")


def at_another_position(mico: Mico, path: Path) -> None:
    """Teach the pose anew where the next fibre lies, and run the same file."""
    mico.move({"left.x": -500.0, "left.y": 0.0})
    mico.poses.teach("fibre", "Left assembly")
    mico.trajectories.run(path)
    print(f"at the next fibre: left.x is at {mico['left.x'].position_um:.0f} um")


def with_mistakes(mico: Mico) -> None:
    """Mistakes are told with their lines, before anything moves."""
    try:
        mico.trajectories.parse(
            "cosmic-trajectory 1\nplatform FiberStation\nleft.x to 9 mm\nleft.gripper to 5 um\n"
        )
    except TrajectoryError as refused:
        for problem in refused.problems:
            print(f"line {problem.line}: {problem.text}")


def main() -> None:
    """Start the platform twenty times faster than real time and use it."""
    with tempfile.TemporaryDirectory() as folder, cosmic.connect(rate=20, world="plain") as rig:
        mico, path = rig.mico, Path(folder) / "over-the-fibre.trajectory"
        record(mico, path)
        trajectory = mico.trajectories.load(path)
        rehearse(mico, trajectory)
        mico.trajectories.run(trajectory, start="straight")
        print(f"repeated: left.x is at {mico['left.x'].position_um:.0f} um")
        at_another_position(mico, path)
        with_mistakes(mico)


if __name__ == "__main__":
    main()
