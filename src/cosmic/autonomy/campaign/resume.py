"""How a campaign goes on after an end without warning."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from cosmic.autonomy.campaign.records import FINISHED, FibreRecord, JournalEntry, Outcome, Pose
from cosmic.autonomy.campaign.store import CampaignStore

FELL: Final = "fell"
"""Phase of a line about a measured fibre that lies on the plate again, nobody knows where."""
JOURNAL_LINES: Final = 20
LOOKS: Final = ("length_um", "width_um", "curl")
SAME_POSITION_UM: Final = 150.0
SAME_LENGTH_PART: Final = 0.05
SAME_ANGLE_DEG: Final = 15.0
MOST_INTERRUPTIONS: Final = 2
"""A fibre in whose treatment the program ended so often is left alone."""


@dataclass(frozen=True, slots=True)
class KnownFibre:
    """A fibre that need not be looked at again, where it was seen last."""

    number: int
    pose: Pose
    length_um: float


@dataclass(frozen=True, slots=True)
class DroppedFibre:
    """A fibre that was measured and fell where nobody saw it: known by what it looks like only."""

    number: int
    length_um: float
    width_um: float
    curl: float


@dataclass(frozen=True, slots=True)
class ResumePlan:
    """What is known after an end without warning.

    No position of before is among it: zero moves when the power goes, and what was held may have
    been dropped. The axes are referenced, jaws are looked at, and the plate is surveyed anew.

    Attributes
    ----------
    finished : int
        Fibres that have their end.
    interrupted : tuple of int
        Fibres that were in treatment: one of them may hang in the jaws.
    known : tuple of KnownFibre
        Fibres to be skipped where they are found again.
    last : tuple of JournalEntry
        What was about to be done, oldest first.
    fallen : tuple of DroppedFibre
        Finished fibres that lie on the plate again; one like each of them is skipped.
    cut_off : bool
        The run before ended without a word, as when the program is killed.
    plate : int
        The one that is there, from 1 on.
    plate_pending : bool
        It was asked for, and nobody knows whether it is there.
    """

    finished: int
    interrupted: tuple[int, ...]
    known: tuple[KnownFibre, ...]
    last: tuple[JournalEntry, ...]
    fallen: tuple[DroppedFibre, ...] = ()
    cut_off: bool = False
    plate: int = 1
    plate_pending: bool = False

    def is_done(self, pose: Pose, length_um: float) -> bool:
        """Return whether the fibre found there has been treated already."""
        return any(_same(each, pose, length_um) for each in self.known)


def resume(store: CampaignStore) -> ResumePlan:
    """Mark what was in treatment as interrupted, and return how to go on.

    Raises
    ------
    CampaignError
        The campaign cannot be read or written.
    """
    interrupted = store.interrupt_running()
    fibres = store.reader.fibres()
    changes = store.reader.plate_changes()
    plate = max((each.plate for each in changes), default=1)
    pending = any(not each.over for each in changes if each.plate == plate)
    here = [each for each in fibres if each.plate == plate]
    return ResumePlan(
        finished=sum(each.outcome in FINISHED for each in fibres),
        interrupted=tuple(interrupted),
        known=_known(here),
        last=store.reader.journal(JOURNAL_LINES),
        fallen=_fallen(here, store.reader.phase(FELL)),
        cut_off=store.reader.cut_off(),
        plate=plate,
        plate_pending=pending,
    )


def _fallen(
    fibres: Sequence[FibreRecord], lines: Sequence[JournalEntry]
) -> tuple[DroppedFibre, ...]:
    """Return the finished ones: what was written before a record that never was counts nothing."""
    finished = {each.number for each in fibres if each.outcome in FINISHED}
    return tuple(
        DroppedFibre(each.fibre, **{name: float(str(each.payload[name])) for name in LOOKS})
        for each in lines
        if each.fibre is not None and each.fibre in finished
    )


def _known(fibres: Sequence[FibreRecord]) -> tuple[KnownFibre, ...]:
    interrupted = [each for each in fibres if each.outcome is Outcome.INTERRUPTED]
    known = []
    for fibre in fibres:
        tried = fibre.outcome in FINISHED or _tries(fibre, interrupted) >= MOST_INTERRUPTIONS
        pose = fibre.left or fibre.found
        if tried and pose is not None:
            known.append(KnownFibre(fibre.number, pose, fibre.shape.length_um))
    return tuple(known)


def _tries(fibre: FibreRecord, interrupted: Sequence[FibreRecord]) -> int:
    """Return how often the treatment of the fibre that lies there was interrupted."""
    if fibre.outcome is not Outcome.INTERRUPTED or fibre.found is None:
        return 0
    known = KnownFibre(fibre.number, fibre.found, fibre.shape.length_um)
    return sum(
        each.found is not None and _same(known, each.found, each.shape.length_um)
        for each in interrupted
    )


def _same(known: KnownFibre, pose: Pose, length_um: float) -> bool:
    away = known.pose.x_plate_um - pose.x_plate_um, known.pose.y_plate_um - pose.y_plate_um
    near = away[0] ** 2 + away[1] ** 2 <= SAME_POSITION_UM**2
    turned = (known.pose.angle_deg - pose.angle_deg + 90.0) % 180.0 - 90.0
    # An interrupted fibre has no length yet: nan differs from nothing.
    differs = abs(known.length_um - length_um) > SAME_LENGTH_PART * length_um
    return near and abs(turned) <= SAME_ANGLE_DEG and not differs
