"""Settings of the operations that handle fibres; they are the parameters of a recipe."""

from collections.abc import Collection
from typing import Literal, Self

from pydantic import Field, model_validator

from cosmic.autonomy.bending.plan import SpanLimits
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.calibrating.settings import CalibrationSettings
from cosmic.frame.config import StrictModel, not_there


class PairSettings(StrictModel):
    """How two arms keep out of each other's way, each on its own side of the middle.

    Attributes
    ----------
    apart_um : float
        How far from the middle the tips of an arm stay at the plate and before the probe.
    behind_um : float
        How far behind that an arm waits with its fibre, and draws back to from the probe.
    beside_um : float
        How far beside the position before the probe it waits, towards the operator.
    hidden_um : float
        How far from there, towards the operator, fibres must lie to be taken while the other
        arm is there: nearer they may be hidden.
    probe_back_um : float
        How far the probe draws back between two fibres.
    stuck : int
        Fibres in a row that an arm cannot put away before it stands aside.
    """

    apart_um: float = Field(250.0, gt=0.0)
    behind_um: float = Field(4000.0, gt=0.0)
    beside_um: float = Field(1000.0, ge=0.0)
    hidden_um: float = Field(400.0, ge=0.0)
    probe_back_um: float = Field(1500.0, gt=0.0)
    stuck: int = Field(3, ge=1)


class PositionSettings(StrictModel):
    """Where things are done: positions of the middle between the jaws' tips, on the platform.

    Attributes
    ----------
    travel_um : float
        Height at which the jaws travel above the plate.
    grasp_um : float
        Height of the jaws' lower edge when they first close around a fibre on the plate.
    lower_um, raise_um, stray_um : float
        How true that height is nothing tells but grasps: after one that missed they are made so
        much lower, after one that held so much higher, and never further than `stray_um` from it.
    lowest_um : float
        Lowest height of the jaws' edge that is ordered where heights were measured: a touch of the
        plate stays as small as they are true.
    test_um, test_aside_um : float
        How high and how far aside a grasped fibre is carried to see whether it follows.
    hold_x_um, hold_y_um : float
        Where a fibre is held while the probe pushes it, x in the direction the gripper points to;
        the height is that of the probe.
    hold_above_tip_um : float
        How much higher than the jaws' lower edge they hold a fibre.
    bin_x_um, bin_y_um, bin_um : float
        Where fibres are put away, and from what height.
    view_x_um, view_y_um : float
        Where the empty jaws are looked at.
    away_x_um : float
        Out of the image, so that the whole sample can be seen.
    probe_away_y_um : float
        Position of the probe's tip while nothing is measured.
    """

    travel_um: float = Field(400.0, gt=0.0)
    grasp_um: float = 7.0
    lower_um: float = Field(3.0, ge=0.0)
    raise_um: float = Field(0.8, ge=0.0)
    stray_um: float = Field(18.0, ge=0.0)
    lowest_um: float = 3.0
    test_um: float = Field(120.0, gt=0.0)
    test_aside_um: float = Field(150.0, gt=0.0)
    hold_x_um: float = 0.0
    hold_y_um: float = 600.0
    hold_above_tip_um: float = 10.0
    bin_x_um: float = -9000.0
    bin_y_um: float = 0.0
    bin_um: float = Field(40.0, gt=0.0)
    view_x_um: float = -5600.0
    view_y_um: float = 0.0
    away_x_um: float = -9000.0
    probe_away_y_um: float = 6000.0


