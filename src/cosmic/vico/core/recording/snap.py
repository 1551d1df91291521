"""`save_image`: one image into a TIFF or PNG, with scale and circumstances."""

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

from cosmic.frame.errors import RecordingError, RecordingExistsError
from cosmic.frame.file_names import check_base_name, check_directory
from cosmic.frame.renamed import renamed_in
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.recording.formats import kind_of, words
from cosmic.vico.core.recording.side_row import row_of
from cosmic.vico.core.recording.tiff_png import encoded_png, encoded_tiff
from cosmic.vico.hw.interface import FrameStatus

_ENCODED = {".tif": encoded_tiff, ".tiff": encoded_tiff, ".png": encoded_png}


__getattr__ = renamed_in(__name__, {"save_picture": "save_image"})


def save_image(
    image: CameraImage,
    path: Path,
    *,
    axes: Mapping[str, str] | None = None,
    overwrite: bool = False,
    utc: datetime | None = None,
) -> Path:
    """Write `image` and return the absolute path of the file.

    Parameters
    ----------
    path : Path
        Ends in .tif, .tiff or .png, which says how.
    axes : mapping of str to str
        Unit of each axis, "um" or "deg", by its name.
    utc : datetime, optional
        When it was taken; now without it.

    Raises
    ------
    RecordingExistsError
        There is such a file, and `overwrite` is False.
    RecordingError
        The image is incomplete, or name, directory or disk forbid it.
    """
    encoded = _ENCODED.get(path.suffix.lower())
    if encoded is None:
        raise RecordingError(f"{path.name!r} must end in one of {words(_ENCODED)}")
    if image.frame.status is not FrameStatus.COMPLETE:
        raise RecordingError(f"{path.name!r}: parts of the image are missing; take another")
    kind_of(image.data, image.frame.pixel_format)
    whole = check_directory(path.parent) / check_base_name(path.name)
    if whole.exists() and not overwrite:
        raise RecordingExistsError(
            f"{whole}: there is such a file; choose another name, or say that it may be replaced"
        )
    coded = encoded(image.data, row_of(image, utc or datetime.now(UTC)), axes or {})
    part = whole.with_name(whole.name + ".part")
    try:
        part.write_bytes(coded)
        part.replace(whole)
    except OSError as exc:
        part.unlink(missing_ok=True)
        raise RecordingError(
            f"{whole}: cannot be written ({exc.strerror or exc}); is the disk full, or gone?"
        ) from exc
    return whole
