"""Constants of the twin's force side: geometry of the tools, fibres, contact, sensors."""

import math
from typing import Literal, Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel

Role = Literal["single", "crossing", "stuck", "debris", "standard"]


class JointDrive(StrictModel):
    """Which stage moves a joint of the URDF, and how far for one unit of its own way."""

    stage: str
    factor: float = 1.0


class GripperGeometry(StrictModel):
    """One gripper: its stage and its two jaws, links whose frame is the tip's inner lower edge.

    Attributes
    ----------
    stage : str
        The stage that opens it; its position is the gap between the jaws.
    """

    stage: str
    jaws: tuple[str, str] = Field(strict=False)


class GeometrySettings(StrictModel):
    """Which file says where everything is, and what the file does not say.

    Attributes
    ----------
    urdf : str
        Relative to the folder of twin.toml.
    probe, plate : str
        Links; the frame of the probe is its tip, that of the plate lies on its surface.
    hold_height_um : float
        How high above the jaws' lower edge a fibre is held.
    probe_contact_um : float
        How far the place where the probe touches is from the middle of its tip, in x: no image
        shows it.
    """

    urdf: str
    joints: dict[str, JointDrive]
    grippers: dict[str, GripperGeometry]
    probe: str
    plate: str
    probe_half_width_um: float = Field(gt=0.0)
    probe_edge_radius_um: float = Field(ge=0.0)
    jaw_length_um: float = Field(gt=0.0)
    jaw_thickness_um: float = Field(gt=0.0)
    jaw_height_um: float = Field(gt=0.0)
    hold_height_um: float = Field(ge=0.0)
    probe_contact_um: float = 0.0


class ContactSettings(StrictModel):
    """What happens where things touch.

    Attributes
    ----------
    step_s : float
        How often contact is looked at.
    pull_off_un : float
        Adhesion between fibre and probe.
    gripper_un_um : float
        Stiffness of a gripper along a fibre; 1 uN/um is 1 N/m.
    grip_limit_un : float
        Pull at which a fibre slips in the jaws.
    grasp_height_um, grasp_angle_deg : float
        How far off a fibre may lie and still be taken.
    clamp_depth_um, clamp_depth_spread_um : float
        How far inside the jaws' tip a fibre is really held; drawn anew for each grasp.
    jaw_side_un_um, jaw_turn_deg : float
        Stiffness of closed jaws across, and by how much 1000 uN um turn a fibre in them.
    probe_friction, friction_turn_um : float
        Of fibre and probe; and by how much the contact itself gives along the fibre while its
        friction turns round, besides what probe and fibre give: some nm on stiff walls.
    clamp_depth_sigma_ln : float
        Above 0: the depth is lognormal, with `clamp_depth_um` as its median.
    clamp_depth_per_grasp_um : float
        So much deeper each time that the same fibre is taken: the jaws crush it.
    probe_side_un_um : float
        Stiffness of the probe along the fibre.
    jaw_grip_un, jaw_grip_sigma_ln : float
        Pull out of the jaws at which a fibre slips while it is lifted: median, and standard
        deviation of the logarithm from grasp to grasp.
    roll_share : float
        Part of the grasps in which a ribbon rolls in the jaws, to any angle.
    """

    step_s: float = Field(ge=1e-5, le=0.01)
    pull_off_un: float = Field(ge=0.0)
    gripper_un_um: float = Field(gt=0.0)
    grip_limit_un: float = Field(gt=0.0)
    grasp_height_um: float = Field(gt=0.0)
    grasp_angle_deg: float = Field(gt=0.0, lt=90.0)
    clamp_depth_um: float = Field(ge=0.0)
    clamp_depth_spread_um: float = Field(ge=0.0)
    jaw_side_un_um: float = Field(default=1e9, gt=0.0)
    jaw_turn_deg: float = Field(default=0.0, ge=0.0)
    probe_friction: float = Field(default=0.0, ge=0.0, lt=1.0)
    friction_turn_um: float = Field(default=0.02, gt=0.0)
    clamp_depth_sigma_ln: float = Field(default=0.0, ge=0.0, le=2.0)
    clamp_depth_per_grasp_um: float = Field(default=0.0, ge=0.0)
    probe_side_un_um: float = Field(default=1e9, gt=0.0)
    jaw_grip_un: float = Field(default=1e9, gt=0.0)
    jaw_grip_sigma_ln: float = Field(default=0.0, ge=0.0, le=2.0)
    roll_share: float = Field(default=0.0, ge=0.0, le=1.0)


