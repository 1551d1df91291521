"""Finding the focus with the motor of the lens, on frames exposed after each movement."""

from typing import Final

from cosmic.frame.clock import Clock
from cosmic.frame.errors import CosmicError, MoveCancelled, NotAvailable
from cosmic.frame.operation import Task
from cosmic.vico.core.camera_unit import CameraUnit
from cosmic.vico.core.focus import FocusAnswer, FocusFault, FocusSearch, sharpness
from cosmic.vico.core.lens_control import PeripheralThread
from cosmic.vico.hw.peripherals import LensAxis

COARSE_STEPS: Final = 40
"""Over the whole travel; a step is then less than the depth of field up to 5x."""
FINE_STEPS: Final = 6
"""In one coarse step."""
NEAR_SHARE: Final = 0.2
"""Of the travel, to both sides: looked at first."""
MOVE_S: Final = 30.0
IMAGE_S: Final = 5.0
FRAMES: Final = 2


def find_focus(task: Task, unit: CameraUnit, lens: PeripheralThread, clock: Clock) -> None:
    """Look near the present position, then everywhere; in the application's thread."""
    state = lens.state.axis(LensAxis.FOCUS)
    if state is None or not state.homed:
        task.fail(NotAvailable("the lens has not been homed; home it, then try again"))
        return
    before, limit = state.position_counts, state.limit_counts
    reach = NEAR_SHARE * limit
    near = max(0.0, before - reach), min(float(limit), before + reach)
    try:
        answer = _sweep(task, unit, lens, clock, near, limit / COARSE_STEPS)
        if answer.fault in (FocusFault.AT_END, FocusFault.FLAT):
            answer = _sweep(task, unit, lens, clock, (0.0, float(limit)), limit / COARSE_STEPS)
        if answer.position is None:
            raise NotAvailable(answer.text)
        # From below, as the sweep went, so that the play lies on the same side.
        for target in (max(0.0, answer.position - limit / COARSE_STEPS), answer.position):
            lens.seek(LensAxis.FOCUS, round(target)).wait(MOVE_S)
        task.report(1.0, answer.text)
        task.finish()
    except CosmicError as exc:
        _go_back(lens, before, cancelled=task.cancel_requested)
        task.fail(exc)


def _sweep(
    task: Task,
    unit: CameraUnit,
    lens: PeripheralThread,
    clock: Clock,
    span: tuple[float, float],
    coarse: float,
) -> FocusAnswer:
    low, high = span
    search = FocusSearch(
        low, high, coarse_step=coarse, fine_step=coarse / FINE_STEPS, frames=FRAMES
    )
    whole = FRAMES * ((high - low) / coarse + 3 * FINE_STEPS + 2)
    taken, at, since_s = 0, None, clock.now_s()
    while (target := search.target) is not None:
        if task.cancel_requested:
            raise MoveCancelled("autofocus was cancelled")
        if target != at:
            lens.seek(LensAxis.FOCUS, round(target)).wait(MOVE_S)
            at, since_s = target, clock.now_s()
        image = unit.thread.next_image(since_s, IMAGE_S)
        # A frame is used once: the next one must be exposed after it was complete.
        since_s = image.frame.time_s
        search.add(float(round(target)), sharpness(image.data))
        taken += 1
        task.report(min(0.99, taken / whole), f"focus at {round(target)} counts")
    answer = search.answer
    if answer is None:
        raise NotAvailable("no focus found")
    return answer


def _go_back(lens: PeripheralThread, position: int, *, cancelled: bool) -> None:
    """Leave the lens where it was; after a cancel it stays, for somebody wanted it to stand."""
    if not cancelled:
        lens.seek(LensAxis.FOCUS, position)
