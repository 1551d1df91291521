"""`NexusEntry`: the part of a recording that NeXus, xarray and MATLAB open by themselves."""

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

import h5py
import numpy as np
import numpy.typing as npt

from cosmic.daqco.core.recording_format import AxisPosition, RecordingHeader, text_type

ENTRY: Final = "entry"
DATA: Final = "data"
POSITIONS: Final = "positions"
TIME: Final = "time"
MAIN_CHANNEL: Final = "force"
"""What is plotted unless somebody chooses; where there is none, the first that is not in volts."""
_ROWS_A_CHUNK: Final = 512


class NexusEntry:
    """``/entry`` of a recording being written: physical values, their times, positions; one thread.

    Everything is created at once, since SWMR lets nothing be created later. Values whose unit
    changes on the way are NaN from there on: the tables tell what they are.

    Parameters
    ----------
    block : int
        How many samples of one channel lie together.
    """

    def __init__(self, file: h5py.File, header: RecordingHeader, block: int, path: Path) -> None:
        self._start_s = header.start_s
        file.attrs["NX_class"], file.attrs["default"] = "NXroot", ENTRY
        entry = _group(file, ENTRY, "NXentry")
        entry.attrs["default"] = DATA
        _text(entry, "title", path.stem)
        _text(entry, "start_time", header.start_utc.isoformat())
        _text(entry, "program_name", header.software or "CoSMic")
        since = _since(header.start_utc)
        units = [each.unit for each in header.scales]
        names = [_name(each) for each in header.names]
        data = _group(entry, DATA, "NXdata")
        self._times, self._values = _over_time(data, names, units, since, block)
        _plot(data, names, _main(header))
        found = [f"{name}_{unit}" for name, unit in header.axes]
        moved = _group(entry, POSITIONS, "NXdata")
        of_units = [unit for _, unit in header.axes]
        self._moments, tracks = _over_time(moved, found, of_units, since, _ROWS_A_CHUNK)
        self._tracks = dict(zip((name for name, _ in header.axes), tracks, strict=True))
        self._rows: list[tuple[float, dict[str, float]]] = []
        _plot(moved, found, 0)

    def write(
        self,
        column: int,
        end: int,
        times: npt.NDArray[np.float64],
        values: npt.NDArray[np.float64],
    ) -> None:
        """Lay down one block of every channel.

        Parameters
        ----------
        column : int
            Where the block begins.
        end : int
            How many samples a channel there are then.
        times : ndarray, shape (block,), float64, s
            Since the start of the recording.
        values : ndarray, shape (channels, block), float64
            In the units of the header.
        """
        for dataset, row in zip((self._times, *self._values), (times, *values), strict=True):
            dataset.id.set_extent((end,))  # `resize` looks at all it has first, at 2 ms a block
            dataset.id.write_direct_chunk((column,), row)

    def add_positions(self, positions: Iterable[AxisPosition]) -> None:
        """Add a row of positions; written by the next `flush`. Axes not in the header are left."""
        known = [each for each in positions if each.axis in self._tracks]
        if known:
            newest_s = max(each.time_s for each in known) - self._start_s
            self._rows.append((newest_s, {each.axis: each.position for each in known}))

    def flush(self) -> None:
        """Write the rows of positions that wait."""
        rows, self._rows = self._rows, []
        if not rows:
            return
        _append(self._moments, [time_s for time_s, _ in rows])
        for name, track in self._tracks.items():
            _append(track, [row.get(name, np.nan) for _, row in rows])


def _name(channel: str) -> str:
    """Return what the dataset of a channel is called: as the channel, but for the times."""
    return f"{channel}_" if channel == TIME else channel


def _main(header: RecordingHeader) -> int:
    if MAIN_CHANNEL in header.names:
        return header.names.index(MAIN_CHANNEL)
    measured = [row for row, scale in enumerate(header.scales) if scale.unit != "V"]
    return measured[0] if measured else 0


def _since(start: datetime) -> str:
    """Return the unit of times as CF and UDUNITS write it."""
    return f"seconds since {start.astimezone(UTC):%Y-%m-%d %H:%M:%S.%f}"


def _group(parent: h5py.Group, name: str, kind: str) -> h5py.Group:
    made = parent.create_group(name)
    made.attrs["NX_class"] = kind
    return made


def _text(parent: h5py.Group, name: str, text: str) -> None:
    coded = text.encode("utf-8")
    kind = text_type(len(coded))
    parent.create_dataset(name, data=np.array(coded, dtype=kind), dtype=kind)


def _over_time(
    group: h5py.Group, names: Sequence[str], units: Sequence[str], since: str, chunk: int
) -> tuple[Any, list[Any]]:
    """Return a dataset of times and one of each name, with their units and dimension scales."""
    times = _growing(group, TIME, since, chunk)
    times.make_scale(TIME)
    made = []
    for name, unit in zip(names, units, strict=True):
        each = _growing(group, name, unit, chunk)
        each.dims[0].attach_scale(times)
        made.append(each)
    return times, made


def _growing(group: h5py.Group, name: str, unit: str, chunk: int) -> Any:
    made = group.create_dataset(
        name, (0,), "<f8", maxshape=(None,), chunks=(chunk,), fillvalue=np.nan
    )
    made.attrs["units"] = unit
    return made


def _plot(group: h5py.Group, names: Sequence[str], main: int) -> None:
    """Say what is plotted over what, as NXdata does."""
    if not names:
        return
    others = [name for row, name in enumerate(names) if row != main]
    group.attrs["signal"] = names[main]
    group.attrs["axes"] = [TIME]
    group.attrs[f"{TIME}_indices"] = 0
    if others:
        group.attrs["auxiliary_signals"] = others


def _append(dataset: Any, values: Sequence[float]) -> None:
    old = dataset.shape[0]
    dataset.resize(old + len(values), axis=0)
    dataset[old:] = values