class FibreSettings(StrictModel):
    """One fibre and where it is when the platform is found.

    Attributes
    ----------
    ei_n_m2, ea_n : float
        Bending and axial stiffness.
    ei_variation, ei_length_um : float
        By how much the bending stiffness varies along the fibre, as a part of it, and over which
        length; `ei_n_m2` is then that of a uniform fibre which gives way as much as a whole.
    hinges_per_mm, hinge_part : float
        Weak places along it, and what is left of the stiffness there.
    plane_ratio : float
        Bending stiffness edge way, in that of the flat way, which is `ei_n_m2`.
    orientation_deg, twist_deg_mm : float
        By how much the section is turned in the plane of bending, at the first end and along
        the fibre; 0 bends flat way.
    thick_as_wide : bool
        Bent, it is as thick in the plane of bending as it looks wide, which one that is as stiff in
        all planes should be; else `thickness_um`. A ribbon always is.
    shear_ratio : float
        Modulus along the fibre over that of shear; 0: it does not shear.
    relaxation_per_decade : float
        Part of the force that goes in each decade of time.
    yield_strain : float
        At the surface; more sets for good.
    ei_per_rh : float
        Change of the stiffness for each per cent of humidity from 50 %, as a part.
    adhesion_un_mm : float
        Pull-off from the plate for each millimetre, at 50 % humidity.
    charge_uc_m2 : float
        Charge of its surface.
    held_by : str
        A gripper whose gap is not wider than the fibre; "" and it lies on the plate, as it does
        when that gripper is found open.
    free_um : float
        How much of a held fibre stands out of the jaws.
    x_um, y_um, angle_deg : float
        Middle and direction on the plate.
    curl_deg, kink_deg : float
        By how much it turns, evenly from end to end and at once in its middle.
    role : str
        What it is to somebody who wants single fibres: told in the truth, without effect.
    bonded_to : int or None
        Number of a fibre before it that it lies on or along.
    bond_un : float
        Pull at which the two come apart.
    """

    length_um: float = Field(gt=0.0)
    width_um: float = Field(gt=0.0)
    thickness_um: float = Field(gt=0.0)
    ei_n_m2: float = Field(gt=0.0)
    ea_n: float = Field(gt=0.0)
    ei_variation: float = Field(default=0.0, ge=0.0, le=1.0)
    ei_length_um: float = Field(default=150.0, gt=0.0)
    hinges_per_mm: float = Field(default=0.0, ge=0.0, le=50.0)
    hinge_part: float = Field(default=0.3, gt=0.0, le=1.0)
    plane_ratio: float = Field(default=1.0, ge=1.0, le=100.0)
    orientation_deg: float = 0.0
    twist_deg_mm: float = 0.0
    thick_as_wide: bool = False
    shear_ratio: float = Field(default=0.0, ge=0.0)
    relaxation_per_decade: float = Field(default=0.0, ge=0.0, le=0.3)
    yield_strain: float = Field(default=1.0, gt=0.0)
    ei_per_rh: float = Field(default=0.0, gt=-0.02, lt=0.02)
    adhesion_un_mm: float = Field(default=0.0, ge=0.0)
    charge_uc_m2: float = 0.0
    held_by: str = ""
    free_um: float = Field(default=0.0, ge=0.0)
    x_um: float = 0.0
    y_um: float = 0.0
    angle_deg: float = 0.0
    curl_deg: float = Field(default=0.0, gt=-180.0, lt=180.0)
    kink_deg: float = Field(default=0.0, gt=-120.0, lt=120.0)
    role: Role = "single"
    bonded_to: int | None = Field(default=None, ge=0)
    bond_un: float = Field(default=0.0, ge=0.0)

    @model_validator(mode="after")
    def _partly_inside(self) -> Self:
        if not self.free_um < self.length_um:
            raise ValueError("free_um must be less than length_um: the jaws hold the rest")
        return self


