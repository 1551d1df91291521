"""What the run of a procedure is at."""

from enum import StrEnum


class RunState(StrEnum):
    """What a run is at; the value is the word."""

    READY = "ready"
    RUNNING = "running"
    PAUSING = "pausing"
    PAUSED = "paused"
    ABORTING = "aborting"
    DONE = "done"
    FAILED = "failed"
    ABORTED = "aborted"


OVER = frozenset({RunState.DONE, RunState.FAILED, RunState.ABORTED})
