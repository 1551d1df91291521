"""What the trajectory panel says and shows."""

from pathlib import Path

from cosmic.mico.api.trajectory_recording import TrajectoryRecording
from cosmic.mico.core.trajectory.parser import LARGEST_BYTES
from cosmic.mico.core.trajectory.rehearsal import Rehearsal


def rehearsal_text(found: Rehearsal) -> str:
    """Return what a rehearsal found, for the operator."""
    parts = [f"{found.lines} lines in about {found.duration_s:.1f} s"]
    if found.clearance_um is not None:
        where = f"line {found.clearance_line}" if found.clearance_line else "the start"
        bodies = " and ".join(found.clearance_bodies)
        parts.append(f"smallest clearance {found.clearance_um:.0f} µm at {where} ({bodies})")
    ends = [f"{axis} {value:.1f}" for axis, value in found.end.items()]
    if ends:
        parts.append(f"ends at {', '.join(ends)}")
    return "; ".join(parts)


def recording_text(recording: TrajectoryRecording) -> str:
    """Return what has become of a recording, for the operator."""
    if recording.error is not None:
        return str(recording.error)
    return f"{recording.path.name}: {recording.lines} lines"


def lines_of(path: Path) -> list[str]:
    """Return what can be shown of a file that is no trajectory."""
    try:
        with path.open("rb") as file:
            data = file.read(LARGEST_BYTES)
    except OSError:
        return []
    return data.decode("utf-8", errors="replace").splitlines()
