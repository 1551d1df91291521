"""Waiting for a long operation as a script does."""

from cosmic.frame.task import Task


def wait_or_cancel(task: Task) -> None:
    """Wait until `task` ends; Ctrl+C cancels it. Raises what it failed with."""
    try:
        task.wait()
    except KeyboardInterrupt:
        task.cancel()
        raise
