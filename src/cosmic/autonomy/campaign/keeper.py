"""Keeps what becomes of the fibres of a campaign, while they are treated."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Final

import numpy as np

from cosmic.autonomy.campaign.fibre_notes import felt_s, pose_of, record_of
from cosmic.autonomy.campaign.journal import FELL, Journal
from cosmic.autonomy.campaign.motion_log import MotionLog
from cosmic.autonomy.campaign.records import CalibrationNote, FibreRecord
from cosmic.autonomy.campaign.resume import Fallen, Known, ResumePlan
from cosmic.autonomy.campaign.statistics import CampaignProgress, progress
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.handling.plate import Candidate, Reach
from cosmic.autonomy.handling.put_away import ToBin
from cosmic.autonomy.handling.work import FibreInHand, FibreWork
from cosmic.autonomy.procedures.times import OperationTimes
from cosmic.autonomy.procedures.tree import OPERATION, NodeEvent, NodeState

_POINTS: Final = 5


@dataclass(frozen=True, slots=True, eq=False)
class InWork:
    """A fibre whose treatment has begun and has not been kept yet, with its number."""

    fibre: FibreInHand
    number: int


class Keeper:
    """Writes journal and records of one campaign; belongs to the campaign's thread.

    Parameters
    ----------
    measures : bool
        The procedure measures: a fibre without a result is no good one.
    pictures : bool
        Keep the pictures.
    """

    def __init__(
        self, work: FibreWork, store: CampaignStore, *, measures: bool, pictures: bool
    ) -> None:
        self.store = store
        self.times = OperationTimes()
        self.fibres: tuple[FibreRecord, ...] = store.reader.fibres()
        self._work = work
        self._measures = measures
        self._pictures = pictures
        self._journal = Journal(store, work.clock.now_s)
        self._motion = MotionLog(work.mico, work.daqco, work.settings.push.channel, work.clock)
        self._before_s = store.reader.elapsed_s()
        self._began_s = work.clock.now_s()
        self._ended_s: float | None = None
        self._events: dict[str, list[NodeEvent]] = {}
        self._begun: dict[str, FibreInHand] = {}
        self._in_work: tuple[InWork, ...] = ()

    def progress(self) -> CampaignProgress:
        """Return how the campaign stands; any thread."""
        now_s = self._work.clock.now_s() if self._ended_s is None else self._ended_s
        elapsed_s = self._before_s + now_s - self._began_s
        return progress(self.fibres, elapsed_s)

    @property
    def in_work(self) -> tuple[FibreInHand, ...]:
        """Fibres whose treatment has begun and has not been kept yet; any thread."""
        return tuple(each.fibre for each in self._in_work)

    def begin_run(self) -> None:
        """Forget the events of the fibre before."""
        self._events = {}

    def note(self, event: NodeEvent) -> None:
        """Take what happened to a part of the procedure; in the run's thread.

        Raises
        ------
        CampaignError
            It cannot be written: then nothing more may be done.
        """
        self._events.setdefault(event.role, []).append(event)
        self.times.note(event)
        self._begin_fibres()
        if event.kind == OPERATION and event.state is NodeState.RUNNING:
            self._journal.fibre = self._number_of(event.role)
            self._journal.note(event.name, "begins", attempt=event.attempt)

    def _number_of(self, role: str) -> int | None:
        return next((each.number for each in self._in_work if each.fibre.hand == role), None)

    def _begin_fibres(self) -> None:
        for hand in self._work.hands:
            fibre = hand.fibre
            if fibre is None or fibre is self._begun.get(fibre.hand):
                continue
            self._begun[fibre.hand] = fibre
            self._motion.begin(min([fibre.found_s, *(each.found_s for each in self.in_work)]))
            candidate = fibre.reach.candidate
            number = self.store.begin_fibre(
                pose_of(candidate), time_s=fibre.found_s, length_um=candidate.length_um
            )
            self._in_work = (*self._in_work, InWork(fibre, number))

    def keep(self, fibre: FibreInHand | None, interrupted: str = "") -> None:
        """Write the record of a fibre; without effect for one that was not begun, or is kept."""
        found = next((each for each in self._in_work if each.fibre is fibre), None)
        if found is None or fibre is None:
            return
        if any(each is fibre for each in self._work.spilled):
            self._journal.fibre = found.number
            self._journal.note(
                ToBin.name,
                FELL,
                length_um=fibre.length_um,
                width_um=fibre.width_um,
                curl=fibre.curl,
            )
        self.store.finish_fibre(
            record_of(
                fibre,
                found.number,
                ended_s=self._work.clock.now_s(),
                measures=self._measures,
                pictures=self._pictures,
                events=self._events.get(fibre.hand, ()),
                series=self._motion.series(fibre.found_s, felt_s=felt_s(fibre)),
                interrupted=interrupted,
            )
        )
        self._in_work = tuple(each for each in self._in_work if each is not found)
        self._journal.fibre = None
        self._events.pop(fibre.hand, None)
        fibre.pictures.clear()
        self.fibres = self.store.reader.fibres()

    def close(self, reason: str) -> None:
        """Write the calibrations and why the campaign ended.

        Raises
        ------
        CampaignError
            It cannot be written.
        """
        self._ended_s = self._work.clock.now_s()
        self._motion.close()
        began = self.store.reader.info().started
        self.store.keep_calibrations(
            [
                CalibrationNote(
                    f"{name}, {hand.gripper.shown}" if self._work.beside_another else name,
                    each.residual,
                    each.unit,
                    _made(hand, name) or f"{began} + {each.time_s:.0f} s",
                )
                for hand in self._work.hands
                for name, each in hand.calibration.made.items()
            ]
        )
        self.store.end(reason, time_s=self._ended_s)


def _made(work: FibreWork, name: str) -> str:
    """Return when and how a calibration was made, as the book has it; empty: it has it not."""
    entry = work.calibration.book.get(name, work.gripper.name)
    if entry is None:
        return ""
    held = f", seen to hold {_date(entry.checked)}" if entry.checked is not None else ""
    return f"{_date(entry.made)}{held}{f', {entry.how}' if entry.how else ''}"


def _date(when: datetime) -> str:
    return when.astimezone().isoformat(sep=" ", timespec="minutes")


def skip_known(work: FibreWork, plan: ResumePlan) -> None:
    """Have the fibres that were treated before left alone where they are found again.

    After an end without warning no position is believed: the platform is initialised first.
    """
    work.distrusted = plan.cut_off
    work.given_up += [_as_candidate(each) for each in plan.known]
    work.spilled += [_as_spilled(each) for each in plan.fallen]


def _as_spilled(fallen: Fallen) -> FibreInHand:
    line = np.array([[0.0, 0.0], [fallen.length_um, 0.0]])
    candidate = Candidate(line, fallen.length_um, fallen.width_um, fallen.curl, 0.0)
    return FibreInHand(fallen.number, Reach(candidate, 0.0, line, (0.0, 0.0)))


def _as_candidate(known: Known) -> Candidate:
    angle = np.radians(known.pose.angle_deg)
    along: Sequence[float] = np.linspace(-0.5, 0.5, _POINTS).tolist()
    middle = np.array([known.pose.x_plate_um, known.pose.y_plate_um])
    line = middle + np.outer(along, known.length_um * np.array([np.cos(angle), np.sin(angle)]))
    return Candidate(line, known.length_um, 0.0, 0.0, 0.0)
