"""Records what becomes of the fibres of a campaign, while they are treated."""

import math
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from threading import Lock
from typing import Final

import numpy as np

from cosmic.autonomy.campaign.records import (
    FIBRE,
    NOT_TRUSTED,
    STANDARD,
    CalibrationNote,
    FibreImage,
    FibreRecord,
    OperationRecord,
    Outcome,
    Pose,
    Series,
    Shape,
    Sighting,
    Value,
)
from cosmic.autonomy.campaign.resume import FELL, DroppedFibre, KnownFibre, ResumePlan
from cosmic.autonomy.campaign.statistics import CampaignProgress, progress
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.handling.plate import Candidate, Reach
from cosmic.autonomy.handling.prepare import is_known
from cosmic.autonomy.handling.put_away import ToBin
from cosmic.autonomy.handling.survey import sighted
from cosmic.autonomy.procedures.times import OperationTimes
from cosmic.autonomy.procedures.tree import ENDS, OPERATION, NodeEvent, NodeState
from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.core.chunk import DataChunk
from cosmic.frame.clock import Clock
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.motion.positioner import PositionerState
from cosmic.vico.core.image import CameraImage


class Journal:
    """Lines of the journal with the time and the held fibre; any thread.

    Attributes
    ----------
    fibre : int or None
        The fibre in treatment.
    """

    def __init__(self, store: CampaignStore, now_s: Callable[[], float]) -> None:
        self.fibre: int | None = None
        self._store = store
        self._now_s = now_s

    def note(self, operation: str, phase: str, **payload: Value) -> None:
        """Write what is about to happen, such as `note("descend", "move", left_z_um=-850.0)`.

        Raises
        ------
        CampaignError
            It cannot be written: then it must not be done.
        """
        self._store.note(operation, phase, payload, time_s=self._now_s(), fibre=self.fibre)


MOST: Final = 20_000
"""Values that are kept of one series; of a longer one the begin is kept."""
LEAST_CHANGE: Final = 0.05
"""In the unit of the axis: what an axis that stands may seem to move."""


class MotionLog:
    """Keeps what axes and force did since the time given to `begin`; any thread.

    Positions are gate coordinates, in um or degrees, at the times they were read; the force is the
    mean of each chunk.
    """

    def __init__(self, mico: Mico, daqco: Daqco, channel: str, clock: Clock) -> None:
        self._channel = channel
        self._clock = clock
        self._lock = Lock()
        self._units = {axis.key: str(axis.unit) for axis in mico}
        self._force_unit = daqco.units[channel]
        self._kept: dict[str, list[tuple[float, float]]] = {}
        self._last: dict[str, float] = {}
        self._forget: list[Callable[[], None]] = [axis.subscribe(self._take) for axis in mico]
        self._forget.append(daqco.subscribe(self._feel))

    def close(self) -> None:
        """Listen no longer; harmless the second time."""
        forget, self._forget = self._forget, []
        for each in forget:
            each()

    def begin(self, since_s: float) -> None:
        """Forget what was before a time, but for where the axes stood then."""
        with self._lock:
            axes = {name: [(since_s, value)] for name, value in self._last.items()}
            kept = {name: _since(values, since_s) for name, values in self._kept.items()}
            self._kept = axes | kept

    def series(
        self, since_s: float = -math.inf, *, felt_s: tuple[float, float] | None = None
    ) -> tuple[Series, ...]:
        """Return what was kept since a time.

        Parameters
        ----------
        felt_s : (float, float), optional
            From when until when the force is wanted.
        """
        low_s, high_s = felt_s or (-math.inf, math.inf)
        with self._lock:
            kept = {name: _since(values, since_s) for name, values in self._kept.items()}
        force = kept.pop(self._channel, [])
        kept[self._channel] = [each for each in force if low_s <= each[0] <= high_s]
        return tuple(
            Series(
                name,
                self._units.get(name, self._force_unit),
                np.array([time_s for time_s, _ in values]),
                np.array([value for _, value in values]),
            )
            for name, values in kept.items()
            if values
        )

    def _take(self, state: PositionerState) -> None:
        if state.position is None:
            return
        before = self._last.get(state.name)
        if before is not None and abs(state.position - before) < LEAST_CHANGE:
            return
        self._last[state.name] = state.position
        self._keep(state.name, self._clock.now_s(), state.position)

    def _feel(self, chunk: DataChunk) -> None:
        if self._channel not in chunk.channels:
            return  # renamed, or switched off: whoever needs the force says so
        values = chunk.values[chunk.channels.index(self._channel)]
        self._keep(self._channel, chunk.end_time_s, float(values.mean()))

    def _keep(self, name: str, time_s: float, value: float) -> None:
        with self._lock:
            values = self._kept.setdefault(name, [])
            if len(values) < MOST:
                values.append((time_s, value))


