"""What is known before fibres are handled, and of the one that is being handled."""

from dataclasses import dataclass, field

from cosmic.autonomy.bending.result import BendingResult
from cosmic.autonomy.bending.span import Span
from cosmic.autonomy.calibrating.book import CalibrationBook
from cosmic.autonomy.handling.plate import PlateFrame, Reach
from cosmic.autonomy.handling.sight import SeenFibre
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.vico.core.picture import Picture
from cosmic.vico.core.pixel_map import Floats


@dataclass(frozen=True, slots=True)
class Measured:
    """One calibration: when it was made, on the platform's clock, and how well it fits.

    Attributes
    ----------
    residual : float
        RMS, in `unit`.
    """

    time_s: float
    residual: float
    unit: str


@dataclass(slots=True)
class Calibration:
    """What was measured before fibres are handled, by name, with when and how well.

    Attributes
    ----------
    frame : PlateFrame
        About which place the plate turns.
    probe_off_um : (float, float)
        How far the probe's tip is from where its stages say, in the frame of the gripper.
    seen_off_um : (float, float)
        The same as a picture showed it last: a touch tells it better, drift is told from this.
    drift_looked_at : int
        How many fibres were done with when drift was looked at last.
    touching : bool
        The probe has gone to a jaw, and not come back yet.
    up_um : dict of str to float
        How much higher above the plate the tip of each tool is than its stages say.
    book : CalibrationBook
        Where it is kept beyond this work.
    """

    made: dict[str, Measured] = field(default_factory=dict)
    frame: PlateFrame = field(default_factory=PlateFrame)
    probe_off_um: tuple[float, float] = (0.0, 0.0)
    seen_off_um: tuple[float, float] = (0.0, 0.0)
    drift_looked_at: int = 0
    touching: bool = False
    up_um: dict[str, float] = field(default_factory=dict)
    book: CalibrationBook = field(default_factory=CalibrationBook)

    def fresh(self, name: str, now_s: float, age_s: float) -> bool:
        """Return whether a calibration is there and not too old."""
        found = self.made.get(name)
        return found is not None and now_s - found.time_s <= age_s


@dataclass(slots=True, eq=False)
class FibreInHand:
    """The fibre that is being handled, as it becomes known.

    Attributes
    ----------
    reach : Reach
        How the gripper gets at it.
    seen : SeenFibre or None
        As it lay on the plate, turned for the gripper; its line begins where it is grasped.
    inside_um, free_um : float
        Length between the jaws and beyond them.
    shift_um : float
        How far aside of the middle this try grasps.
    zero_un : float or None
        The force without contact.
    tilts : int
        How often it was held at another height because it was not met.
    looks : int
        How often something was seen at the jaws that had opened.
    hand : str
        Which gripper holds it, where two are at work; empty otherwise.
    probe_from_s, probe_until_s : float or None
        When it had the probe to itself, where two hands are at work.
    stuck : bool
        It could not be put away.
    contacts : list of (float, float)
        Where along it, from the jaws, the probe has met it, and how far from where foreseen.
    """

    number: int
    reach: Reach
    seen: SeenFibre | None = None
    line_um: Floats | None = None
    line_px: Floats | None = None
    inside_um: float = 0.0
    free_um: float = 0.0
    tries: int = 0
    shift_um: float = 0.0
    held: bool = False
    contacts: list[tuple[float, float]] = field(default_factory=list)
    zero_un: float | None = None
    tilts: int = 0
    looks: int = 0
    ei_guess_n_m2: float | None = None
    spans: list[Span] = field(default_factory=list)
    pictures: dict[str, Picture] = field(default_factory=dict)
    bending: BendingResult | None = None
    peak_un: float = 0.0
    found_s: float = 0.0
    done_s: float = 0.0
    put_away: bool = False
    failure: OperationFailed | None = None
    hand: str = ""
    probe_from_s: float | None = None
    probe_until_s: float | None = None
    stuck: bool = False

    @property
    def length_um(self) -> float:
        """Along its centre line, as it lay on the plate."""
        return self.seen.length_um if self.seen is not None else self.reach.candidate.length_um

    @property
    def width_um(self) -> float:
        """Mean width, as it lay on the plate."""
        return self.seen.width_um if self.seen is not None else self.reach.candidate.width_um

    @property
    def curl(self) -> float:
        """Length over projected length, less one."""
        return self.seen.fibre.curl if self.seen is not None else self.reach.candidate.curl

    @property
    def length_std_um(self) -> float:
        """Standard deviation of the length; nan where nobody knows."""
        return (self.seen or self.reach.candidate).length_std_um

    @property
    def width_std_um(self) -> float:
        """Standard deviation of the width; nan where nobody knows."""
        return (self.seen or self.reach.candidate).width_std_um

    @property
    def curl_std(self) -> float:
        """Standard deviation of the curl; nan where nobody knows."""
        return (self.seen or self.reach.candidate).curl_std
