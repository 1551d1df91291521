"""`HeldFibre`: the fibre that is being handled, as it becomes known."""

from dataclasses import dataclass, field

from cosmic.autonomy.bending.fit import MeasuredFibre
from cosmic.autonomy.bending.result import BendingResult
from cosmic.autonomy.bending.span import Span
from cosmic.autonomy.handling.plate import Reach
from cosmic.autonomy.handling.sight import SeenFibre
from cosmic.autonomy.handling.surface import Contact
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.frame.arrays import Floats
from cosmic.vico.core.image import CameraImage


@dataclass(slots=True, eq=False)
class HeldFibre:
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
    nearer : bool
        A standard that was not met far from the jaws: it is pushed where fibres are.
    tilts : int
        How often it was held at another height because it was not met.
    looks : int
        How often something was seen at the jaws that had opened.
    arm : str
        Which gripper holds it, where two are at work; empty otherwise.
    probe_from_s, probe_until_s : float or None
        When it had the probe to itself, where two arms are at work.
    slid_off : bool
        It left the probe as it was slid up and down: that is not done again.
    stuck : bool
        It could not be put away.
    closed_at_um : float
        What was counted as the opening when the jaws had closed around it.
    doubted : bool
        The jaws were opened since, by no operation: whether it is still held is not known.
    standard : bool
        It is the standard: it is put back where it lay.
    measured : MeasuredFibre or None
        Its spans as they were fitted, each by itself.
    contacts : list of Contact
        Where the probe has met it in this grip.
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
    contacts: list[Contact] = field(default_factory=list)
    zero_un: float | None = None
    nearer: bool = False
    tilts: int = 0
    looks: int = 0
    ei_guess_n_m2: float | None = None
    spans: list[Span] = field(default_factory=list)
    images: dict[str, CameraImage] = field(default_factory=dict)
    measured: MeasuredFibre | None = None
    bending: BendingResult | None = None
    peak_un: float = 0.0
    found_s: float = 0.0
    done_s: float = 0.0
    put_away: bool = False
    failure: OperationFailed | None = None
    arm: str = ""
    probe_from_s: float | None = None
    probe_until_s: float | None = None
    slid_off: bool = False
    stuck: bool = False
    closed_at_um: float = 0.0
    doubted: bool = False
    standard: bool = False

    def opened_um(self, counted_um: float) -> float:
        """Return how far the jaws are open since they had closed around it."""
        return max(0.0, counted_um - self.closed_at_um)

    def note_opening(self, counted_um: float) -> None:
        """Doubt that it is held once the jaws were opened by more than it is wide."""
        if self.held and not self.opened_um(counted_um) <= self.width_um:
            self.doubted = True

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
    def probability(self) -> float:
        """Of one whole fibre, as it was seen; nan where that was certain in the survey alone."""
        if self.seen is not None:
            return self.seen.fibre.probability
        return self.reach.candidate.probability

    @property
    def width_std_um(self) -> float:
        """Standard deviation of the width; nan where nobody knows."""
        return (self.seen or self.reach.candidate).width_std_um

    @property
    def curl_std(self) -> float:
        """Standard deviation of the curl; nan where nobody knows."""
        return (self.seen or self.reach.candidate).curl_std
