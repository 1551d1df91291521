"""What exported samples are written into: CSV and TDMS."""

import csv
import math
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from datetime import timedelta
from importlib import import_module
from pathlib import Path
from typing import Any, Final, Protocol

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from cosmic.daqco.api.recording import Recording
from cosmic.frame.errors import NotAvailable, needs_extra

# Formatting holds the interpreter, and the force limit must not wait for it.
CSV_VALUES_AT_ONCE: Final = 4096

Values = npt.NDArray[np.float64]
Lines = list[Sequence[object]]


class Target(Protocol):
    """A file that takes samples block by block; made with the recording and a path."""

    def __init__(self, recording: Recording, path: Path) -> None: ...

    @abstractmethod
    def write(self, block: Sequence[Values]) -> None:
        """Write times and the values of every channel, all of one length."""

    @abstractmethod
    def finish(self) -> None:
        """Write what comes after the samples."""

    @abstractmethod
    def close(self) -> None:
        """Close the file."""


class CsvTarget(Target):
    """A line of names with units, then a line a sample."""

    def __init__(self, recording: Recording, path: Path) -> None:
        self._file = path.open("w", newline="", encoding="utf-8")
        columns = ["time_s", *(f"{name}_{unit}" for name, unit in recording.units.items())]
        csv.writer(self._file, lineterminator="\n").writerow(columns)
        self._line = ",".join(["%.7f", *["%.9g"] * len(recording.channels)]) + "\n"
        self._lines_at_once = max(1, CSV_VALUES_AT_ONCE // len(columns))

    @override
    def write(self, block: Sequence[Values]) -> None:
        rows = np.stack(block, axis=1)
        for at in range(0, len(rows), self._lines_at_once):
            part = rows[at : at + self._lines_at_once]
            self._file.write(self._line * len(part) % tuple(part.ravel().tolist()))

    @override
    def finish(self) -> None:
        """Positions and events are files of their own."""

    @override
    def close(self) -> None:
        self._file.close()


def _load_tdms() -> Any:
    try:
        return import_module("nptdms")
    except ImportError as exc:
        raise NotAvailable(needs_extra("Export to TDMS", "tdms")) from exc


class TdmsTarget(Target):
    """Groups ``samples``, ``positions`` and ``events``; raises `NotAvailable` without npTDMS."""

    def __init__(self, recording: Recording, path: Path) -> None:
        self._recording = recording
        self._names = ("time_s", *recording.channels)
        self._properties = [{"unit_string": "s"}, *_channel_properties(recording)]
        self._tdms = _load_tdms()
        self._file = path.open("wb")
        self._writer = self._tdms.TdmsWriter(self._file)
        self._writer.open()
        self._writer.write_segment([self._tdms.RootObject(_root_properties(recording))])

    @override
    def write(self, block: Sequence[Values]) -> None:
        self._writer.write_segment(
            [
                self._tdms.ChannelObject("samples", name, data, properties)
                for name, data, properties in zip(self._names, block, self._properties, strict=True)
            ]
        )

    @override
    def finish(self) -> None:
        for group, lines in (
            ("positions", position_lines(self._recording)),
            ("events", event_lines(self._recording)),
        ):
            if len(lines) > 1:
                columns = zip(lines[0], zip(*lines[1:], strict=True), strict=True)
                self._writer.write_segment(
                    [
                        self._tdms.ChannelObject(group, str(name), _tdms_data(data))
                        for name, data in columns
                    ]
                )

    @override
    def close(self) -> None:
        self._writer.close()
        self._file.close()


def position_lines(recording: Recording) -> Lines:
    """Return positions of all axes as a table, its first line the names of the columns."""
    lines: Lines = [("time_s", "axis", "position", "unit", "confidence")]
    for axis, unit in recording.axes.items():
        rows = zip(*(each.tolist() for each in recording.positions(axis)), strict=True)
        lines += [(time_s, axis, there, unit, known) for time_s, there, known in rows]
    return lines


def event_lines(recording: Recording) -> Lines:
    """Return events and overruns as a table, its first line the names of the columns."""
    lines: Lines = [("time_s", "sample", "kind", "channel", "value", "text")]
    lines += [
        (each.time_s, each.sample, each.kind, each.channel, each.value, each.text)
        for each in recording.events
    ]
    lines += [
        (
            each.time_s,
            each.sample,
            "overrun",
            "",
            float(each.lost),
            f"samples lost before this one, number {each.column} of the recording from 0",
        )
        for each in recording.overruns
    ]
    return lines


def _tdms_data(column: Iterable[object]) -> "list[str] | npt.NDArray[np.generic]":
    data = list(column)
    return [str(each) for each in data] if isinstance(data[0], str) else np.array(data)


def _root_properties(recording: Recording) -> dict[str, object]:
    return {
        "name": recording.path.stem,
        "software": recording.software,
        "complete": recording.complete,
        "rate_hz": recording.rate_hz,
        "start_utc": recording.start_utc.isoformat(),
        "start_s": recording.start_s,
    }


def _channel_properties(recording: Recording) -> list[dict[str, object]]:
    shared: dict[str, object] = {}
    if recording.samples and not recording.overruns:  # a waveform has no gaps
        into_s = float(recording.block(0, 1)[0][0]) - recording.start_s
        begin = recording.start_utc + timedelta(seconds=into_s if math.isfinite(into_s) else 0.0)
        shared = {
            "wf_start_time": np.datetime64(begin.replace(tzinfo=None), "us"),
            "wf_start_offset": 0.0,
            "wf_increment": 1.0 / recording.rate_hz,
        }
    return [
        {"unit_string": recording.units[name], "colour": recording.colours[name], **shared}
        for name in recording.channels
    ]
