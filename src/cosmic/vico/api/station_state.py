"""What a station tells of ViCo: the values that travel, and where they are published."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from cosmic.frame.network.transfer import transferable
from cosmic.vico.api.camera_shown import FormatShown, LinkShown
from cosmic.vico.api.places import CalibrationShown, RotationShown
from cosmic.vico.core.camera_recordings import PictureRecordingState
from cosmic.vico.core.peripheral_state import PeripheralState
from cosmic.vico.core.zoom_scale import ZoomPoint
from cosmic.vico.hw.interface import (
    CameraCounters,
    CameraInfo,
    CameraRanges,
    CameraSettings,
    FrameStatus,
    PixelFormat,
    Range,
    Roi,
    Trigger,
)
from cosmic.vico.hw.peripherals import LensAxis, LensState

APPLICATION: Final = "vico"
"""The name under which a station hosts it."""
STATE: Final = "vico/state"
PULSE: Final = "vico/pulse"


def pictures_topic(camera: str) -> str:
    """Return where every frame of a camera is published as it came, in order."""
    return f"vico/{camera}/pictures"


def shown_topic(camera: str) -> str:
    """Return where whole pictures are published as a live view shows them, the newest only."""
    return f"vico/{camera}/shown"


def seen_topic(camera: str) -> str:
    """Return where it is published what machine vision found."""
    return f"vico/{camera}/seen"


for _kind in (
    CalibrationShown,
    CameraCounters,
    CameraInfo,
    CameraRanges,
    CameraSettings,
    FormatShown,
    FrameStatus,
    LensAxis,
    LensState,
    LinkShown,
    PeripheralState,
    PixelFormat,
    Range,
    Roi,
    RotationShown,
    Trigger,
    ZoomPoint,
):
    transferable(_kind)


@transferable
@dataclass(frozen=True, slots=True)
class SentRecording:
    """A `PictureRecordingState`, whose path is one of the station's disk."""

    active: bool
    path: str
    written: int
    dropped: int
    waiting: int
    duration_s: float
    size_bytes: int
    left_s: float | None
    failure: str

    @classmethod
    def of(cls, state: PictureRecordingState) -> "SentRecording":
        """Return what is sent of a recording."""
        return cls(
            active=state.active,
            path="" if state.path is None else str(state.path),
            written=state.written,
            dropped=state.dropped,
            waiting=state.waiting,
            duration_s=state.duration_s,
            size_bytes=state.size_bytes,
            left_s=state.left_s,
            failure=state.failure,
        )

    def received(self) -> PictureRecordingState:
        """Return the recording as handles show it."""
        return PictureRecordingState(
            active=self.active,
            path=Path(self.path) if self.path else None,
            written=self.written,
            dropped=self.dropped,
            waiting=self.waiting,
            duration_s=self.duration_s,
            size_bytes=self.size_bytes,
            left_s=self.left_s,
            failure=self.failure,
        )


NO_RECORDING: Final = SentRecording.of(PictureRecordingState())


@transferable
@dataclass(frozen=True, slots=True)
class CameraState:
    """What there is to know of a camera, but its pictures and counters.

    Attributes
    ----------
    axes : mapping of str to str
        Unit of each axis whose position comes with the pictures.
    rotation : RotationShown or None
        About which place the plate turns.
    """

    name: str
    title: str
    behind_lens: bool
    info: CameraInfo | None = None
    ranges: CameraRanges | None = None
    settings: CameraSettings | None = None
    running: bool = False
    problem: str = ""
    has_background: bool = False
    links: tuple[LinkShown, ...] = ()
    formats: tuple[FormatShown, ...] = ()
    recording: SentRecording = NO_RECORDING
    axes: Mapping[str, str] = field(default_factory=dict)
    rotation: RotationShown | None = None

    def greyed(self, why: str) -> "CameraState":
        """Return it as it is shown while its station is away."""
        recording = replace(self.recording, active=False)
        links = tuple(replace(each, problem=why) for each in self.links)
        return replace(
            self,
            info=None,
            ranges=None,
            settings=None,
            running=False,
            problem=why,
            links=links,
            formats=tuple(replace(each, problem=why) for each in self.formats),
            recording=recording,
        )


@transferable
@dataclass(frozen=True, slots=True)
class VicoState:
    """What there is to know of ViCo on a station, but pictures and counters.

    Attributes
    ----------
    number : int
        Counts up: of two states the one with the larger number is the newer.
    clock_rate : float
        Platform seconds per second of the wall.
    directory : str
        Where pictures go on the station's disk unless somebody says otherwise.
    lens, light : bool
        The platform has one.
    tools : tuple of str
        What can be moved to a place in a picture.
    """

    number: int
    clock_rate: float
    directory: str
    cameras: tuple[CameraState, ...]
    found: tuple[CameraInfo, ...]
    lens: bool
    light: bool
    lens_name: str
    light_name: str
    zoom_points: tuple[ZoomPoint, ...]
    peripherals: PeripheralState
    tools: tuple[str, ...]
    calibrated: tuple[CalibrationShown, ...]

    def camera(self, name: str) -> CameraState | None:
        """Return what is known of a camera."""
        return next((each for each in self.cameras if each.name == name), None)

    def says_the_same_as(self, other: "VicoState") -> bool:
        """Return whether nothing differs but when it was looked."""
        return self.timeless == other.timeless

    @property
    def timeless(self) -> "VicoState":
        """The same without number and time."""
        return replace(
            self, number=0, peripherals=replace(self.peripherals, time_s=0.0, wall_s=0.0)
        )

    def greyed(self, why: str) -> "VicoState":
        """Return it as it is shown while the station is away."""
        now = self.peripherals
        return replace(
            self,
            cameras=tuple(each.greyed(why) for each in self.cameras),
            peripherals=PeripheralState(
                now.time_s, now.wall_s, lens_problem=why, light_problem=why
            ),
            tools=(),
        )


@transferable
@dataclass(frozen=True, slots=True)
class CameraPulse:
    """What changes with every picture of a camera.

    Attributes
    ----------
    newest_id : int or None
        Number of the newest whole frame.
    """

    name: str
    counters: CameraCounters
    focus: float | None
    newest_id: int | None
