"""`ImageRecordingStats`: how a recording of images stands."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class ImageRecordingStats:
    """How a recording of images stands.

    Attributes
    ----------
    path, side_path : Path
        Of the file or the directory, and of the side file.
    written : int
        Images in the file.
    dropped : int
        Images that came while the queue was full, or that waited when writing failed.
    incomplete : int
        Images with parts missing; never in the file.
    lost : int
        Frames that the camera lost between the images that came.
    waiting, waiting_bytes : int
        Images that wait to be written.
    duration_s : float
        Platform time between the first and the last image in the file.
    file_bytes : int
        Size of the file, or of all files of a sequence.
    left_s : float
        How long it may go on before the disk is full.
    paused : bool
        Images that come now are not meant for the file.
    """

    path: Path
    side_path: Path
    written: int = 0
    dropped: int = 0
    incomplete: int = 0
    lost: int = 0
    waiting: int = 0
    waiting_bytes: int = 0
    duration_s: float = 0.0
    file_bytes: int = 0
    left_s: float = 0.0
    paused: bool = False
