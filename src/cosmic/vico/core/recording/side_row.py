"""`SideRow`: what stands beside an image in the side file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from types import MappingProxyType
from typing import Final

from cosmic.frame.errors import RecordingError
from cosmic.vico.core.image import CameraImage, Circumstances

NOT_THERE: Final = -1
"""Index of an image that is not in the file."""
DROPPED: Final = "dropped"
UNKNOWN: Final = "unknown"
END: Final = "end"
ENDED_EARLY: Final = "ended early"
_CLOSING: Final = (END, ENDED_EARLY)
_CIRCUMSTANCES: Final = (
    "exposure_s",
    "gain_db",
    "zoom_counts",
    "focus_counts",
    "light_percent",
    "scale_um_px",
    "sample_s",
)
COLUMNS: Final = (
    "index",
    "frame_id",
    "device_ns",
    "time_s",
    "exposed_s",
    "utc",
    *_CIRCUMSTANCES,
    "sample",
    "lost_before",
    "dropped",
    "status",
    "camera",
    "pixel_format",
)


@dataclass(frozen=True, slots=True)
class SideRow:
    """One image that came to a recorder, whether it is in the file or not.

    Attributes
    ----------
    index : int
        In the file, from 0; -1 when it is not there.
    time_s, exposed_s : float
        Platform time at which it was complete, and at which its exposure began.
    utc : datetime or None
        When it came to the recorder.
    lost_before : int
        Frames that the camera lost since the image before this one.
    dropped : int
        Images dropped since the beginning because the queue was full, with this one.
    status : str
        "complete", "incomplete" (not in the file), "dropped" (not in the file), "unknown" (from a
        file whose side file was cut off); in the last row, which repeats the one before, "end" or
        "ended early".
    """

    frame_id: int
    device_ns: int | None
    time_s: float
    exposed_s: float
    utc: datetime | None
    status: str
    camera: str
    pixel_format: str
    circumstances: Circumstances = field(default_factory=Circumstances)
    lost_before: int = 0
    dropped: int = 0
    index: int = NOT_THERE

    @property
    def is_end(self) -> bool:
        """True for the row that says how the recording ended."""
        return self.status in _CLOSING

    def texts(self) -> dict[str, str]:
        """Return the values of `COLUMNS`, empty where nobody knows."""
        found: dict[str, object] = {name: getattr(self, name) for name in COLUMNS[:5]}
        found["utc"] = self.utc.isoformat(timespec="microseconds") if self.utc else None
        found |= {name: getattr(self.circumstances, name) for name in (*_CIRCUMSTANCES, "sample")}
        found |= {name: getattr(self, name) for name in COLUMNS[-5:]}
        return {name: _text(value) for name, value in found.items()}


def row_of(image: CameraImage, utc: datetime) -> SideRow:
    """Return the row of an image that came at `utc`, not yet in a file."""
    frame = image.frame
    return SideRow(
        frame_id=frame.frame_id,
        device_ns=frame.device_ns,
        time_s=frame.time_s,
        exposed_s=frame.exposed_s,
        utc=utc,
        status=frame.status.value,
        camera=image.camera,
        pixel_format=frame.pixel_format.value,
        circumstances=image.circumstances,
        lost_before=image.lost_before,
    )


def row_from(texts: Mapping[str, str], axes: Mapping[str, str]) -> SideRow:
    """Return the row that `texts` say.

    Parameters
    ----------
    axes : mapping of str to str
        Name of each axis by its column.

    Raises
    ------
    RecordingError
        A value is missing or is no number.
    """
    try:
        positions = {axis: float(texts[column]) for column, axis in axes.items() if texts[column]}
        # Side files of before lack what the sample clock says.
        known = {
            name: float(text) if (text := texts.get(name)) else None for name in _CIRCUMSTANCES
        }
        sample = int(text) if (text := texts.get("sample")) else None
        return SideRow(
            frame_id=int(texts["frame_id"]),
            device_ns=int(texts["device_ns"]) if texts["device_ns"] else None,
            time_s=float(texts["time_s"]),
            exposed_s=float(texts["exposed_s"]),
            utc=datetime.fromisoformat(texts["utc"]) if texts["utc"] else None,
            status=texts["status"],
            camera=texts["camera"],
            pixel_format=texts["pixel_format"],
            circumstances=Circumstances(
                **known, positions=MappingProxyType(positions), sample=sample
            ),
            lost_before=int(texts["lost_before"]),
            dropped=int(texts["dropped"]),
            index=int(texts["index"]),
        )
    except (KeyError, ValueError, TypeError) as exc:
        raise RecordingError(f"a row of the side file cannot be read: {exc}") from exc


def position_texts(row: SideRow, axes: Mapping[str, str]) -> dict[str, str]:
    """Return positions by column, the axis with its unit.

    Parameters
    ----------
    axes : mapping of str to str
        Unit of each axis by its name; an axis not in it is left out.
    """
    positions = row.circumstances.positions
    return {position_column(axis, unit): _text(positions.get(axis)) for axis, unit in axes.items()}


def position_column(axis: str, unit: str) -> str:
    """Return the name of the column of an axis, such as "left.x_um"."""
    return f"{axis}_{unit}" if unit else axis


def _text(value: object) -> str:
    # repr of a float is the shortest text that gives the same float again.
    if value is None:
        return ""
    return repr(float(value)) if isinstance(value, float) else str(value)
