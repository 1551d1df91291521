"""`RecordingFile`: a recording being written, without a thread of its own."""

import os
from collections.abc import Iterable
from dataclasses import astuple
from pathlib import Path
from typing import Any, Final
from weakref import WeakSet

import h5py
import numpy as np

from cosmic.daqco.core import recording_format as form
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.nexus import NexusEntry
from cosmic.daqco.core.preallocation import TABLES_BYTES, Preallocation, trim
from cosmic.daqco.core.recording_format import (
    AxisPosition,
    Overrun,
    RecordedEvent,
    RecordedExposure,
    RecordingHeader,
)
from cosmic.daqco.core.scale import Scale
from cosmic.frame.errors import RecordingError, RecordingExistsError
from cosmic.frame.file_holder import FileHold, own_mark

BLOCK_S: Final = 0.5
SMALLEST_BLOCK: Final = 256
LARGEST_BLOCK: Final = 8192
ROWS_A_CHUNK: Final = 512
SELDOM: Final = 4
"""Physical values are made visible at every fourth flush: a whole block is written for each."""
WRITE_ERRORS: Final = (OSError, RuntimeError, ValueError)
"""What h5py raises when a file cannot be written."""

_abandoned: list["RecordingFile"] = []
_open_files: Final["WeakSet[RecordingFile]"] = WeakSet()


def _on_fork() -> None:
    for each in list(_open_files):
        each.leave_to_parent()


if hasattr(os, "register_at_fork"):  # not on Windows, which has no fork
    os.register_at_fork(after_in_child=_on_fork)


def block_samples(rate_hz: float) -> int:
    """Return how many samples of one channel lie together in the file."""
    wanted = max(SMALLEST_BLOCK, min(LARGEST_BLOCK, round(rate_hz * BLOCK_S)))
    return 1 << (wanted - 1).bit_length()


def _gap_samples(chunk: DataChunk, *, sample: int, time_s: float) -> int:
    if chunk.first_sample >= sample:
        return chunk.first_sample - sample
    # Acquisition began again, and counts from zero: only the clock knows what is missing.
    return max(0, round((chunk.time_s - time_s) * chunk.rate_hz))


