"""`open_recording`: reads a recording, finished, running or killed, in physical values."""

import os
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import numpy as np
import numpy.typing as npt

from cosmic.daqco.core import recording_format as form
from cosmic.daqco.core.curves import Slope, fit_slope
from cosmic.daqco.core.recording_format import Overrun, RecordedEvent, RecordedExposure
from cosmic.daqco.core.recording_source import Columns, RecordingSource
from cosmic.daqco.core.scale import Scale
from cosmic.frame.arguments import checked, checked_class
from cosmic.frame.errors import RecordingError

Values = npt.NDArray[np.float64]
_CONFIDENCE: Final = {number: word for word, number in form.CONFIDENCES.items()}


@checked
def open_recording(path: "str | os.PathLike[str]") -> "Recording":
    """Open a recording, finished, running or left by a killed process; use it with ``with``.

    Raises
    ------
    RecordingError
        There is no such file, it is no recording, or it is damaged.
    """
    return Recording(Path(path))


@checked_class
class Recording:
    """What was recorded. All times are seconds of the platform's clock. One thread.

    Samples are read when asked for: ``start_s`` and ``end_s`` (the latter not included) choose a
    part, so that a long recording need not fit into memory.
    """

    def __init__(self, path: Path) -> None:
        self._source = RecordingSource(path)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Give the file back; harmless the second time."""
        self._source.close()

    def refresh(self) -> None:
        """Look again at a file that is still being written."""
        self._source.refresh()

    @property
    def path(self) -> Path:
        """Where it lies."""
        return self._source.path

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels."""
        return self._source.names

    @property
    def units(self) -> dict[str, str]:
        """Unit of each channel's values, by name; "uN|mN" where it was changed on the way."""
        return {
            name: "|".join(dict.fromkeys(scale.unit for scale in scales))
            for name, scales in self.scales.items()
        }

    @property
    def colours(self) -> dict[str, str]:
        """Colour of each channel, "#RRGGBB"."""
        return self._column("colour")

    @property
    def inputs(self) -> dict[str, str]:
        """Input of each channel, such as "Dev1/ai0"."""
        boards, inputs = self._column("board"), self._column("input")
        return {name: f"{boards[name]}/{inputs[name]}" for name in self.channels}

    @property
    def ranges_v(self) -> dict[str, tuple[float, float]]:
        """Voltages expected at each channel, low and high."""
        rows = self._source.channels
        pairs = zip(rows["low_v"].tolist(), rows["high_v"].tolist(), strict=True)
        return dict(zip(self.channels, pairs, strict=True))

    @property
    def rate_hz(self) -> float:
        """Samples per second and channel."""
        return self._source.rate_hz

    @property
    def samples(self) -> int:
        """How many samples each channel has."""
        return self._source.samples

    @property
    def complete(self) -> bool:
        """True when it was closed in order: neither running, nor ended by an error or a kill."""
        return self._source.complete

    @property
    def software(self) -> str:
        """Which program wrote it."""
        return str(self._source.attributes["software"])

    @property
    def configuration(self) -> str:
        """The platform file in force, as text."""
        return self._source.configuration

    @property
    def start_utc(self) -> datetime:
        """When it was begun; the same moment as `start_s`."""
        return datetime.fromisoformat(str(self._source.attributes["start_utc"]))

    @property
    def start_s(self) -> float:
        """When it was begun, platform time."""
        return float(self._source.attributes["start_s"])

    @property
    def scales(self) -> dict[str, tuple[Scale, ...]]:
        """Scales of each channel, in the order in which they came into force."""
        found: dict[str, list[Scale]] = {name: [] for name in self.channels}
        for row in self._source.tables["scales"]:
            scale, known = form.scale_of(row), found[self.channels[row["channel"]]]
            if not known or known[-1] != scale:
                known.append(scale)
        return {name: tuple(scales) for name, scales in found.items()}

    @property
    def events(self) -> tuple[RecordedEvent, ...]:
        """What happened meanwhile: limits crossed, marks, errors."""
        return tuple(
            RecordedEvent(
                time_s=float(row["time_s"]),
                sample=int(row["sample"]),
                kind=form.decoded(row["kind"]),
                text=form.decoded(row["text"]),
                channel=form.decoded(row["channel"]),
                value=float(row["value"]),
            )
            for row in self._source.tables["events"]
        )

    @property
    def exposures(self) -> tuple[RecordedExposure, ...]:
        """Exposures of a camera that the sample clock triggered, each with its sample."""
        return tuple(
            RecordedExposure(
                sample=int(row["sample"]),
                time_s=float(row["time_s"]),
                number=int(row["number"]),
                camera=form.decoded(row["camera"]),
            )
            for row in self._source.tables["exposures"]
        )

    @property
    def overruns(self) -> tuple[Overrun, ...]:
        """Where samples are missing."""
        rows = self._source.tables["overruns"]
        placed = "column" in (rows.dtype.names or ())  # files of before lack it
        return tuple(
            Overrun(
                sample=int(row["sample"]),
                lost=int(row["lost"]),
                time_s=(time_s := float(row["time_s"])),
                column=int(row["column"]) if placed else self._source.columns(time_s, None).first,
            )
            for row in rows
        )

    @property
    def axes(self) -> dict[str, str]:
        """Unit of each axis whose positions were recorded, by name."""
        rows = self._source.tables["axes"]
        return {form.decoded(row["name"]): form.decoded(row["unit"]) for row in rows}

    @property
    def time_s(self) -> Values:
        """Time of every sample, shape (n,)."""
        return self.times()

    def times(self, *, start_s: float | None = None, end_s: float | None = None) -> Values:
        """Return the times of samples, shape (n,)."""
        return self._source.times(self._source.columns(start_s, end_s))

    def volts(
        self, channel: str, *, start_s: float | None = None, end_s: float | None = None
    ) -> Values:
        """Return volts as acquired, shape (n,); raises as `values`."""
        row = self._row(channel)
        return self._source.read_volts(row, self._source.columns(start_s, end_s))

    def values(
        self, channel: str, *, start_s: float | None = None, end_s: float | None = None
    ) -> Values:
        """Return physical values, shape (n,), each by the scale in force when it was acquired.

        Raises
        ------
        RecordingError
            There is no such channel, or the file is damaged.
        """
        return self._values(channel, self._source.columns(start_s, end_s))

    def block(self, first: int, last: int) -> list[Values]:
        """Return the times of samples `first` to before `last`, then the values of each channel.

        Counted in the file from 0; for going through a long recording piece by piece.
        """
        columns = Columns(max(0, first), min(last, self.samples))
        values = [self._values(channel, columns) for channel in self.channels]
        return [self._source.times(columns), *values]

    def positions(self, axis: str) -> tuple[Values, Values, npt.NDArray[np.str_]]:
        """Return where an axis was: times, positions in its unit, and how well they were known.

        Times never go back: files from before December 2026 have positions of a moving gripper
        with the time at which the program began.

        Raises
        ------
        RecordingError
            Nothing of this axis was recorded.
        """
        names = list(self.axes)
        if axis not in names:
            known = ", ".join(names) or "none"
            raise RecordingError(f"{self.path}: there is no axis {axis!r}; recorded: {known}")
        rows = self._source.tables["positions"]
        rows = rows[rows["axis"] == names.index(axis)]
        rows = rows[rows["time_s"] >= np.maximum.accumulate(rows["time_s"])]
        words = np.array([_CONFIDENCE.get(each, "unknown") for each in rows["confidence"].tolist()])
        return rows["time_s"].copy(), rows["position"].copy(), words.astype(np.str_)

    def curve(
        self,
        channel: str,
        axis: str,
        *,
        start_s: float | None = None,
        end_s: float | None = None,
    ) -> tuple[Values, Values]:
        """Return positions of `axis` and values of `channel` at the same times, both shape (n,).

        Positions are interpolated between the readings around each sample. Samples before the
        first reading, after the last, or between readings of which one is unknown are left out.

        Raises
        ------
        RecordingError
            There is no such channel or axis.
        """
        columns = self._source.columns(start_s, end_s)
        values, times = self._values(channel, columns), self._source.times(columns)
        when, where, confidence = self.positions(axis)
        where[confidence == "unknown"] = np.nan
        there = np.interp(times, when, where, left=np.nan, right=np.nan)
        known = np.isfinite(there)
        return there[known], values[known]

    def slope(
        self,
        channel: str,
        axis: str,
        *,
        low: float = -np.inf,
        high: float = np.inf,
        start_s: float | None = None,
        end_s: float | None = None,
    ) -> Slope:
        """Return how much `channel` rises per unit of `axis`, such as a stiffness in uN/um.

        Parameters
        ----------
        low, high : float
            Positions of the axis between which the line is fitted.

        Raises
        ------
        RecordingError
            There is no such channel or axis, or too few samples or too short a way between
            `low` and `high`.
        """
        there, values = self.curve(channel, axis, start_s=start_s, end_s=end_s)
        inside = (low <= there) & (there <= high)
        unit = f"{self.units[channel]}/{self.axes[axis]}"
        return fit_slope(there[inside], values[inside], unit)

    def _values(self, channel: str, columns: Columns) -> Values:
        row = self._row(channel)
        volts = self._source.read_volts(row, columns)
        rows = self._source.tables["scales"]
        rows = rows[rows["channel"] == row]
        scales = {int(each["version"]): form.scale_of(each) for each in rows}
        for version, part in self._source.versions(columns):
            cut = slice(part.first - columns.first, part.last - columns.first)
            volts[cut] = scales[version].apply(volts[cut])
        return volts

    def _row(self, channel: str) -> int:
        if channel not in self.channels:
            raise RecordingError(
                f"{self.path}: there is no channel {channel!r}; "
                f"recorded: {', '.join(self.channels)}"
            )
        return self.channels.index(channel)

    def _column(self, key: str) -> dict[str, str]:
        texts = (form.decoded(each) for each in self._source.channels[key])
        return dict(zip(self.channels, texts, strict=True))