class GraspSettings(StrictModel):
    """How a fibre is chosen and taken up.

    Attributes
    ----------
    shortest_um, longest_um : float
        Length of fibres that are taken.
    curliest : float
        Largest curl of fibres that are taken: length over projected length, less one.
    least_probability : float
        Of fibres that are taken though it is not certain that they are seen as a whole; certain
        ones that are as free come first.
    views : int
        At how many angles of the table a plate is looked at, at most, before it is said that
        nothing is left.
    inside_um : float
        Length of fibre between the jaws.
    clear_um : float
        Room around a fibre, and under the jaws, without any other.
    gap_um : float
        Opening of the jaws when they come down.
    closing_um : float
        How much further than that they close, so that they are closed whatever a step is worth.
    full_um : float
        Opening of the jaws at the end of their travel.
    gripper_hz : float
        Frequency of the gripper's steps.
    close_enough_um : float
        How far beside the middle between the jaws a fibre may lie when they close.
    corrections : int
        How often their position is corrected by image.
    tries : int
        How often a grasp is tried.
    shift_um : float
        How far aside of the first try the second and third are made.
    follow_um : float
        How far beside where it was on the image before the fibre is looked for while the jaws come
        down, which follow it; 0: they come down without looking. At most `clear_um`, so that no
        other fibre is taken for it.
    follow_most_um : float
        How far in all they follow it; farther away the grasp is given up.
    hover_um : float
        Height of the jaws' lower edge at which they wait until the fibre is between them.
    descend_hz : float
        Closed-loop frequency of the gripper's height as they come down and follow, which limits
        the speed.
    reach_x_um, reach_y_um : float
        Largest x of a grasp, in the direction the gripper points to, and largest distance in y.
    largest_turn_deg : float
        How far the table may stand from zero.
    """

    shortest_um: float = Field(500.0, gt=0.0)
    longest_um: float = Field(4000.0, gt=0.0)
    curliest: float = Field(0.12, gt=0.0)
    least_probability: float = Field(0.5, ge=0.0, le=1.0)
    views: int = Field(3, ge=1, le=4)
    inside_um: float = Field(250.0, gt=0.0)
    clear_um: float = Field(55.0, gt=0.0)
    gap_um: float = Field(240.0, gt=0.0, le=1000.0)
    closing_um: float = Field(60.0, gt=0.0)
    full_um: float = Field(1000.0, gt=0.0)
    gripper_hz: float = Field(5000.0, gt=0.0, le=18500.0)
    close_enough_um: float = Field(25.0, gt=0.0)
    corrections: int = Field(3, ge=1, le=10)
    tries: int = Field(4, ge=1, le=10)
    shift_um: float = Field(30.0, ge=0.0)
    follow_um: float = Field(50.0, ge=0.0, le=200.0)
    follow_most_um: float = Field(200.0, gt=0.0, le=1000.0)
    hover_um: float = Field(60.0, gt=0.0)
    descend_hz: float = Field(1000.0, ge=1.0, le=18500.0)
    reach_x_um: float = 1400.0
    reach_y_um: float = Field(4300.0, gt=0.0)
    largest_turn_deg: float = Field(155.0, gt=0.0)

    @model_validator(mode="after")
    def _follows_one_fibre(self) -> Self:
        if "follow_um" in self.model_fields_set and not self.follow_um <= self.clear_um:
            raise ValueError("follow_um lies above clear_um: another fibre could be followed")
        return self

    @property
    def followed_um(self) -> float:
        """`follow_um`, and no more than `clear_um` where that alone was given."""
        return min(self.follow_um, self.clear_um)


