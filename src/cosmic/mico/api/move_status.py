"""A movement of one or several axes, as a plan sees it."""

from typing_extensions import override

from cosmic.frame.plan_shape import PlanStatus
from cosmic.mico.api.group_movement import GroupMovement
from cosmic.mico.core.motion.movement import Movement


class MoveStatus(PlanStatus):
    """What `set` returns. Refusals, stops and faults are what it fails with.

    Only ``stop(success=True)``, by which a plan is paused, ends it well before its target: bluesky
    makes the move again when it resumes.

    Attributes
    ----------
    movement : Movement or GroupMovement or None
        None where it was refused.
    """

    def __init__(self, what: str, movement: Movement | GroupMovement | None = None) -> None:
        super().__init__(what)
        self.movement = movement
        if movement is not None:
            movement.add_callback(self._on_end)

    def _on_end(self, movement: Movement | GroupMovement) -> None:
        error = movement.exception()
        if error is None:
            self.finish()
        else:
            self.fail(error)

    @override
    def cancel(self) -> None:
        """Stop what still moves."""
        super().cancel()
        if self.movement is not None:
            self.movement.cancel()


def refused(what: str, error: Exception) -> MoveStatus:
    """Return what has failed with `error` before it began."""
    status = MoveStatus(what)
    status.fail(error)
    return status
