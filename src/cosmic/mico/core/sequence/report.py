"""How far the initialisation sequence is, as frozen data for whoever shows it."""

from dataclasses import dataclass
from enum import StrEnum


class StepState(StrEnum):
    """What became of a step."""

    WAITING = "waiting"
    RUNNING = "running"
    DONE = "done"
    SKIPPED = "skipped"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class StepReport:
    """One step: what it does, what became of it, and what there is to say about that."""

    title: str
    state: StepState
    note: str = ""


@dataclass(frozen=True, slots=True)
class SequenceReport:
    """All steps of a sequence in their order.

    Attributes
    ----------
    question : str
        What the operator is asked; empty while nobody is asked anything.
    """

    steps: tuple[StepReport, ...]
    question: str = ""

    @property
    def running(self) -> int | None:
        """Place of the step that is carried out; None while there is none."""
        states = (each.state for each in self.steps)
        return next((n for n, state in enumerate(states) if state is StepState.RUNNING), None)
