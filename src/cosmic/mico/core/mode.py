"""What `DeviceManager` is at."""

from enum import StrEnum


class Mode(StrEnum):
    """What the manager is at."""

    CLOSED = "closed"
    INITIALISATION = "initialisation"
    RUN_TIME = "run-time"
    FAILED = "failed"