class PushSettings(StrictModel):
    """How the probe looks for a fibre and pushes it.

    Attributes
    ----------
    channel : str
        Which force is felt.
    stand_off_um, bow_part : float
        How far from where the fibre should be the probe begins to look for it; and a part of how
        far the fibre is foreseen to bow on top.
    near_um : float
        The same where it was met at another span, beyond what is unsure of the place.
    slow_hz, surprise_un : float
        Closed-loop frequency of the probe as it comes near a fibre, which limits its speed, and the
        force above the baseline that ends that.
    reaction_s, stride_um : float
        How long it takes until a force that is felt has stopped the probe, and how far that goes
        for each step of its frequency: where a fibre may be, it goes only as fast as it can be
        stopped before the force is too high.
    search_um : float
        How far beyond where the fibre should be it looks.
    search_step_um : float
        Largest step of the search; stiffer fibres and shorter spans make it smaller.
    stiffest_ei_n_m2 : float
        Of the stiffest fibre there may be: what the steps of the first search are made for.
    contact_un : float
        Force above the baseline that means contact.
    limit_un : float
        No step is made that may lead beyond this force.
    stop_un : float
        Force limit of the acquisition that stops everything; 0: none is armed.
    quiet_un : float
        Readings that spread less than this come from a sensor that is dead: a living one has
        noise. 0: not looked at.
    settle_s, average_s : float
        Rest after a step, and the time over which the force is averaged.
    search_average_s : float
        The same while the fibre is looked for.
    steps_out, steps_back : int
        Steps of one push; the way back of a short stroke has a few more.
    dwell_s, dwell_looks : float, int
        How long the probe stays where it pushed farthest, and how often the force is read
        meanwhile: it shows how the fibre relaxes.
    slide_um, slide_every, slide_un : float, int, float
        How far a fibre that is pressed by a quarter of that, or by half of its push, is slid up and
        down the probe, and back to where it was, so that friction lets go of it (0: it is not); at
        every how many spans; and from which force above the baseline on.
    witness : bool
        The longest push is looked at in an image, before and at its end: the shape of the fibre
        there has to agree with the force.
    rest_s : float
        How long stages that came from far rest before the first push of a fibre.
    retreat_um : float
        How far the probe goes back from the fibre between spans.
    tilt_um, tilt_longest_um : float
        How much lower, then higher, a fibre is held that was not met, for it may point up or down:
        at the longest span then, and in proportion at shorter ones.
    steepest_deg : float
        Where a fibre slopes more before it is pushed, it is not pushed: it would slide along the
        probe.
    spans : SpanLimits
        What spans there may be.
    fit : FitSettings
        What the fit knows of the instrument.
    """

    channel: str = "force"
    stand_off_um: float = Field(40.0, gt=0.0)
    bow_part: float = Field(0.3, ge=0.0)
    near_um: float = Field(2.0, gt=0.0)
    slow_hz: float = Field(500.0, ge=1.0, le=18500.0)
    surprise_un: float = Field(6.0, gt=0.0)
    reaction_s: float = Field(0.03, gt=0.0)
    stride_um: float = Field(1.0, gt=0.0)
    search_um: float = Field(120.0, gt=0.0)
    search_step_um: float = Field(8.0, gt=0.0)
    stiffest_ei_n_m2: float = Field(4e-10, gt=0.0)
    contact_un: float = Field(0.6, gt=0.0)
    limit_un: float = Field(110.0, gt=0.0)
    stop_un: float = Field(140.0, ge=0.0)
    quiet_un: float = Field(0.03, ge=0.0)
    settle_s: float = Field(0.02, ge=0.0)
    average_s: float = Field(0.03, gt=0.0)
    search_average_s: float = Field(0.02, gt=0.0)
    steps_out: int = Field(9, ge=4)
    steps_back: int = Field(6, ge=3)
    dwell_s: float = Field(0.4, ge=0.0)
    dwell_looks: int = Field(2, ge=0)
    slide_um: float = Field(10.0, ge=0.0, le=20.0)
    slide_every: int = Field(2, ge=1)
    slide_un: float = Field(1.2, gt=0.0)
    witness: bool = True
    rest_s: float = Field(2.0, ge=0.0, le=60.0)
    retreat_um: float = Field(12.0, gt=0.0)
    tilt_um: float = Field(55.0, ge=0.0)
    tilt_longest_um: float = Field(330.0, gt=0.0)
    steepest_deg: float = Field(40.0, gt=0.0, le=50.0)
    spans: SpanLimits = Field(default_factory=SpanLimits)
    fit: FitSettings = Field(default_factory=FitSettings)


