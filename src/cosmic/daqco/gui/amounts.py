"""Amounts of data and of time as the operator reads them."""

from typing import Final

from cosmic.daqco.gui.ports import Recording

LITTLE_ROOM_S: Final = 600.0
LATE_S: Final = 1.0


def size_text(size_bytes: float) -> str:
    """Return an amount of data, such as "12.3 MB"."""
    for unit in ("B", "kB", "MB", "GB"):
        if size_bytes < 1000.0:
            return f"{size_bytes:.0f} B" if unit == "B" else f"{size_bytes:.1f} {unit}"
        size_bytes /= 1000.0
    return f"{size_bytes:.1f} TB"


def duration_text(duration_s: float) -> str:
    """Return a time, such as "2 h 05 min" or "1 min 12 s"."""
    seconds = int(duration_s)
    if seconds >= 100 * 86_400:
        return "more than 100 days"
    if seconds >= 2 * 86_400:
        return f"{seconds // 86_400} days {seconds % 86_400 // 3600} h"
    if seconds >= 3600:
        return f"{seconds // 3600} h {seconds % 3600 // 60:02d} min"
    if seconds >= 60:
        return f"{seconds // 60} min {seconds % 60:02d} s"
    return f"{duration_s:.1f} s"


def recording_text(recording: Recording, behind_s: float) -> str:
    """Return how long and how large a recording is; empty when there has been none."""
    amount = f"{duration_text(recording.duration_s)}, {size_text(recording.size_bytes)}"
    if recording.active:
        return f"recording: {amount}" + (f", {behind_s:.1f} s behind" if behind_s >= LATE_S else "")
    return f"{recording.path.name}: {amount}" if recording.path is not None else ""


def room_text(free_bytes: float, left_s: float) -> str:
    """Return how much room there is, and for how long."""
    text = f"{size_text(free_bytes)} free on the disk: {duration_text(left_s)} at this rate"
    return f"◆ little room: {text}" if left_s < LITTLE_ROOM_S else text
