"""What a campaign keeps of itself and of each fibre."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.autonomy.bending.result import BendingResult
from cosmic.autonomy.bending.span import Span
from cosmic.frame.arrays import Floats
from cosmic.frame.errors import CosmicError
from cosmic.frame.renamed import Renamed

Image = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]
Value = str | int | float | bool | None

TWIN: Final = "digital twin"
"""What a campaign without hardware was made on."""
NOT_TRUSTED: Final = "not trusted"
"""Cause of a fibre whose result may not be used."""
FIBRE: Final = "fibre"
STANDARD: Final = "standard"
CERTAIN: Final = 0.999
"""From this probability on vision calls a fibre certain."""
UNRESOLVED: Final = 0.12
"""A width that is known no better than to this part of it was not resolved."""


class CampaignError(CosmicError):
    """A campaign's folder cannot be written or read; the text names it and what to do."""


class Outcome(StrEnum):
    """How a fibre's treatment ended."""

    RUNNING = "running"
    GOOD = "good"
    DOUBTFUL = "measured, not trusted"
    FAILED = "failed"
    INTERRUPTED = "interrupted"


FINISHED = frozenset({Outcome.GOOD, Outcome.DOUBTFUL, Outcome.FAILED})


@dataclass(frozen=True, slots=True)
class Pose:
    """Where the middle of a fibre lies on the plate, and how it is turned.

    In the coordinates of the plate, which turn with the table: they stay true when it turns.
    """

    x_plate_um: float
    y_plate_um: float
    angle_deg: float


@dataclass(frozen=True, slots=True)
class Shape:
    """What the image says about a fibre; nan where it was not measured.

    Attributes
    ----------
    curl : float
        Length over the distance of the ends, less one.
    length_std_um, width_std_um, curl_std : float
        Standard deviations.
    probability : float
        That it is one whole fibre: where it is not certain, the length may be that of a part.
    """

    length_um: float = math.nan
    length_std_um: float = math.nan
    width_um: float = math.nan
    curl: float = math.nan
    width_std_um: float = math.nan
    curl_std: float = math.nan
    probability: float = math.nan

    @property
    def doubted(self) -> bool:
        """It is known, and not certain, that it is one whole fibre."""
        return self.probability < CERTAIN

    @property
    def width_resolved(self) -> bool:
        """Whether the image shows the width, and not only that it is small."""
        return self.width_std_um <= UNRESOLVED * self.width_um


@dataclass(frozen=True, slots=True)
class OperationRecord:
    """One try of one operation; times on the platform's clock."""

    name: str
    began_s: float
    ended_s: float
    attempt: int = 1
    cause: str = ""
    text: str = ""

    @property
    def failed(self) -> bool:
        """Whether it did not do what it should."""
        return bool(self.cause)


@dataclass(frozen=True, slots=True, eq=False)
class FibreImage:
    """One image with what is needed to measure on it.

    Attributes
    ----------
    name : str
        What it shows, such as "before grasp".
    pixels : ndarray, shape (height, width), uint8 or uint16
    scale_um_px : float
        nan where it is not known.
    region_px : tuple of four int
        Left, top, width and height of what it is about; None: all of it.
    """

    name: str
    pixels: Image
    taken_s: float
    scale_um_px: float = math.nan
    zoom: float = math.nan
    focus_um: float = math.nan
    light_percent: float = math.nan
    region_px: tuple[int, int, int, int] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Values over time, such as the positions of an axis or the force.

    Attributes
    ----------
    unit : str
        Of the values, "um" or "uN".
    time_s, values : ndarray, shape (n,), float64
        Times are on the platform's clock.
    """

    name: str
    unit: str
    time_s: Floats
    values: Floats


@dataclass(frozen=True, slots=True, eq=False)
class FibreRecord:
    """All that is kept of one fibre; times are on the platform's clock.

    Attributes
    ----------
    number : int
        As `CampaignStore.begin_fibre` gave it.
    outcome : Outcome
    cause, text : str
        Why it failed: short and the same for all failures of a kind, and in full.
    found, left : Pose
        Where it lay, and where it was put; None where that is not known.
    bending : BendingResult
        None where it was not measured.
    role : str
        "fibre", or "standard": one of those is no fibre of the sample.
    elapsed_s : float
        When it was found, since the campaign began, all runs together.
    plate : int
        On which it lay, from 1 on.
    """

    number: int
    outcome: Outcome
    began_s: float
    ended_s: float
    found: Pose | None = None
    left: Pose | None = None
    shape: Shape = Shape()
    cause: str = ""
    text: str = ""
    attempts: int = 1
    peak_force_un: float = math.nan
    bending: BendingResult | None = None
    spans: tuple[Span, ...] = ()
    images: tuple[FibreImage, ...] = ()
    pictures = Renamed("images")
    operations: tuple[OperationRecord, ...] = ()
    series: tuple[Series, ...] = ()
    role: str = FIBRE
    elapsed_s: float = math.nan
    plate: int = 1

    @property
    def duration_s(self) -> float:
        """How long it took."""
        return self.ended_s - self.began_s


@dataclass(frozen=True, slots=True)
class Sighting:
    """What the first survey of a plate saw of one fibre.

    Attributes
    ----------
    plate : int
        From 1 on.
    x_plate_um, y_plate_um : float
        Its middle.
    problem : str
        Why it could not be taken as it lay, such as "crossing"; empty: it could.
    """

    plate: int
    x_plate_um: float
    y_plate_um: float
    length_um: float
    width_um: float
    curl: float
    problem: str = ""


@dataclass(frozen=True, slots=True)
class PlateChange:
    """A change of the plate.

    Attributes
    ----------
    plate : int
        Number of the one that is put there, from 2 on.
    run : int
        Start of the program in which it was asked for.
    asked_s, put_s : float
        When it was asked for and when it was there, on the clock of that run; `put_s` is nan where
        nobody has said so.
    by : str
        Who puts it there.
    """

    plate: int
    run: int
    asked_s: float
    put_s: float = math.nan
    by: str = ""

    @property
    def over(self) -> bool:
        """Whether it is known that the plate is there."""
        return math.isfinite(self.put_s)


@dataclass(frozen=True, slots=True)
class CalibrationNote:
    """One calibration in force.

    Attributes
    ----------
    residual, unit : float, str
        How well it fits, such as 0.4 "um".
    made : str
        When, ISO 8601.
    age_s : float
        How old it was in the end, on the platform's clock; nan where that is not known.
    """

    name: str
    residual: float
    unit: str
    made: str
    age_s: float = math.nan


@dataclass(frozen=True, slots=True)
class CampaignInfo:
    """What a campaign is.

    Attributes
    ----------
    recipe_text : str
        The recipe file as it was read.
    started : str
        ISO 8601, local time with its zone.
    versions : mapping
        Of CoSMic and the packages it stands on.
    hardware : str
        "digital twin" or the platform's name.
    world : str
        The twin's; empty on hardware, and in campaigns from before it was kept.
    """

    name: str
    procedure: str
    sample: str
    recipe_text: str
    started: str
    description: str = ""
    operator: str = ""
    hardware: str = TWIN
    seed: int = 0
    rate: float = 1.0
    versions: Mapping[str, str] = field(default_factory=dict)
    world: str = ""


@dataclass(frozen=True, slots=True)
class JournalEntry:
    """One line of the journal."""

    number: int
    fibre: int | None
    time_s: float
    operation: str
    phase: str
    payload: Mapping[str, Value]