class StandardSettings(StrictModel):
    """A beam of certified stiffness that lies on the plate: bent like a fibre, and put back.

    Attributes
    ----------
    ei_n_m2 : float
        Bending stiffness by its certificate; 0: there is no standard.
    expanded_percent : float
        Expanded uncertainty of that, k = 2.
    certificate : str
        Number of the certificate, for the record.
    length_um, width_um : float
        By the length it is known on the plate; by the width it slides on the probe, shears and is
        strained.
    longest_um, longest_stroke_um : float
        Farthest position of the probe from the jaws, and longest push: more than those of fibres,
        as a standard is straight, and far out neither the clamp nor what gives way can be taken for
        its stiffness.
    x_um, y_um, within_um : float
        Where its middle lies on a plate that is put on, and how far from there it is looked for.
    at : tuple of str
        When it is measured; "plate" is on each further plate, before its fibres. What cannot be
        measured then is tried once more when the plate is worked off.
    """

    ei_n_m2: float = Field(0.0, ge=0.0)
    expanded_percent: float = Field(2.0, ge=0.0, lt=50.0)
    certificate: str = ""
    length_um: float = Field(2000.0, gt=0.0)
    width_um: float = Field(15.0, gt=0.0)
    longest_um: float = Field(900.0, gt=0.0)
    longest_stroke_um: float = Field(90.0, gt=0.0)
    x_um: float = 0.0
    y_um: float = -3900.0
    within_um: float = Field(800.0, gt=0.0)
    at: tuple[Literal["begin", "middle", "end", "plate"], ...] = Field(
        ("begin", "middle", "end"), strict=False
    )


class HandlingSettings(StrictModel):
    """All settings of the operations that handle fibres.

    Attributes
    ----------
    gripper, other : str
        Tool that takes fibres up, and the one that is parked; "" for none.
    probe : str
        Tool that pushes.
    camera : str
        Camera that looks; "" is the first.
    zoom : float
        Magnification of all images.
    frequency_hz : float
        Closed-loop frequency of all linear axes; it limits their speed.
    re_survey : int
        After so many fibres the sample is looked at again; 0: only when none is left.
    """

    gripper: Literal["left", "right"] = "left"
    other: str = "right"
    probe: str = "probe"
    camera: str = ""
    zoom: float = Field(0.58, gt=0.0)
    frequency_hz: float = Field(10000.0, ge=1.0, le=18500.0)
    re_survey: int = Field(0, ge=0)
    places: PositionSettings = Field(default_factory=PositionSettings)
    grasp: GraspSettings = Field(default_factory=GraspSettings)
    push: PushSettings = Field(default_factory=PushSettings)
    calibration: CalibrationSettings = Field(default_factory=CalibrationSettings)
    pair: PairSettings = Field(default_factory=PairSettings)
    standard: StandardSettings = Field(default_factory=StandardSettings)

    def misfits(
        self, *, tools: Collection[str], cameras: Collection[str], channels: Collection[str]
    ) -> list[str]:
        """Return a line for each name that a platform with these has not, with its key."""
        named = [
            ("gripper", "tool", self.gripper, tools),
            ("other", "tool", self.other, tools),
            ("probe", "tool", self.probe, tools),
            ("camera", "camera", self.camera, cameras),
            ("push.channel", "channel", self.push.channel, channels),
        ]
        optional = {"other", "camera"}
        return [
            f"{key}: {not_there(what, name, known)}"
            for key, what, name, known in named
            if name not in known and (name or key not in optional)
        ]


def of_arm(settings: HandlingSettings, gripper: str) -> HandlingSettings:
    """Return the settings of one of two arms.

    Each stays on its own side, so that neither is ever in the other's way. Fibres are let go
    from where the arms travel: the table, with all that stands up from it, turns below.
    """
    pair, positions, grasp = settings.pair, settings.places, settings.grasp
    own = {
        "hold_x_um": min(positions.hold_x_um, -pair.apart_um),
        "bin_um": max(positions.bin_um, positions.travel_um),
    }
    # Of two fibres, one before the probe and one drawn back, neither reaches the other.
    longest_um = pair.apart_um + pair.behind_um / 2.0 + grasp.inside_um
    sides = {
        "reach_x_um": min(grasp.reach_x_um, -pair.apart_um),
        "longest_um": min(grasp.longest_um, longest_um),
    }
    return settings.model_copy(
        update={
            "gripper": gripper,
            "other": "right" if gripper == "left" else "left",
            "places": positions.model_copy(update=own),
            "grasp": grasp.model_copy(update=sides),
        }
    )
