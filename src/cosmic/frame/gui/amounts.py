"""Amounts of data and of time as the operator reads them."""

import math


def size_text(size_bytes: float) -> str:
    """Return an amount of data, such as "12.3 MB"."""
    for unit in ("B", "kB", "MB", "GB"):
        if size_bytes < 1000.0:
            return f"{size_bytes:.0f} B" if unit == "B" else f"{size_bytes:.1f} {unit}"
        size_bytes /= 1000.0
    return f"{size_bytes:.1f} TB"


def duration_text(duration_s: float) -> str:
    """Return a time, such as "2 h 05 min" or "1 min 12 s"."""
    if math.isnan(duration_s):
        return "?"
    if duration_s >= 100 * 86_400:
        return "more than 100 days"
    seconds = int(duration_s)
    if seconds >= 2 * 86_400:
        return f"{seconds // 86_400} days {seconds % 86_400 // 3600} h"
    if seconds >= 3600:
        return f"{seconds // 3600} h {seconds % 3600 // 60:02d} min"
    if seconds >= 60:
        return f"{seconds // 60} min {seconds % 60:02d} s"
    return f"{max(0.0, duration_s):.1f} s"


def clock_text(duration_s: float) -> str:
    """Return a time in little room, such as "12.3 s", "2:05" or "1:02:05"."""
    if math.isnan(duration_s) or duration_s < 60.0:
        return duration_text(duration_s)
    seconds = int(duration_s)
    minutes = f"{seconds // 60 % 60:02d}:{seconds % 60:02d}"
    if seconds >= 3600:
        return f"{seconds // 3600}:{minutes}"
    return minutes.removeprefix("0")
