"""`VideoWriter`: images into one video file, through PyAV."""

import sys
from collections.abc import Mapping
from fractions import Fraction
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from cosmic.frame.errors import RecordingError, needs_extra
from cosmic.vico.core.recording.formats import ImageFormat, Traits, traits
from cosmic.vico.core.recording.planes import to_video_frame
from cosmic.vico.core.recording.side_row import SideRow
from cosmic.vico.hw.interface import PixelFormat, Pixels

if TYPE_CHECKING:
    import av

TICK: Final = Fraction(1, 1000)
"""What Matroska counts time in; it keeps nothing finer."""
THREADS: Final = 2
ONE_THREAD_HZ: Final = 60.0
SMALLEST_SLICED_PX: Final = 16
# A cluster of Matroska reaches the disk only when it is full, so it must not take long to fill.
CONTAINER_OPTIONS: Final = {
    "matroska": {"cluster_time_limit": "100", "cluster_size_limit": "1000000"},
    "nut": {},
}


def check_codec(image_format: ImageFormat, *, load: bool = True) -> None:
    """Refuse a format whose codec is not installed.

    Parameters
    ----------
    load : bool
        Load PyAV to look for the codec in it, which takes a quarter of a second the first time;
        otherwise, until somebody has loaded it, PyAV that is installed is taken to have it.

    Raises
    ------
    RecordingError
        PyAV, or the codec in it, is missing.
    """
    codec = traits(image_format).codec
    if codec and (load or "av" in sys.modules or not _has_pyav()):
        _check_loaded(image_format, codec)


@cache
def _has_pyav() -> bool:
    return find_spec("av") is not None


def _check_loaded(image_format: ImageFormat, codec: str) -> None:
    help_ = "choose format tiff or png"
    try:
        import av
    except ImportError as exc:
        raise RecordingError(
            f"format {image_format}: PyAV cannot be loaded ({exc}). "
            f"{needs_extra('Recording video', 'video')}, or {help_}"
        ) from exc
    try:
        av.Codec(codec, "w")
    except ValueError as exc:
        raise RecordingError(
            f"format {image_format}: PyAV {av.__version__} has no codec {codec!r}; {help_}"
        ) from exc


class TimeStamps:
    """Milliseconds since the first image, each greater than the one before.

    Two images of one millisecond, or of a clock that stands still, would be refused by the
    container. The true times are in the side file.
    """

    def __init__(self) -> None:
        self._first_s: float | None = None
        self._last = -1

    def next(self, time_s: float) -> int:
        """Return the stamp of the next image."""
        if self._first_s is None:
            self._first_s = time_s
        self._last = max(self._last + 1, round((time_s - self._first_s) / TICK))
        return self._last


class VideoWriter:
    """One video file being written; one thread.

    Parameters
    ----------
    shape : tuple of int
        Height and width, then layers, of all images.
    rate_hz : float
        Nominal rate, by which players and converters go; time stamps are true.

    Raises
    ------
    OSError
        Here and in all methods: the file cannot be written.
    """

    def __init__(
        self,
        path: Path,
        image_format: ImageFormat,
        shape: tuple[int, ...],
        pixel_format: PixelFormat,
        rate_hz: float,
    ) -> None:
        import av

        found = traits(image_format)
        self._path = path
        self._stamps = TimeStamps()
        self._described = False
        self._coded = (found.coded or {})[pixel_format]
        self._failure = av.FFmpegError
        try:
            self._container: Any = av.open(
                str(path),
                "w",
                format=found.container,
                container_options=CONTAINER_OPTIONS[found.container] | {"flush_packets": "1"},
            )
            self._stream = self._added_stream(found, shape, rate_hz)
            self._stream.codec_context.options = _options(found.options or {}, shape)
            self._stream.codec_context.thread_type = found.threads
        except av.FFmpegError as exc:
            raise _as_os_error(exc) from exc

    def _added_stream(self, found: Traits, shape: tuple[int, ...], rate_hz: float) -> Any:
        # Threads that share out whole images hold some back, which a kill takes.
        threads = 1 if found.threads == "FRAME" and rate_hz <= ONE_THREAD_HZ else THREADS
        rate = Fraction(rate_hz if 0.0 < rate_hz < 1e4 else 15.0).limit_denominator(1000)
        stream = self._container.add_stream(found.codec, rate=rate)
        stream.height, stream.width = shape[:2]
        stream.pix_fmt = self._coded
        stream.codec_context.time_base = TICK
        stream.codec_context.thread_count = threads
        return stream

    def _describe(self, row: SideRow) -> None:
        """Say when the first image came, of which camera, and its pixel size."""
        self._described = True
        scale_um_px = row.circumstances.scale_um_px
        self._container.metadata["title"] = row.camera
        if row.utc is not None:
            self._container.metadata["creation_time"] = row.utc.isoformat(timespec="microseconds")
        if scale_um_px:
            self._container.metadata["PIXEL_SIZE_UM"] = repr(scale_um_px)

    @property
    def size_bytes(self) -> int:
        """How long the file is."""
        return self._path.stat().st_size

    def write(self, data: Pixels, row: SideRow) -> None:
        """Add an image."""
        if not self._described:
            self._describe(row)
        frame = to_video_frame(data, self._coded)
        frame.pts = self._stamps.next(row.time_s)
        frame.time_base = TICK
        self._encode(frame)

    def close(self) -> None:
        """Write what the codec holds back and the index, and close."""
        try:
            self._encode(None)
        finally:
            try:
                self._container.close()
            except self._failure as exc:
                raise _as_os_error(exc) from exc

    def _encode(self, frame: "av.VideoFrame | None") -> None:
        try:
            for packet in self._stream.encode(frame):
                self._container.mux(packet)
        except self._failure as exc:
            raise _as_os_error(exc) from exc


def _options(options: Mapping[str, str], shape: tuple[int, ...]) -> dict[str, str]:
    # FFV1 cannot cut an image of a few pixels into slices.
    small = min(shape[:2]) < SMALLEST_SLICED_PX
    return {name: value for name, value in options.items() if not (small and name == "slices")}


def _as_os_error(error: Exception) -> OSError:
    """Return FFmpeg's failure as that of a file."""
    if isinstance(error, OSError):
        return error
    return OSError(getattr(error, "errno", None), str(error))
