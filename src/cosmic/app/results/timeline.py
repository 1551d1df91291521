"""One time axis for what was recorded together: force, positions, images, marks and log."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.app.results.session_log import LogLine, log_lines
from cosmic.app.results.sessions import Item, ItemKind
from cosmic.daqco.api.recording import Recording, open_recording
from cosmic.frame.errors import CosmicError, RecordingError
from cosmic.vico.core.recording.reading import ImageRecording, open_image_recording

Values = npt.NDArray[np.float64]

MOST_SAMPLES: Final = 400_000
"""Of a channel, kept in memory; of longer recordings the means of as many pieces."""
BLOCK: Final = 1_000_000
CLOCKS_AGREE_S: Final = 30.0
"""Two recordings were made together where their clocks differ by less from the computer's."""
MOVED: Final = {"um": 0.5, "deg": 0.05}
"""An axis that went less far did not move."""


OUTSIDE_S: Final = 0.5
"""Positions are read some twenty times a second: so long before the first they were the same."""


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """One quantity over time.

    Attributes
    ----------
    time_s, values : ndarray, shape (n,), float64
        Platform time, and values in `unit`; NaN where it was not known. In a long recording each
        is the mean of a piece.
    low, high : ndarray, shape (n,), float64
        Least and largest value of each piece.
    """

    name: str
    unit: str
    time_s: Values
    values: Values
    low: Values
    high: Values
    colour: str = ""

    def at(self, time_s: float) -> float:
        """Return the value at a time, between its neighbours; NaN outside."""
        if not self.time_s.size:
            return float("nan")
        return float(np.interp(time_s, self.time_s, self.values, left=np.nan, right=np.nan))

    def near(self, time_s: float) -> float:
        """Return the value at a time; a moment before the first or after the last it is theirs."""
        if not self.time_s.size:
            return float("nan")
        inside_s = float(np.clip(time_s, self.time_s[0], self.time_s[-1]))
        return self.at(inside_s) if abs(inside_s - time_s) <= OUTSIDE_S else float("nan")

    def between(self, start_s: float, end_s: float) -> tuple[Values, Values]:
        """Return times and values from one time to another, both shape (n,), those known."""
        chosen = (start_s <= self.time_s) & (self.time_s <= end_s) & np.isfinite(self.values)
        return self.time_s[chosen], self.values[chosen]


@dataclass(frozen=True, slots=True)
class Mark:
    """Something that happened while recording: a mark, a note, a limit, an error."""

    time_s: float
    kind: str
    text: str


@dataclass(frozen=True, slots=True, eq=False)
class Film:
    """Recorded images.

    Attributes
    ----------
    path : Path
        Of the side file, or of an image.
    time_s : ndarray, shape (n,), float64
        When each image was complete; NaN where nobody knows.
    """

    path: Path
    camera: str
    time_s: Values
    complete: bool

    def index_at(self, time_s: float) -> int:
        """Return which image was shown at a time: the last one before, or the first."""
        known = np.flatnonzero(np.isfinite(self.time_s))
        if not known.size:
            return 0
        place = int(np.searchsorted(self.time_s[known], time_s + 1e-9, side="right")) - 1
        return int(known[max(0, place)])


@dataclass(frozen=True, slots=True, eq=False)
class Timeline:
    """What was recorded together, on the platform's clock.

    Attributes
    ----------
    path : Path
        The recording that was opened.
    start_s, end_s : float
        First and last moment, platform time.
    start_utc : datetime or None
        The moment `start_s`.
    forces, positions : tuple of Track
        Channels, and axes in gate coordinates.
    complete : bool
        Neither running, nor ended by an error or a kill.
    """

    path: Path
    start_s: float
    end_s: float
    start_utc: datetime | None
    rate_hz: float = 0.0
    forces: tuple[Track, ...] = ()
    positions: tuple[Track, ...] = ()
    marks: tuple[Mark, ...] = ()
    films: tuple[Film, ...] = ()
    log: tuple[LogLine, ...] = field(default=())
    complete: bool = True

    @property
    def moved(self) -> tuple[Track, ...]:
        """The axes that moved meanwhile."""
        return tuple(
            each
            for each in self.positions
            if np.isfinite(each.values).any()
            and float(np.nanmax(each.values) - np.nanmin(each.values)) > MOVED.get(each.unit, 0.0)
        )

    def poses_at(self, time_s: float) -> dict[str, float]:
        """Return where every axis was, by name; those not known are left out."""
        found = {each.name: each.near(time_s) for each in self.positions}
        return {name: value for name, value in found.items() if np.isfinite(value)}


def load_timeline(item: Item, beside: Iterable[Item] = ()) -> Timeline:
    """Read a recording, and the images that were recorded at the same time.

    Takes a while for a long recording: not for the GUI thread. What it opens it closes.

    Parameters
    ----------
    beside : iterable of Item
        Where such images may be.

    Raises
    ------
    RecordingError
        It cannot be read.
    """
    if item.kind is ItemKind.FORCE:
        with open_recording(item.path) as recording:
            return _of_force(recording, [each for each in beside if each.kind is ItemKind.IMAGES])
    if item.kind is ItemKind.IMAGES:
        with open_image_recording(item.path) as images:
            return _of_images(item.path, images)
    if item.kind is ItemKind.IMAGE:
        film = Film(item.path, "", np.array([0.0]), complete=True)
        return Timeline(item.path, 0.0, 0.0, item.changed, films=(film,))
    raise RecordingError(f"{item.path}: a {item.kind} has no time axis")