class ForceSensorSettings(StrictModel):
    """One capacitive force sensor and its amplifier.

    Attributes
    ----------
    mounted_on : str
        "probe", or "" for a sensor that nothing touches.
    noise_un : float
        Standard deviation after the bandwidth.
    drift_un_sqrt_s : float
        Standard deviation of the random walk of the zero after one second.
    gain_error, zero_error_v : float
        Standard deviations of the differences between this sensor and its data sheet.
    linearity, hysteresis : float
        By how much the gain changes from nothing to the end of the range, and by how much
        signals of a growing and a falling force differ at most, as a part of the range.
    cross_talk, axial_talk : float
        Standard deviations of what a load along the fibre, and one along the world's z, adds to
        the signal, as a part of it.
    gain_ppm_k, zero_un_k : float
        Standard deviations of how gain and zero follow the room's temperature.
    warm_up_un, warm_up_s : float
        By how much the zero is off when the sensor is switched on, and how fast that goes.
    corner_hz : float
        Below, the noise grows as the frequency falls.
    """

    mounted_on: str
    range_un: float = Field(gt=0.0)
    gain_v_un: float = Field(gt=0.0)
    zero_v: float
    gain_error: float = Field(ge=0.0, lt=0.2)
    zero_error_v: float = Field(ge=0.0)
    noise_un: float = Field(ge=0.0)
    drift_un_sqrt_s: float = Field(ge=0.0)
    bandwidth_hz: float = Field(gt=0.0)
    stiffness_un_um: float = Field(gt=0.0)
    linearity: float = Field(default=0.0, gt=-0.2, lt=0.2)
    hysteresis: float = Field(default=0.0, ge=0.0, lt=0.1)
    cross_talk: float = Field(default=0.0, ge=0.0, lt=0.5)
    axial_talk: float = Field(default=0.0, ge=0.0, lt=0.5)
    gain_ppm_k: float = Field(default=0.0, ge=0.0, lt=1e5)
    zero_un_k: float = Field(default=0.0, ge=0.0)
    warm_up_un: float = Field(default=0.0, ge=0.0)
    warm_up_s: float = Field(default=1200.0, gt=0.0)
    corner_hz: float = Field(default=0.0, ge=0.0)


class StandardSettings(StrictModel):
    """A glass fibre of known stiffness that lies on each plate, to be taken and bent like others.

    Attributes
    ----------
    diameter_um, modulus_gpa : float
        As its certificate has them.
    expanded_percent : float
        Expanded uncertainty (k = 2) of the bending stiffness that follows: the true one is drawn.
    length_um : float
    x_um, y_um, angle_deg : float
        Where it lies on a plate that is put on: middle and direction.
    """

    diameter_um: float = Field(gt=0.0)
    modulus_gpa: float = Field(gt=0.0)
    expanded_percent: float = Field(ge=0.0, lt=50.0)
    length_um: float = Field(gt=0.0)
    x_um: float = 0.0
    y_um: float = 0.0
    angle_deg: float = 0.0

    @property
    def ei_n_m2(self) -> float:
        """Bending stiffness of the certificate: modulus times pi d^4 / 64."""
        return self.modulus_gpa * 1e9 * math.pi * (self.diameter_um * 1e-6) ** 4 / 64.0


class PlateSettings(StrictModel):
    """The plate and its exchange.

    Attributes
    ----------
    exchange_s : float
        Until another plate lies there and is at rest.
    clear_um : float
        The jaws must stand so high above it meanwhile.
    """

    exchange_s: float = Field(default=420.0, ge=0.0)
    clear_um: float = Field(default=300.0, ge=0.0)


class ClimateSettings(StrictModel):
    """The air of the room.

    Attributes
    ----------
    rh_percent, rh_wander_percent, rh_period_s : float
        Relative humidity at the start, by how much it goes up and down, and in which time.
    temperature_wander_k, temperature_period_s : float
        The same of the temperature, against that of the start.
    """

    rh_percent: float = Field(default=50.0, ge=0.0, le=95.0)
    rh_wander_percent: float = Field(default=0.0, ge=0.0, le=40.0)
    rh_period_s: float = Field(default=7200.0, gt=0.0)
    temperature_wander_k: float = Field(default=0.0, ge=0.0, le=10.0)
    temperature_period_s: float = Field(default=2400.0, gt=0.0)
