"""The last seconds of a control loop, for plots and for judging whether it has settled."""

from dataclasses import dataclass
from threading import Lock
from typing import Final

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]

TRACE_S: Final = 20.0
"""Wall time that is kept."""


@dataclass(frozen=True, eq=False, slots=True)
class ControlTrace:
    """What a loop did, one value a cycle, oldest first; arrays of shape (n,), float64, read-only.

    Attributes
    ----------
    wall_s : ndarray
        Wall time since the loop began.
    set_point, measured : ndarray
        In the unit of the source.
    output : ndarray
        Velocity asked for, in the unit of the axis a second.
    position : ndarray
        Where the axis was sent, from the user's zero at the begin.
    """

    wall_s: Values
    set_point: Values
    measured: Values
    output: Values
    position: Values


class TraceRecorder:
    """A ring of rows; one thread writes, any reads."""

    def __init__(self, rate_hz: float) -> None:
        self._rows = np.zeros((max(16, round(TRACE_S * rate_hz)), 5))
        self._count = 0
        self._lock = Lock()

    def put(self, row: tuple[float, float, float, float, float]) -> None:
        """Add wall_s, set_point, measured, output, position."""
        with self._lock:
            self._rows[self._count % len(self._rows)] = row
            self._count += 1

    def last(self, seconds: float) -> ControlTrace:
        """Return the rows of the last `seconds` of wall time."""
        with self._lock:
            held = min(self._count, len(self._rows))
            order = np.arange(self._count - held, self._count) % len(self._rows)
            rows = self._rows[order]
        if held:
            rows = rows[rows[:, 0] >= rows[-1, 0] - seconds]
        columns = [np.ascontiguousarray(column) for column in rows.T]
        for column in columns:
            column.flags.writeable = False
        return ControlTrace(*columns)
