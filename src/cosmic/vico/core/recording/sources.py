"""Where the images of a recording are read from: a video file, or a directory."""

import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

import numpy as np

from cosmic.frame.errors import RecordingError, needs_extra
from cosmic.vico.core.recording.planes import from_video_frame
from cosmic.vico.core.recording.sequence_writer import image_files
from cosmic.vico.hw.interface import Pixels

if TYPE_CHECKING:
    import av

_FOOTER: Final = 8  # length of the slice in 3 bytes, a status byte, checksum in 4 bytes
_REVERSED: Final = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
_START: Final = 0xFFFFFFFF  # undoes what zlib does to the start and the end of a checksum


def is_intact(packet: bytes) -> bool:
    """Return whether the checksums of all slices of a packet are right."""
    # FFV1 counts bits from the other end than zlib does.
    turned = packet.translate(_REVERSED)
    end = len(packet)
    while end > 0:
        start = end - _FOOTER - int.from_bytes(packet[end - _FOOTER : end - _FOOTER + 3], "big")
        if not 0 <= start <= end - _FOOTER:
            return False
        if zlib.crc32(memoryview(turned)[start:end], _START) != _START:
            return False
        end = start
    return True


class ImageSource(Protocol):
    """Gives the images in their order."""

    def count(self) -> int:
        """Return how many whole images there are; looks through the file."""

    def images(self) -> Iterator[Pixels]:
        """Yield all images, from the first."""

    def image(self, index: int, stamp: int | None) -> Pixels:
        """Return one image; `stamp` says at which millisecond it lies, where that is known."""

    def close(self) -> None:
        """Give the files back; harmless the second time."""


class SequenceSource:
    """A directory with a file an image."""

    def __init__(self, directory: Path) -> None:
        self._files = list(image_files(directory).values())

    def count(self) -> int:
        """Return how many images there are."""
        return len(self._files)

    def images(self) -> Iterator[Pixels]:
        """Yield all images."""
        for index in range(len(self._files)):
            yield self.image(index)

    def image(self, index: int, stamp: int | None = None) -> Pixels:
        """Return one image; `stamp` is not needed."""
        del stamp
        return read_image(self._files[index])

    def close(self) -> None:
        """Nothing is open."""


class StackSource:
    """A TIFF with a page an image, finished or cut off.

    Raises
    ------
    RecordingError
        It cannot be read.
    """

    def __init__(self, path: Path) -> None:
        import tifffile

        self._path = path
        self._failure = (OSError, ValueError, IndexError, tifffile.TiffFileError)
        try:
            self._file = tifffile.TiffFile(path)
            self._count = self._whole()
        except self._failure as exc:
            raise RecordingError(f"{path}: cannot be read ({exc})") from exc

    def _whole(self) -> int:
        """Return how many pages are there with all their pixels."""
        end = self._path.stat().st_size
        count = 0
        for page in self._file.pages:
            frame = page.aspage()
            last = zip(frame.dataoffsets, frame.databytecounts, strict=True)
            if any(at + size > end for at, size in last):
                break
            count += 1
        return count

    def count(self) -> int:
        """Return how many images there are."""
        return self._count

    def images(self) -> Iterator[Pixels]:
        """Yield all images."""
        for index in range(self._count):
            yield self.image(index)

    def image(self, index: int, stamp: int | None = None) -> Pixels:
        """Return one image; `stamp` is not needed."""
        del stamp
        try:
            found: Pixels = self._file.pages[index].asarray()
        except self._failure as exc:
            raise RecordingError(f"{self._path}: image {index} cannot be read ({exc})") from exc
        return found

    def close(self) -> None:
        """Give the file back; harmless the second time."""
        self._file.close()


def read_image(path: Path) -> Pixels:
    """Return the pixels of a TIFF or PNG.

    Raises
    ------
    RecordingError
        It cannot be read.
    """
    import cv2
    import tifffile

    try:
        if path.suffix == ".png":
            coded = np.frombuffer(path.read_bytes(), np.uint8)
            data: Any = cv2.imdecode(coded, cv2.IMREAD_UNCHANGED)
            if data is not None and data.ndim == 3:
                data = np.ascontiguousarray(data[:, :, ::-1])
        else:
            data = tifffile.imread(path)
    except (OSError, ValueError, cv2.error, tifffile.TiffFileError) as exc:
        raise RecordingError(f"{path}: cannot be read ({exc})") from exc
    if data is None:
        raise RecordingError(f"{path}: is not an image, or damaged")
    found: Pixels = data
    return found


