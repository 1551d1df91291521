"""How long operations take, and what they fail with: for reports and for the time left."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from threading import Lock

import numpy as np

from cosmic.autonomy.procedures.tree import ENDS, OPERATION, NodeEvent, NodeState


@dataclass(frozen=True, slots=True)
class OperationStatistics:
    """All tries of one operation.

    Attributes
    ----------
    name : str
        Of the operation.
    count, done, failed : int
        Tries that have ended, those that did what they should, and those that failed; an abort
        makes the difference.
    median_s, p95_s, total_s : float
        Platform time of the tries, pauses left out; 95 % take `p95_s` or less.
    """

    name: str
    count: int
    done: int
    failed: int
    median_s: float
    p95_s: float
    total_s: float


class OperationTimes:
    """Adds up what the operations of one or more runs took; any thread."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._durations_s: dict[str, list[float]] = {}
        self._ends: Counter[tuple[str, NodeState]] = Counter()
        self._causes: Counter[str] = Counter()
        self._causes_of: dict[str, Counter[str]] = {}

    def note(self, event: NodeEvent) -> None:
        """Take one event of a run; all but the end of an operation are passed over."""
        if event.kind == OPERATION and event.state in ENDS:
            self.add(event.name, event.duration_s, event.state, event.cause)

    def add(
        self, name: str, duration_s: float, state: NodeState = NodeState.DONE, cause: str = ""
    ) -> None:
        """Take one try of an operation, as from a journal."""
        with self._lock:
            self._durations_s.setdefault(name, []).append(duration_s)
            self._ends[name, state] += 1
            if cause:
                self._causes[cause] += 1
                self._causes_of.setdefault(name, Counter())[cause] += 1

    def summary(self) -> tuple[OperationStatistics, ...]:
        """Return the figures of each operation, in the order of their first end."""
        with self._lock:
            return tuple(self._figures(name) for name in self._durations_s)

    def _figures(self, name: str) -> OperationStatistics:
        durations_s = np.array(self._durations_s[name])
        return OperationStatistics(
            name=name,
            count=durations_s.size,
            done=self._ends[name, NodeState.DONE],
            failed=self._ends[name, NodeState.FAILED],
            median_s=float(np.median(durations_s)),
            p95_s=float(np.percentile(durations_s, 95.0)),
            total_s=float(durations_s.sum()),
        )

    @property
    def causes(self) -> Mapping[str, int]:
        """How many operations failed by each cause, the most frequent first."""
        with self._lock:
            return dict(self._causes.most_common())

    def causes_of(self, name: str) -> Mapping[str, int]:
        """Return how many tries of one operation failed by each cause."""
        with self._lock:
            return dict(self._causes_of.get(name, Counter()).most_common())