def _of_force(recording: Recording, sides: Sequence[Item]) -> Timeline:
    samples, start_s = recording.samples, recording.start_s
    forces = _channels(recording)
    times = next((each.time_s for each in forces), np.empty(0))
    first_s = float(times[0]) if times.size else start_s
    end_s = float(times[-1]) if samples else first_s
    start_utc = recording.start_utc + timedelta(seconds=first_s - start_s)
    films = _films_between(sides, first_s, end_s, start_utc)
    whole = recording.complete
    return Timeline(
        path=recording.path,
        start_s=first_s,
        end_s=end_s,
        start_utc=start_utc,
        rate_hz=recording.rate_hz,
        forces=forces,
        positions=tuple(_axis(recording, name, unit) for name, unit in recording.axes.items()),
        marks=tuple(Mark(each.time_s, each.kind, each.text) for each in recording.events),
        films=films,
        log=log_lines(recording.path.parent, first_s, end_s if whole else np.inf, start_utc),
        complete=whole,
    )


def _channels(recording: Recording) -> tuple[Track, ...]:
    """Return all channels; of a long recording least, largest and mean value of each piece."""
    samples, names = recording.samples, recording.channels
    piece = -(-samples // MOST_SAMPLES) if samples > MOST_SAMPLES else 1
    step = max(piece, BLOCK // max(piece, 1) * piece)
    blocks = [
        [_reduced(row, piece) for row in recording.block(first, min(samples, first + step))]
        for first in range(0, samples, step)
    ]
    units, colours = recording.units, recording.colours

    def joined(row: int, which: int) -> Values:
        return np.concatenate([each[row][which] for each in blocks] or [np.empty(0)])

    return tuple(
        Track(
            name,
            units[name],
            time_s=joined(0, 0),
            values=joined(row, 0),
            low=joined(row, 1),
            high=joined(row, 2),
            colour=colours.get(name, ""),
        )
        for row, name in enumerate(names, 1)
    )


def _reduced(values: Values, piece: int) -> tuple[Values, Values, Values]:
    """Return mean, least and largest value of each piece."""
    if piece == 1:
        return values, values, values
    starts = np.arange(0, values.size, piece)
    counts = np.diff(np.append(starts, values.size))
    mean = np.add.reduceat(values, starts) / counts
    return mean, np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)


def _axis(recording: Recording, name: str, unit: str) -> Track:
    times, places, confidence = recording.positions(name)
    places[confidence == "unknown"] = np.nan
    order = np.argsort(times, kind="stable")  # a moving axis is dated back to when it was read
    times, places = times[order], places[order]
    return Track(name, unit, times, places, places, places)


def _films_between(
    sides: Sequence[Item], start_s: float, end_s: float, start_utc: datetime
) -> tuple[Film, ...]:
    """Return the images taken meanwhile, on the same clock."""
    found = []
    for each in sides:
        try:
            with open_image_recording(each.path) as images:
                row = next((row for row in images.rows if row.utc is not None), None)
                film = _film(each.path, images)
        except (CosmicError, OSError):
            continue  # it says so where it is opened itself
        known = film.time_s[np.isfinite(film.time_s)]
        if row is None or row.utc is None or not known.size:
            continue
        begun_s = (row.utc - start_utc).total_seconds()
        alike = _clocks_agree(row.time_s - start_s, begun_s)
        if alike and known[0] <= end_s and known[-1] >= start_s:
            found.append(film)
    return tuple(found)


def _clocks_agree(platform_s: float, wall_s: float) -> bool:
    """Tell whether both times can be of one run; a simulated platform may run faster."""
    if abs(platform_s - wall_s) <= CLOCKS_AGREE_S:
        return True
    return wall_s != 0.0 and 1.0 <= platform_s / wall_s <= 100.0


def _film(path: Path, images: ImageRecording) -> Film:
    return Film(path, images.camera, images.time_s[: len(images)], images.complete)


def _of_images(path: Path, images: ImageRecording) -> Timeline:
    film = _film(path, images)
    known = film.time_s[np.isfinite(film.time_s)]
    first_s, end_s = (float(known[0]), float(known[-1])) if known.size else (0.0, 0.0)
    start_utc = next((row.utc for row in images.rows if row.utc is not None), None)
    log = log_lines(path.parent, first_s, end_s, start_utc) if start_utc is not None else ()
    rows = [row for row in images.rows if row.circumstances.positions]
    times = np.array([row.time_s for row in rows])
    tracks = []
    for name, unit in images.axes.items():
        there = np.array([row.circumstances.positions.get(name, np.nan) for row in rows], float)
        tracks.append(Track(name, unit, times, there, there, there))
    return Timeline(
        path=path,
        start_s=first_s,
        end_s=end_s,
        start_utc=start_utc,
        rate_hz=images.rate_hz,
        positions=tuple(tracks) if rows else (),
        films=(film,),
        log=log,
        complete=images.complete,
    )