class RecordingFile:
    """One HDF5 file in SWMR mode: readable while it grows, and after a crash; one thread.

    Blocks of each channel are laid into the file past HDF5's caches and conversions; a block
    begun is written with every `flush`, whole, and again when there is more of it. All tables
    exist before SWMR begins, since nothing can be created afterwards.

    Raises
    ------
    RecordingExistsError
        There is such a file, and `overwrite` is False.
    RecordingError
        It cannot be created.
    """

    def __init__(self, path: Path, header: RecordingHeader, *, overwrite: bool = False) -> None:
        self._path = path
        self._header = header
        self._names = header.names
        self._block = np.zeros((len(self._names), block_samples(header.rate_hz)))
        self._values = np.zeros_like(self._block)
        self._times = np.zeros(self._block.shape[1])
        self._filled = 0
        self._scaled = self._shown = 0
        self._flushed = self._flushes = 0
        self._columns = 0
        self._next: tuple[int, float] | None = None
        self._scales: tuple[Scale, ...] = ()
        self._version = -1
        self._axes: dict[str, int] = {}
        self._rows: dict[str, list[Any]] = {name: [] for name in form.GROWING}
        self._lost = 0
        self._closing = False
        self._hold: FileHold | None = None
        self._file = self._created(overwrite=overwrite)
        self._handle = self._file.id.get_vfd_handle() if hasattr(os, "fork") else -1
        _open_files.add(self)
        self._size_bytes = 0
        held_bytes = self._block.nbytes + self._values.nbytes + self._times.nbytes
        self._preallocation = Preallocation(self._file, path, 2 * held_bytes + TABLES_BYTES)
        self._begin()

    @property
    def path(self) -> Path:
        """Where it lies."""
        return self._path

    @property
    def samples(self) -> int:
        """How many samples a channel were given so far."""
        return self._columns + self._filled

    @property
    def size_bytes(self) -> int:
        """How long the file is."""
        return self._preallocation.used_bytes if self._file else self._size_bytes

    @property
    def lost(self) -> int:
        """How many samples a channel are missing between those."""
        return self._lost

    @property
    def end_s(self) -> float:
        """Platform time after the last sample given so far."""
        return self._next[1] if self._next is not None else self._header.start_s

    def append(self, chunk: DataChunk) -> None:
        """Add the samples of `chunk`.

        Raises
        ------
        RecordingError
            Its channels or its rate are others than at the start.
        """
        if chunk.channels != self._names or chunk.rate_hz != self._header.rate_hz:
            raise RecordingError(
                f"{self._path}: the channels and the rate of a recording cannot change; it was "
                f"ended at {self._header.rate_hz:g} Hz with {len(self._names)} channels, "
                "so start another"
            )
        self._note_gap(chunk)
        if chunk.scales != self._scales:
            self._note_scales(chunk.scales, chunk.time_s)
        row = (chunk.first_sample, self.samples, chunk.samples, chunk.time_s, self._version)
        self._fill(chunk)
        self._rows["chunks"].append(row)

    def add_event(self, event: RecordedEvent) -> None:
        """Add an event."""
        self._rows["events"].append(
            (
                event.time_s,
                event.sample,
                form.encoded(event.kind, form.NAME_BYTES),
                form.encoded(event.channel, form.NAME_BYTES),
                event.value,
                form.encoded(event.text, form.TEXT_BYTES),
            )
        )

    def add_exposure(self, exposure: RecordedExposure) -> None:
        """Add an exposure of a camera."""
        camera = form.encoded(exposure.camera, form.NAME_BYTES)
        row = (exposure.sample, exposure.time_s, exposure.number, camera)
        self._rows["exposures"].append(row)

    def add_positions(self, positions: Iterable[AxisPosition]) -> None:
        """Add where axes were; an axis is known from its first row on."""
        rows = tuple(positions)
        self._nexus.add_positions(rows)
        for each in rows:
            if each.axis not in self._axes:
                self._axes[each.axis] = len(self._axes)
                name = form.encoded(each.axis, form.NAME_BYTES)
                self._rows["axes"].append((name, form.encoded(each.unit, form.NAME_BYTES)))
            confidence = form.CONFIDENCES[each.confidence]
            row = (each.time_s, self._axes[each.axis], each.position, confidence)
            self._rows["positions"].append(row)

    def add_overrun(self, overrun: Overrun) -> None:
        """Say that samples are missing."""
        self._lost += overrun.lost
        self._rows["overruns"].append(astuple(overrun))

    def flush(self) -> None:
        """Make everything given so far visible to readers, and safe from the end of the process."""
        if self._filled > self._flushed:
            self._write_volts()
            self._flushed = self._filled
        self._flushes += 1
        if self._closing or self._flushes % SELDOM == 0:
            self._write_values()
        self._preallocate()
        self._nexus.flush()
        self._write_tables()
        self._file.flush()

    def close(self, *, complete: bool) -> None:
        """Write what is left and close the file; harmless the second time."""
        if not self._file:
            return
        self._closing = True
        self.flush()
        self._size_bytes = self._preallocation.used_bytes
        if complete:
            self._file["complete"][()] = 1
        _open_files.discard(self)
        self._file.close()
        trim(self._path)
        if self._hold is not None:
            self._hold.release()

    def abandon(self) -> None:
        """Leave the file as it is after a failed write; harmless after `close`.

        Closing it, or writing anything more, might end the process. It is read as the file of a
        killed process is.
        """
        if self._file:
            _abandoned.append(self)

    def leave_to_parent(self) -> None:
        """Write nothing more into the file, in a process that was forked from the one that does.

        As it ends HDF5 would write what it last knew over what the other has written since.
        """
        nowhere = os.open(os.devnull, os.O_RDWR)
        os.dup2(nowhere, self._handle)
        os.close(nowhere)

    def _created(self, *, overwrite: bool) -> h5py.File:
        path = self._path
        try:
            if overwrite and path.exists():
                self._check_replaceable()
            return h5py.File(path, "w" if overwrite else "x", libver=("v110", "v110"))
        except FileExistsError:
            raise RecordingExistsError(
                f"{path}: there is such a file; choose another name, or say that it may be replaced"
            ) from None
        except WRITE_ERRORS as exc:
            raise RecordingError(
                f"{path}: cannot be created ({form.reason(exc)}); close what reads it, "
                "or choose another name or directory"
            ) from exc

    def _check_replaceable(self) -> None:
        """Refuse what somebody records to, or reads: HDF5 empties a file before it asks for it."""
        with FileHold(self._path, alone=True) as hold:
            if not hold.held:
                raise RecordingError(
                    f"{self._path}: cannot be created: the file of that name is in use. Close what "
                    "has it open, or choose another name or directory"
                )

    def _begin(self) -> None:
        try:
            self._preallocation.need()
        except OSError as exc:
            _open_files.discard(self)
            self._file.close()
            self._path.unlink(missing_ok=True)
            raise self._no_room(exc) from exc
        self._create()

    def _create(self) -> None:
        file, header = self._file, self._header
        file.attrs["format"] = form.FORMAT
        file.attrs["format_version"] = form.VERSION
        file.attrs["software"] = header.software
        file.attrs["rate_hz"] = header.rate_hz
        file.attrs["start_utc"] = header.start_utc.isoformat()
        file.attrs["start_s"] = header.start_s
        writer = own_mark()
        file.attrs["writer_host"], file.attrs["writer_pid"] = writer.host, writer.pid
        file.attrs["writer_start"] = writer.start
        channels, block = self._block.shape
        self._volts = file.create_dataset(
            "volts", (channels, 0), "<f8", maxshape=(channels, None), chunks=(1, block),
            fillvalue=np.nan,
        )  # fmt: skip
        for name, dtype in form.GROWING.items():
            file.create_dataset(name, (0,), dtype, maxshape=(None,), chunks=(ROWS_A_CHUNK,))
        pairs = zip(header.channels, header.scales, strict=True)
        file["channels"] = np.array([form.channel_row(*pair) for pair in pairs], dtype=form.CHANNEL)
        text = header.configuration.encode("utf-8")
        kind = form.text_type(len(text))
        file.create_dataset("configuration", data=np.array(text, dtype=kind), dtype=kind)
        file.create_dataset("complete", data=np.uint8(0))
        self._nexus = NexusEntry(file, header, block, self._path)
        self._note_scales(header.scales, header.start_s)
        file.swmr_mode = True  # with it HDF5 lets go of its own lock
        self._hold = FileHold(self._path)
        self.flush()

    def _note_gap(self, chunk: DataChunk) -> None:
        if self._next is not None and chunk.first_sample != self._next[0]:
            sample, time_s = self._next
            lost = _gap_samples(chunk, sample=sample, time_s=time_s)
            self.add_overrun(Overrun(chunk.first_sample, lost, time_s, self.samples))
        self._next = (chunk.first_sample + chunk.samples, chunk.end_time_s)

    def _note_scales(self, scales: tuple[Scale, ...], time_s: float) -> None:
        self._scale_block()
        self._version += 1
        self._scales = scales
        for channel, scale in enumerate(scales):
            self._rows["scales"].append(
                form.scale_row(
                    scale,
                    version=self._version,
                    channel=channel,
                    column=self.samples,
                    time_s=time_s,
                )
            )

    def _fill(self, chunk: DataChunk) -> None:
        taken, width = 0, self._block.shape[1]
        while taken < chunk.samples:
            count = min(width - self._filled, chunk.samples - taken)
            end = self._filled + count
            self._block[:, self._filled : end] = chunk.volts[:, taken : taken + count]
            into_s = chunk.time_s - self._header.start_s
            self._times[self._filled : end] = (
                into_s + np.arange(taken, taken + count) / chunk.rate_hz
            )
            self._filled, taken = end, taken + count
            if self._filled == width:
                self._write_volts()
                self._write_values()
                self._columns += width
                self._filled = self._flushed = self._scaled = self._shown = 0

    def _scale_block(self) -> None:
        """Make values of the volts that came since, by the scales in force."""
        span = slice(self._scaled, self._filled)
        pairs = zip(self._scales, self._header.scales, strict=False)  # none before the first
        for channel, (scale, first) in enumerate(pairs):
            same = scale.unit == first.unit
            self._values[channel, span] = (
                scale.apply(self._block[channel, span]) if same else np.nan
            )
        self._scaled = self._filled

    def _write_volts(self) -> None:
        self._preallocate()
        self._volts.resize(self.samples, axis=1)
        for channel, row in enumerate(self._block):
            self._volts.id.write_direct_chunk((channel, self._columns), row)

    def _write_values(self) -> None:
        """Write what NeXus has of the block."""
        if self._shown < self._filled:
            self._preallocate()
            self._scale_block()
            self._nexus.write(self._columns, self.samples, self._times, self._values)
            self._shown = self._filled

    def _preallocate(self) -> None:
        if self._closing:  # what the margin is for
            return
        try:
            self._preallocation.need()
        except OSError as exc:
            raise self._no_room(exc) from exc

    def _no_room(self, exc: OSError) -> RecordingError:
        return RecordingError(
            f"{self._path}: cannot grow ({form.reason(exc)}); make room, or record to another disk"
        )

    def _write_tables(self) -> None:
        for name, rows in self._rows.items():
            if rows:
                table = self._file[name]
                old = table.shape[0]
                table.resize(old + len(rows), axis=0)
                table[old:] = np.array(rows, dtype=form.GROWING[name])
                rows.clear()
