"""Carries the initialisation sequence out, step by step (thesis 7.1)."""

import logging
from collections.abc import Callable
from dataclasses import replace
from threading import Event
from typing import Final

from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    DeviceFault,
    MoveCancelled,
    MoveRefused,
    refusal,
)
from cosmic.frame.operation import Task
from cosmic.frame.verdict import Reason, refuse
from cosmic.mico.api.group_movement import move_together
from cosmic.mico.core.motion.manager import DeviceManager
from cosmic.mico.core.motion.positioner import Confidence
from cosmic.mico.core.sequence.plan import PlannedStep, plan_sequence
from cosmic.mico.core.sequence.report import SequenceReport, StepReport, StepState
from cosmic.mico.core.sequence.settings import StepKind

logger = logging.getLogger(__name__)

SOURCE: Final = "initialisation"
POLL_S: Final = 0.02
"""How often a wait looks whether it was stopped or cancelled, in wall time."""

Confirm = Callable[[str], bool]
"""Asked the text of a step "confirm"; True goes on. It may wait."""

_AGAIN: Final = "then initialise again"
_BY_FAULT: Final = {
    DeviceFault.REFERENCE: "calibrate its sensor",
    DeviceFault.CALIBRATION: "move it away from its end stop",
    DeviceFault.END_STOP: "see what it ran into",
    DeviceFault.NO_SENSOR: "check its cable",
    DeviceFault.COMMUNICATION: "check cable and power, rescan",
    DeviceFault.TIMEOUT: "see whether it is blocked",
    DeviceFault.OVERRIDDEN: "let go of the hand control unit",
    DeviceFault.OVERHEATED: "let it cool down",
}
_BY_REASON: Final = {
    Reason.STOPPED: "reset the stop",
    Reason.NO_LEASE: "take control of the platform",
    Reason.COLLISION: "move aside what is in its way",
    Reason.LIMIT: "correct the step in the platform file",
    Reason.DEVICE: "connect it, rescan",
}


