"""What a report tells, taken from a campaign."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cosmic.autonomy.campaign.records import (
    CalibrationNote,
    CampaignError,
    CampaignInfo,
    FibreRecord,
)
from cosmic.autonomy.campaign.statistics import CampaignProgress, progress
from cosmic.autonomy.campaign.store_read import CampaignReader


@dataclass(frozen=True, slots=True)
class OperationTime:
    """How long an operation takes, over all its tries."""

    name: str
    tries: int
    failed: int
    median_s: float
    p95_s: float
    total_s: float


@dataclass(frozen=True, slots=True)
class ReportData:
    """Everything of a report.

    Attributes
    ----------
    finished : tuple of FibreRecord
        Without curves and pictures.
    whole : callable
        Returns a fibre with them, by its number: they are not all held at once.
    """

    info: CampaignInfo
    ended: tuple[str, str]
    progress: CampaignProgress
    finished: tuple[FibreRecord, ...]
    calibrations: tuple[CalibrationNote, ...]
    operations: tuple[OperationTime, ...]
    whole: Callable[[int], FibreRecord]


def report_data(reader: CampaignReader) -> ReportData:
    """Return what a report tells.

    Raises
    ------
    CampaignError
        The campaign cannot be read.
    """
    reader.check()
    fibres, finished = reader.fibres(), reader.finished()
    return ReportData(
        info=reader.info(),
        ended=reader.ended(),
        progress=progress(fibres, reader.elapsed_s()),
        finished=finished,
        calibrations=reader.calibrations(),
        operations=operation_times(finished),
        whole=lambda number: _whole(reader, number, finished),
    )


def _whole(reader: CampaignReader, number: int, finished: Sequence[FibreRecord]) -> FibreRecord:
    """Return a fibre with what can be read of it: a lost file costs no report."""
    try:
        return reader.fibre(number)
    except CampaignError as exc:
        record = next(each for each in finished if each.number == number)
        return replace(record, text=f"{record.text} {exc}".strip())


def operation_times(fibres: Sequence[FibreRecord]) -> tuple[OperationTime, ...]:
    """Return the time of each operation, in the order of their first appearance."""
    took: dict[str, list[float]] = {}
    failed: dict[str, int] = {}
    for fibre in fibres:
        for each in fibre.operations:
            took.setdefault(each.name, []).append(each.ended_s - each.began_s)
            failed[each.name] = failed.get(each.name, 0) + each.failed
    return tuple(
        OperationTime(
            name=name,
            tries=len(times),
            failed=failed[name],
            median_s=float(np.median(times)),
            p95_s=float(np.quantile(times, 0.95)),
            total_s=float(np.sum(times)),
        )
        for name, times in took.items()
    )
