"""What goes wrong, and how often, when fibres are taken, carried and put away."""

from typing import Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel


class HandlingSettings(StrictModel):
    """How fibres behave in the hand.

    Adhesion to the plate, breaking, hanging on to a partner and what frees a fibre from a jaw
    always hold. The rates, tilt, drift and mounting errors hold where faults are on: by
    `default_faults`, or by `faults` of the sample.

    Attributes
    ----------
    default_faults : bool
        With the fibres that twin.toml lists.
    missed_grasp, slip_in_lift, drop, jaw_adhesion, out_of_plane : float
        How often jaws close without taking a fibre they enclose, lose it while lifting, lose it
        later, keep it when they open, and hold it out of the plane; for each grasp.
    loose_grip, fibre_break : float
        How often a grip gives way, and a fibre breaks, when it is bent as a measurement does.
    slip_low_um, slip_high_um : float
        Height at which it slips in lifting.
    drop_low_um, drop_high_um : float
        Way after lifting at which it is dropped.
    tilt_deg, out_of_plane_deg : float
        Standard deviations of how far a held fibre points up or down, usually and out of plane.
    break_strain : float
        Strain at the clamp at which any fibre breaks.
    weak_strain_low, weak_strain_high : float
        The same where a grip gives way, or a fibre breaks, early.
    loosen_low_um, loosen_high_um : float
        By how much further inside the jaws the fibre is held then.
    adhesion_un, adhesion_sigma_ln : float
        Energy of adhesion to the plate for each length, uN um/um; lognormal.
    partner_un : float
        Pull that takes a lying fibre off the plate.
    fall_um, fall_part, fall_deg : float
        How far aside a fibre lands that is let go: at least, for each um of height, and turned;
        standard deviations. From less than `fall_um` above the plate it stays where it is.
    shake_um, shake_frees : float
        A turning point of a gripper's movement, so far from the last, frees a fibre that sticks so
        often.
    wipe_um, wipe_frees : float
        The same of so much way along the plate.
    drift_um, drift_period_s : float
        Tools wander against plate and camera by up to this, and about that slowly.
    tool_offset_um : float
        How far a tip really is from where its drawing has it; standard deviation.
    landing_um : float
        Jaws may press on the plate so deep without harm.
    touch_um : float
        The probe may press on a jaw so far without harm to its sensor.
    """

    default_faults: bool = False
    missed_grasp: float = Field(default=0.08, ge=0.0, le=1.0)
    slip_in_lift: float = Field(default=0.05, ge=0.0, le=1.0)
    drop: float = Field(default=0.01, ge=0.0, le=1.0)
    jaw_adhesion: float = Field(default=0.06, ge=0.0, le=1.0)
    out_of_plane: float = Field(default=0.01, ge=0.0, le=1.0)
    loose_grip: float = Field(default=0.012, ge=0.0, le=1.0)
    fibre_break: float = Field(default=0.008, ge=0.0, le=1.0)
    slip_low_um: float = Field(default=20.0, ge=0.0)
    slip_high_um: float = Field(default=300.0, ge=0.0)
    drop_low_um: float = Field(default=200.0, ge=0.0)
    drop_high_um: float = Field(default=4000.0, ge=0.0)
    tilt_deg: float = Field(default=0.5, ge=0.0, le=45.0)
    out_of_plane_deg: float = Field(default=10.0, ge=0.0, le=45.0)
    break_strain: float = Field(default=0.08, gt=0.0)
    weak_strain_low: float = Field(default=0.0008, gt=0.0)
    weak_strain_high: float = Field(default=0.004, gt=0.0)
    loosen_low_um: float = Field(default=20.0, ge=0.0)
    loosen_high_um: float = Field(default=80.0, ge=0.0)
    adhesion_un: float = Field(default=0.05, gt=0.0)
    adhesion_sigma_ln: float = Field(default=0.7, ge=0.0, le=3.0)
    partner_un: float = Field(default=60.0, ge=0.0)
    fall_um: float = Field(default=15.0, ge=0.0)
    fall_part: float = Field(default=0.05, ge=0.0, le=1.0)
    fall_deg: float = Field(default=5.0, ge=0.0, le=90.0)
    shake_um: float = Field(default=3.0, gt=0.0)
    shake_frees: float = Field(default=0.15, ge=0.0, le=1.0)
    wipe_um: float = Field(default=100.0, gt=0.0)
    wipe_frees: float = Field(default=0.7, ge=0.0, le=1.0)
    drift_um: float = Field(default=8.0, ge=0.0, le=500.0)
    drift_period_s: float = Field(default=3600.0, gt=0.0)
    tool_offset_um: float = Field(default=4.0, ge=0.0, le=500.0)
    landing_um: float = Field(default=5.0, ge=0.0)
    touch_um: float = Field(default=0.2, ge=0.0)

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for what in ("slip", "drop", "loosen"):
            low, high = getattr(self, f"{what}_low_um"), getattr(self, f"{what}_high_um")
            if not low <= high:
                raise ValueError(f"{what}_low_um lies above {what}_high_um")
        if not self.weak_strain_low <= self.weak_strain_high:
            raise ValueError("weak_strain_low lies above weak_strain_high")
        return self