def _since(values: list[tuple[float, float]], since_s: float) -> list[tuple[float, float]]:
    """Return the values from a time on, the one that held at that time first."""
    first = bisect_left(values, since_s, key=lambda each: each[0])
    if first == 0:
        return list(values)
    return [(since_s, values[first - 1][1]), *values[first:]]


GEOMETRY: Final = "geometry"
ROOM_PX: Final = 40


def pose_of(candidate: Candidate) -> Pose:
    """Return where a fibre lies on the plate, turned with the line through its ends."""
    x, y = candidate.position_um
    (x0, y0), (x1, y1) = candidate.line_um[0].tolist(), candidate.line_um[-1].tolist()
    return Pose(x, y, math.degrees(math.atan2(y1 - y0, x1 - x0)))


def felt_s(fibre: HeldFibre) -> tuple[float, float] | None:
    """Return from when until when the force was that of this fibre; None: all the time.

    Of two arms one has the probe, and its fibre the force.
    """
    if not fibre.arm:
        return None
    if fibre.probe_from_s is None:
        return math.inf, math.inf
    return fibre.probe_from_s, fibre.probe_until_s or math.inf


def operations_of(events: Sequence[NodeEvent]) -> tuple[OperationRecord, ...]:
    """Return the tries of operations that have ended, in their order."""
    return tuple(
        OperationRecord(
            name=each.name,
            began_s=each.started_s,
            ended_s=each.ended_s,
            attempt=each.attempt,
            cause=each.cause,
            text=each.text,
        )
        for each in events
        if each.kind == OPERATION
        and each.state in ENDS
        and each.started_s is not None
        and each.ended_s is not None
    )


def record_of(
    fibre: HeldFibre,
    number: int,
    *,
    ended_s: float,
    measures: bool,
    images: bool,
    events: Sequence[NodeEvent],
    series: tuple[Series, ...],
    interrupted: str = "",
    elapsed_s: float = math.nan,
) -> FibreRecord:
    """Return the record of a fibre whose treatment has ended.

    Parameters
    ----------
    number : int
        As the store gave it.
    ended_s : float
        On the platform's clock, for a fibre that does not know.
    measures : bool
        The procedure measures: without a result the fibre is no good one.
    images : bool
        Keep its images.
    interrupted : str
        Why the treatment was cut off; empty when it was not.
    elapsed_s : float
        When it was found, since the campaign began.
    """
    outcome, cause, text = _outcome(fibre, measures=measures, interrupted=interrupted)
    return FibreRecord(
        number=number,
        outcome=outcome,
        began_s=fibre.found_s,
        ended_s=fibre.done_s or ended_s,
        found=pose_of(fibre.reach.candidate),
        shape=_shape_of(fibre),
        cause=cause,
        text=text,
        attempts=max(fibre.tries, 1),
        peak_force_un=fibre.peak_un,
        bending=fibre.bending,
        spans=tuple(fibre.spans),
        images=tuple(
            _image(name, each, _region_px(fibre, each) if name == GEOMETRY else None)
            for name, each in fibre.images.items()
        )
        if images
        else (),
        operations=operations_of(events),
        series=series,
        role=STANDARD if fibre.standard else FIBRE,
        elapsed_s=elapsed_s,
    )


def _shape_of(fibre: HeldFibre) -> Shape:
    return Shape(
        length_um=fibre.length_um,
        length_std_um=fibre.length_std_um,
        width_um=fibre.width_um,
        width_std_um=fibre.width_std_um,
        curl=fibre.curl,
        curl_std=fibre.curl_std,
        probability=fibre.probability,
    )


def _outcome(fibre: HeldFibre, *, measures: bool, interrupted: str) -> tuple[Outcome, str, str]:
    if interrupted:
        return Outcome.INTERRUPTED, "interrupted", interrupted
    if fibre.failure is not None:
        doubtful = fibre.bending is not None
        outcome = Outcome.DOUBTFUL if doubtful else Outcome.FAILED
        return outcome, fibre.failure.cause, fibre.failure.text
    if measures and (fibre.bending is None or not fibre.bending.trusted):
        reasons = "; ".join(fibre.bending.reasons) if fibre.bending is not None else "no result"
        return Outcome.DOUBTFUL, NOT_TRUSTED, reasons
    return Outcome.GOOD, "", ""