class VideoSource:
    """A video file, finished, running or cut off.

    Parameters
    ----------
    colour : bool
        The images have three layers.
    whole : bool
        The file was closed in order, so that damage in it is told; else the images end there.
    """

    def __init__(self, path: Path, *, colour: bool, whole: bool) -> None:
        self._path = path
        self._colour = colour
        self._whole = whole
        self._container: Any = None
        self._next: tuple[int, Iterator[av.VideoFrame]] | None = None
        self._open()

    def _open(self) -> None:
        try:
            import av
        except ImportError as exc:
            text = f"{self._path}: {needs_extra('Reading video', 'video')}"
            raise RecordingError(text) from exc
        self.close()
        self._failure = av.FFmpegError
        try:
            self._container = av.open(str(self._path))
            self._stream = self._container.streams.video[0]
            self._stream.thread_type = "SLICE"
        except (av.FFmpegError, IndexError) as exc:
            raise RecordingError(
                f"{self._path}: no image in it can be read ({exc}); is it damaged, or was the "
                "program ended before the first image was written?"
            ) from exc

    def count(self) -> int:
        """Return how many whole images there are; looks through the file."""
        self._open()
        try:
            return sum(1 for _ in self._packets())
        finally:
            self._open()

    def images(self) -> Iterator[Pixels]:
        """Yield all images."""
        self._open()
        for frame in self._frames():
            yield self._pixels(frame)

    def image(self, index: int, stamp: int | None) -> Pixels:
        """Return one image."""
        if self._next is None or self._next[0] != index:
            found = self._sought(stamp) if stamp is not None else None
            if found is None:
                found = self._counted(index)
            self._next = (index, found)
        frames = self._next[1]
        frame = next(frames, None)
        if frame is None:
            raise RecordingError(f"{self._path}: image {index} cannot be read")
        self._next = (index + 1, frames)
        return self._pixels(frame)

    def _counted(self, index: int) -> "Iterator[av.VideoFrame]":
        """Return the images from `index` on, found by counting."""
        self._open()
        frames = self._frames()
        for _ in range(index):
            next(frames, None)
        return frames

    def _sought(self, stamp: int) -> "Iterator[av.VideoFrame] | None":
        """Return the images from the one at `stamp` on; None when it is not found there."""
        base = self._stream.time_base
        try:
            self._container.seek(round(stamp / 1000 / base), stream=self._stream)
        except self._failure:
            return None
        frames = self._frames()
        for frame in frames:
            at = round(frame.pts * base * 1000)
            if at == stamp:
                return _with(frame, frames)
            if at > stamp:
                return None
        return None

    def close(self) -> None:
        """Give the file back; harmless the second time."""
        self._next = None
        if self._container is not None:
            self._container.close()
            self._container = None

    def _pixels(self, frame: "av.VideoFrame") -> Pixels:
        return from_video_frame(frame, colour=self._colour)

    def _packets(self) -> "Iterator[av.Packet[av.VideoStream]]":
        """Yield whole packets, up to the first that is not."""
        checked = self._stream.codec_context.name == "ffv1"
        try:
            for packet in self._demuxed():
                if packet.is_corrupt:
                    self._on_damage("an image is cut off")
                    return
                if checked and packet.size and not is_intact(bytes(packet)):
                    self._on_damage("its checksum is wrong")
                    return
                if packet.size:
                    yield packet
        except self._failure as exc:
            self._on_damage(exc)

    def _demuxed(self) -> "Iterator[av.Packet[av.VideoStream]]":
        packets = self._container.demux(self._stream)
        if self._whole or self._container.format.name != "nut":
            yield from packets
            return
        # FFmpeg does not say of the last packet in NUT whether it is cut off.
        held = None
        for packet in packets:
            if held is not None and packet.size:
                yield held
            held = packet

    def _frames(self) -> "Iterator[av.VideoFrame]":
        try:
            for packet in self._packets():
                yield from packet.decode()
        except self._failure as exc:
            self._on_damage(exc)

    def _on_damage(self, why: object) -> None:
        if self._whole:
            raise RecordingError(f"{self._path}: is damaged; an image cannot be read ({why})")


def _with(first: "av.VideoFrame", rest: "Iterator[av.VideoFrame]") -> "Iterator[av.VideoFrame]":
    yield first
    yield from rest
