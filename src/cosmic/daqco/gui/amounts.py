"""What is recorded, and how much room there is, as the operator reads it."""

from typing import Final

from cosmic.daqco.api.recorder import RecordingState
from cosmic.frame.gui.amounts import duration_text, size_text

LITTLE_ROOM_S: Final = 600.0
LATE_S: Final = 1.0


def recording_text(recording: RecordingState, behind_s: float) -> str:
    """Return how long and how large a recording is; empty when there has been none."""
    amount = f"{duration_text(recording.duration_s)}, {size_text(recording.size_bytes)}"
    if recording.active:
        return f"recording: {amount}" + (f", {behind_s:.1f} s behind" if behind_s >= LATE_S else "")
    return f"{recording.path.name}: {amount}" if recording.path is not None else ""


def room_text(free_bytes: float, left_s: float) -> str:
    """Return how much room there is, and for how long."""
    text = f"{size_text(free_bytes)} free on the disk: {duration_text(left_s)} at this rate"
    return f"◆ little room: {text}" if left_s < LITTLE_ROOM_S else text