def _image(
    name: str, taken: CameraImage, region_px: tuple[int, int, int, int] | None
) -> FibreImage:
    def known(value: float | None) -> float:
        return math.nan if value is None else value

    now = taken.circumstances
    return FibreImage(
        name=name,
        pixels=taken.data,
        taken_s=taken.frame.exposed_s,
        scale_um_px=known(now.scale_um_px),
        zoom=known(now.zoom_counts),
        focus_um=math.nan,
        light_percent=known(now.light_percent),
        region_px=region_px,
    )


def _region_px(fibre: HeldFibre, taken: CameraImage) -> tuple[int, int, int, int] | None:
    """Return the part of an image with the fibre in it, with room around it."""
    line = fibre.line_px
    if line is None:
        return None
    height, width = taken.data.shape[:2]
    low = np.clip(np.floor(line.min(axis=0)) - ROOM_PX, 0, None).astype(int)
    high = np.ceil(line.max(axis=0)).astype(int) + ROOM_PX
    right, bottom = min(int(high[0]), width), min(int(high[1]), height)
    return int(low[0]), int(low[1]), right - int(low[0]), bottom - int(low[1])


_POINTS: Final = 5


@dataclass(frozen=True, slots=True, eq=False)
class TreatedFibre:
    """A fibre whose treatment has begun and has not been kept yet, with its number."""

    fibre: HeldFibre
    number: int


class FibreRecorder:
    """Writes journal and records of one campaign; belongs to the campaign's thread.

    Parameters
    ----------
    measures : bool
        The procedure measures: a fibre without a result is no good one.
    images : bool
        Keep the images.

    Attributes
    ----------
    plate : int
        The one that is there, from 1 on.
    worked_off : int
        Plates on which no fibre is left that can be taken.
    """

    def __init__(
        self, work: HandlingContext, store: CampaignStore, *, measures: bool, images: bool
    ) -> None:
        self.store = store
        self.plate = 1
        self.worked_off = 0
        self.times = OperationTimes()
        self.fibres: tuple[FibreRecord, ...] = store.reader.fibres()
        self._work = work
        self._measures = measures
        self._images = images
        self._journal = Journal(store, work.clock.now_s)
        self._motion = MotionLog(work.mico, work.daqco, work.settings.push.channel, work.clock)
        self._before_s = store.reader.elapsed_s()
        self._began_s = work.clock.now_s()
        self._ended_s: float | None = None
        self._events: dict[str, list[NodeEvent]] = {}
        self._begun: dict[str, HeldFibre] = {}
        self._in_work: tuple[TreatedFibre, ...] = ()
        self._counted: tuple[tuple[FibreRecord, ...], CampaignProgress] | None = None
        self._first_open = 1  # the number from which on records may still change
        self._surveys = 0
        self._sighted = {each.plate for each in store.reader.sightings()}

    def progress(self) -> CampaignProgress:
        """Return how the campaign stands; any thread."""
        now_s = self._work.clock.now_s() if self._ended_s is None else self._ended_s
        elapsed_s = self._before_s + now_s - self._began_s
        fibres, plates = self.fibres, self.worked_off
        counted = self._counted
        # Asked for ten times a second: of hundreds of fibres only the time is another each time.
        if counted is None or counted[0] is not fibres or counted[1].plates != plates:
            counted = self._counted = fibres, progress(fibres, elapsed_s, plates)
        return replace(counted[1], elapsed_s=elapsed_s)

    @property
    def in_work(self) -> tuple[HeldFibre, ...]:
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
        self._keep_sightings()
        self._begin_fibres()
        if event.kind == OPERATION and event.state is NodeState.RUNNING:
            self._journal.fibre = self._number_of(event.role)
            self._journal.note(event.name, "begins", attempt=event.attempt)

    def _number_of(self, role: str) -> int | None:
        return next((each.number for each in self._in_work if each.fibre.arm == role), None)

    def _keep_sightings(self) -> None:
        if self._surveys == self._work.shared.surveys:
            return
        self._surveys = self._work.shared.surveys
        if self.plate in self._sighted:
            return
        self._sighted.add(self.plate)
        self.store.keep_sightings(
            self.plate, [_sighting(self.plate, each) for each in sighted(self._work)]
        )

    def _begin_fibres(self) -> None:
        for arm in self._work.arms:
            fibre = arm.fibre
            if fibre is None or fibre is self._begun.get(fibre.arm):
                continue
            self._begun[fibre.arm] = fibre
            self._motion.begin(min([fibre.found_s, *(each.found_s for each in self.in_work)]))
            candidate = fibre.reach.candidate
            number = self.store.begin_fibre(
                pose_of(candidate),
                time_s=fibre.found_s,
                length_um=candidate.length_um,
                role=STANDARD if fibre.standard else FIBRE,
                plate=self.plate,
            )
            self._in_work = (*self._in_work, TreatedFibre(fibre, number))

    def record(self, fibre: HeldFibre | None, interrupted: str = "") -> None:
        """Write the record of a fibre; without effect for one that was not begun, or is kept."""
        found = next((each for each in self._in_work if each.fibre is fibre), None)
        if found is None or fibre is None:
            return
        if any(each is fibre for each in self._work.shared.dropped):
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
                images=self._images,
                events=self._events.get(fibre.arm, ()),
                series=self._motion.series(fibre.found_s, felt_s=felt_s(fibre)),
                interrupted=interrupted,
                elapsed_s=self._before_s + fibre.found_s - self._began_s,
            )
        )
        in_work, self._in_work = (
            self._in_work,
            tuple(each for each in self._in_work if each is not found),
        )
        self._journal.fibre = None
        self._events.pop(fibre.arm, None)
        fibre.images.clear()
        # Of hundreds only the last ones can have changed.
        self._read_from(self._first_open)
        self._first_open = min(each.number for each in in_work)

    def read_again(self) -> None:
        """Take the fibres as their final analysis has them."""
        self._read_from(1)

    def _read_from(self, first: int) -> None:
        before = (each for each in self.fibres if each.number < first)
        self.fibres = *before, *self.store.reader.fibres(first=first)

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
                    f"{name}, {arm.gripper.shown}" if self._work.beside_another else name,
                    each.residual,
                    each.unit,
                    _made_words(arm, name) or f"{began} + {each.time_s:.0f} s",
                    self._ended_s - each.time_s,
                )
                for arm in self._work.arms
                for name, each in arm.calibration.made.items()
            ]
        )
        self.store.end(reason, time_s=self._ended_s)


