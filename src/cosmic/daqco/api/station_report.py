"""What the station that has the boards tells the others, as plain values that travel."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from cosmic.daqco.api.recorder import RecordingState
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.limits import Crossing, Limit
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import DaqcoSettings
from cosmic.daqco.hw.interface import BoardInfo
from cosmic.frame.errors import ConfigError, ProtocolError
from cosmic.frame.network.transfer import transferable

HOSTED_AS: Final = "daqco"
CHUNKS: Final = "daqco/chunks"
"""Every chunk as it was acquired, in order; for whoever must lose nothing."""
DISPLAY: Final = "daqco/display"
"""The same samples in some 20 larger pieces a second; for whoever wants the newest."""
REPORTS: Final = "daqco/reports"
CROSSINGS: Final = "daqco/crossings"
FAILURES: Final = "daqco/failures"

for _each in (Scale, DataChunk, Limit, Crossing, BoardInfo):
    transferable(_each)


@transferable
@dataclass(frozen=True, slots=True)
class DaqRecordingReport:
    """A `RecordingState` with its path as text; the file lies at the station."""

    active: bool
    path: str
    duration_s: float
    size_bytes: int
    lost: int
    backlog: int
    left_s: float
    failure: str

    @classmethod
    def of(cls, state: RecordingState) -> "DaqRecordingReport":
        """Return what can travel of `state`."""
        return cls(
            active=state.active,
            path=str(state.path or ""),
            duration_s=state.duration_s,
            size_bytes=state.size_bytes,
            lost=state.lost,
            backlog=state.backlog,
            left_s=state.left_s,
            failure=state.failure,
        )

    def state(self) -> RecordingState:
        """Return it as the program uses it."""
        return RecordingState(
            active=self.active,
            path=Path(self.path) if self.path else None,
            duration_s=self.duration_s,
            size_bytes=self.size_bytes,
            lost=self.lost,
            backlog=self.backlog,
            left_s=self.left_s,
            failure=self.failure,
        )


@transferable
@dataclass(frozen=True, slots=True)
class DaqReport:
    """How everything stands but the samples; the newest replaces all before it.

    Attributes
    ----------
    station : str
        Another one at each start of the station.
    number : int
        Counts the reports of that start.
    settings : dict
        `DaqcoSettings` as plain values.
    now_s, clock_rate : float
        The station's platform clock when it was made.
    crossings : tuple of Crossing
        The newest, oldest first.
    """

    station: str
    number: int
    settings: dict[str, object]
    running: bool
    rate_hz: float
    problem: str
    now_s: float
    clock_rate: float
    samples: int
    recording: DaqRecordingReport
    limits: tuple[Limit, ...]
    crossings: tuple[Crossing, ...]
    boards: tuple[BoardInfo, ...]
    directory: str


@transferable
@dataclass(frozen=True, slots=True)
class DaqPiece:
    """Samples on their way.

    Attributes
    ----------
    run : str
        Another one each time acquisition begins anew, and with it the numbers of samples.
    """

    run: str
    chunk: DataChunk

    @property
    def nbytes(self) -> int:
        """Size by which a backlog is limited."""
        return self.chunk.volts.nbytes


@transferable
@dataclass(frozen=True, slots=True)
class DaqFolder:
    """A directory at the station.

    Attributes
    ----------
    problem : str
        Why nothing can be recorded there; empty when it can.
    free_bytes : int
        Room for recordings; 0 where there is a problem.
    """

    directory: str
    problem: str
    free_bytes: int


def plain_settings(settings: DaqcoSettings) -> dict[str, object]:
    """Return `settings` as plain values that travel."""
    return settings.model_dump(mode="json")


def settings_of(plain: dict[str, object]) -> DaqcoSettings:
    """Return the settings that `plain` says; raises `ConfigError` where they are none."""
    try:
        return DaqcoSettings.model_validate(plain)
    except ValueError as exc:
        raise ConfigError(f"these settings are not accepted: {exc}") from None


def checked_piece(payload: object) -> DaqPiece:
    """Return `payload` if it is samples that fit together.

    Raises
    ------
    ProtocolError
        It is not.
    """
    if not isinstance(payload, DaqPiece):
        raise ProtocolError(f"a {type(payload).__name__} came instead of samples")
    chunk = payload.chunk
    rows = len(chunk.channels)
    fits = chunk.volts.ndim == 2 and chunk.volts.shape[0] == rows == len(chunk.scales)
    if not (fits and chunk.volts.dtype == float and chunk.samples > 0 and chunk.rate_hz > 0.0):
        raise ProtocolError("samples came that do not fit together")
    return payload