class InitialisationRun:
    """One run of the sequence; `run` works in the application's thread.

    Parameters
    ----------
    skip_known : bool
        Leave alone what is known already.
    confirm : callable or None
        Answers the steps that ask; None answers no.
    on_report : callable
        Told after each change.
    """

    def __init__(
        self,
        manager: DeviceManager,
        *,
        skip_known: bool = False,
        confirm: Confirm | None = None,
        on_report: Callable[[SequenceReport], None] | None = None,
    ) -> None:
        self._manager = manager
        self._skip_known = skip_known
        self._confirm = confirm
        self._on_report = on_report
        self._report = SequenceReport(())
        self._epoch = manager.latch.state.epoch

    def run(self, task: Task) -> None:
        """Carry the sequence out and end `task`."""
        try:
            steps = self._plan()
            for number, step in enumerate(steps):
                self._step(task, number, step)
            task.finish()
        except CosmicError as exc:
            task.fail(exc)

    def _plan(self) -> tuple[PlannedStep, ...]:
        manager = self._manager
        steps = plan_sequence(manager.settings, manager.states(), skip_known=self._skip_known)
        reports = tuple(StepReport(step.title, StepState.WAITING) for step in steps)
        self._publish(SequenceReport(reports))
        return steps

    def _step(self, task: Task, number: int, step: PlannedStep) -> None:
        note = "; ".join(step.left_out)
        if step.idle:
            self._mark(number, StepState.SKIPPED, note)
            return
        self._mark(number, StepState.RUNNING, note)
        count = len(self._report.steps)
        task.report(number / count, step.title)
        try:
            self._look(task)
            self._do(task, step)
        except CosmicError as exc:
            explained = _explained(exc, f"step {number + 1} of {count}, {step.title}")
            self._mark(number, StepState.FAILED, str(exc))
            raise explained from exc
        self._mark(number, StepState.DONE, note)

    def _do(self, task: Task, step: PlannedStep) -> None:
        match step.kind:
            case StepKind.WAIT:
                self._wait(task, step.wait_s)
            case StepKind.CONFIRM:
                self._ask(step.text)
                self._look(task)
            case StepKind.ZERO:
                self._zero(step)
            case _:
                manager = self._manager
                move_together(
                    manager, step.motions, task, source=SOURCE, consent=True, linked=False
                )

    def _look(self, task: Task) -> None:
        """Go no further when it was cancelled or stopped."""
        if task.cancel_requested:
            raise MoveCancelled("initialisation was cancelled")
        state = self._manager.latch.state
        if state.epoch != self._epoch or state.latched:
            text = f"motion was stopped ({state.reason or 'reset since'})"
            raise refusal(refuse(Reason.STOPPED, text))

    def _wait(self, task: Task, wait_s: float) -> None:
        clock, woken = self._manager.clock, Event()
        task.on_cancel(woken.set)
        until_s = clock.now_s() + wait_s
        rate = clock.rate or 1.0
        while (left_s := until_s - clock.now_s()) > 0.0:
            woken.wait(min(POLL_S, left_s / rate))
            self._look(task)

    def _ask(self, text: str) -> None:
        if self._confirm is None:
            raise MoveCancelled(f"nobody is there to confirm {text!r}; pass confirm")
        self._publish(replace(self._report, question=text))
        agreed = confirmed(self._confirm, text)
        self._publish(replace(self._report, question=""))
        if not agreed:
            raise MoveCancelled(f"{text!r} was answered with no")

    def _zero(self, step: PlannedStep) -> None:
        for name in step.zeros:
            state = self._manager.state(name)
            if state.position is None or state.confidence is Confidence.UNKNOWN:
                text = f"{name}: its position is unknown; reference it before its zero is set"
                raise refusal(refuse(Reason.POSITION_UNKNOWN, text, axis=name))
            channel = self._manager.address(name).channel
            self._manager.device(name).set_zero(channel, state.position)

    def _mark(self, number: int, state: StepState, note: str) -> None:
        steps = list(self._report.steps)
        steps[number] = replace(steps[number], state=state, note=note)
        self._publish(replace(self._report, steps=tuple(steps)))

    def _publish(self, report: SequenceReport) -> None:
        self._report = report
        if self._on_report is not None:
            self._on_report(report)


def confirmed(confirm: Confirm, text: str) -> bool:
    """Return what somebody answers; no where the script that should answer has a mistake."""
    try:
        return confirm(text)
    except Exception:  # it must not end the thread that asks
        logger.exception("what should confirm %r failed", text)
        return False


class Asker:
    """Asks somebody who answers later, in another thread: the window.

    `ask` is a `Confirm`; it ends with no when motion is stopped or the run cancelled meanwhile.

    Parameters
    ----------
    is_over : callable
        Returns True when nobody needs the answer any more.
    """

    def __init__(self, is_over: Callable[[], bool]) -> None:
        self._is_over = is_over
        self._answered = Event()
        self._agreed = False

    def ask(self, _text: str) -> bool:
        """Wait for the answer."""
        self._answered.clear()
        self._agreed = False
        while not self._answered.wait(POLL_S):
            if self._is_over():
                return False
        return self._agreed

    def answer(self, agreed: bool) -> None:
        """Give the answer; any thread."""
        self._agreed = agreed
        self._answered.set()


def _explained(error: CosmicError, where: str) -> CosmicError:
    """Return `error` with the step it ended, and with what to do about it."""
    if isinstance(error, MoveRefused):
        remedy = _BY_REASON.get(error.verdict.reason, "see what the message says")
        text = f"{where}: {error}. To do: {remedy}, {_AGAIN}"
        return refusal(replace(error.verdict, text=text))
    if isinstance(error, DeviceError):
        remedy = _BY_FAULT.get(error.fault, "see what is wrong with it")
        text = f"{where}: {error}. To do: {remedy}, {_AGAIN}"
        return DeviceError(
            text, fault=error.fault, code=error.code, device=error.device, channel=error.channel
        )
    if isinstance(error, MoveCancelled):
        return MoveCancelled(f"{where}: {error}")
    return CosmicError(f"{where}: {error}. To do: remove the cause, {_AGAIN}")