def _sighting(plate: int, candidate: Candidate) -> Sighting:
    x, y = candidate.position_um
    return Sighting(
        plate, x, y, candidate.length_um, candidate.width_um, candidate.curl, candidate.problem
    )


def _made_words(work: HandlingContext, name: str) -> str:
    """Return when and how a calibration was made, as the registry has it; empty: it has it not."""
    entry = work.calibration.registry.get(name, work.gripper.name)
    if entry is None:
        return ""
    held = f", seen to hold {_date(entry.checked)}" if entry.checked is not None else ""
    return f"{_date(entry.made)}{held}{f', {entry.how}' if entry.how else ''}"


def _date(when: datetime) -> str:
    return when.astimezone().isoformat(sep=" ", timespec="minutes")


def skip_known(work: HandlingContext, plan: ResumePlan) -> None:
    """Have the fibres that were treated before left alone where they are found again.

    After an end without warning no position is believed: the platform is initialised first. So it
    is where a stop left an axis without a known position.
    """
    work.shared.needs_initialisation = plan.cut_off or not is_known(work)
    work.shared.skipped += [_as_candidate(each) for each in plan.known]
    work.shared.dropped += [_as_dropped(each) for each in plan.fallen]


def _as_dropped(fallen: DroppedFibre) -> HeldFibre:
    line = np.array([[0.0, 0.0], [fallen.length_um, 0.0]])
    candidate = Candidate(line, fallen.length_um, fallen.width_um, fallen.curl, 0.0)
    return HeldFibre(fallen.number, Reach(candidate, 0.0, line, (0.0, 0.0)))


def _as_candidate(known: KnownFibre) -> Candidate:
    angle = np.radians(known.pose.angle_deg)
    along: Sequence[float] = np.linspace(-0.5, 0.5, _POINTS).tolist()
    middle = np.array([known.pose.x_plate_um, known.pose.y_plate_um])
    line = middle + np.outer(along, known.length_um * np.array([np.cos(angle), np.sin(angle)]))
    return Candidate(line, known.length_um, 0.0, 0.0, 0.0)
