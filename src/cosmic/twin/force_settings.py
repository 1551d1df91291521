"""Constants of the twin's force side: geometry of the tools, fibres, contact, sensors."""

from typing import Literal, Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel

Role = Literal["single", "crossing", "stuck", "debris"]


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
        Of fibre and probe; and travel over which the friction turns round when the probe does.
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
    friction_turn_um: float = Field(default=0.3, gt=0.0)


class FibreSettings(StrictModel):
    """One fibre and where it is when the platform is found.

    Attributes
    ----------
    ei_n_m2, ea_n : float
        Bending and axial stiffness.
    ei_variation, ei_length_um : float
        By how much the bending stiffness varies along the fibre, as a part of it, and over which
        length; `ei_n_m2` is then that of a uniform fibre which gives way as much as a whole.
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
