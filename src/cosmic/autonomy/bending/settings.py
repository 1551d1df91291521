"""What the fit of a bend test is told about the instrument, and how much it may be wrong."""

from collections.abc import Mapping

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel


class FitSettings(StrictModel):
    """The instrument as the fit sees it.

    Attributes
    ----------
    sensor_un_um, sensor_std_part : float
        Stiffness of the force sensor, and its standard deviation as a part of it.
    range_un : float
        Force at which the sensor saturates.
    gain_std_part : float
        Standard deviation of the force's scale, as a part of it.
    gain_drift_std_part : float
        Of the change of that scale over a campaign.
    drift_un_sqrt_s : float
        Random walk of the sensor's zero.
    way_std_um, way_scale_std_part : float
        Of one reading of the probe's axis, and of the encoder's scale.
    contact_std_um : float
        How well the position of contact along the fibre repeats from span to span.
    contact_offset_std_um : float
        How far all positions of contact may be off in common: nominal position, place of the edge.
    offset_um, offset_std_um : float
        Mean and spread, before anything is measured, of how deep inside the tip of the jaws
        fibres are truly clamped. It cannot be negative; a campaign learns both.
    jaw_un_um, jaw_std_part : float
        Stiffness of the jaws across, and how uncertain what it gives way is, as a part of that.
    edge_radius_um, fibre_width_um : float
        The probe's round edge and the fibre: a sloping fibre touches nearer to the clamp.
    direction_std_deg : float
        Error of the direction in which the fibre leaves the jaws, as the image shows it.
    touch_std_um : float
        How well the place of the first contact across the fibre repeats.
    friction, friction_std : float
        Between probe and fibre.
    slides : bool
        The probe never sticks to fibres, whatever friction could hold; a campaign finds out.
    slides_std_part : float
        How far the probe may slide along the fibre where friction should hold it, as axes that
        move in steps shake it: 0 sticks, 1 slides at once; one standard deviation.
    askew_std : float
        Part of its compliance that friction takes on the way out, and adds on the way back, from
        a section that stands askew, where no slide showed it: its standard deviation over fibres.
    cross_std_part : float
        Of a force along the probe's edge, how much the sensor reads as one across.
    relaxation_part, relaxation_std_part : float
        Part of its force that a bent fibre loses in a tenfold time.
    side_un_um, side_std_part : float
        Stiffness of the probe along the fibre, and how uncertain what it gives way is, as a part
        of that.
    shear_part, shear_std_part : float
        What shear adds to the compliance of a span, over the square of the fibre's width by that of
        the span: 0.3 times E/G for a rectangular section as thick as it looks, less for a thinner
        one. A campaign learns it.
    shear_own_part : float
        By how much that differs between fibres, as a part of it: sections are no rectangles, and
        fibres are as wide as they lay, not as the jaws hold them.
    ei_length_um : float
        Length over which the stiffness of a fibre varies.
    reversal_um : float
        Play of the probe's axis when it turns back.
    soft_percent : float
        Half of the interval beyond which a result is too uncertain to be trusted.
    """

    sensor_un_um: float = Field(800.0, gt=0.0)
    sensor_std_part: float = Field(0.2, ge=0.0, le=1.0)
    range_un: float = Field(180.0, gt=0.0)
    gain_std_part: float = Field(0.025, ge=0.0, le=1.0)
    gain_drift_std_part: float = Field(0.005, ge=0.0, le=1.0)
    drift_un_sqrt_s: float = Field(0.02, ge=0.0)
    way_std_um: float = Field(0.05, ge=0.0)
    way_scale_std_part: float = Field(0.001, ge=0.0, le=1.0)
    contact_std_um: float = Field(1.0, gt=0.0)
    contact_offset_std_um: float = Field(3.0, ge=0.0)
    offset_um: float = Field(25.0, gt=0.0)
    offset_std_um: float = Field(25.0, gt=0.0)
    jaw_un_um: float = Field(1500.0, gt=0.0)
    jaw_std_part: float = Field(1.0, ge=0.0)
    edge_radius_um: float = Field(10.0, ge=0.0)
    fibre_width_um: float = Field(30.0, ge=0.0)
    direction_std_deg: float = Field(1.0, ge=0.0)
    touch_std_um: float = Field(0.5, gt=0.0)
    friction: float = Field(0.2, ge=0.0, lt=1.0)
    friction_std: float = Field(0.15, ge=0.0)
    slides: bool = False
    slides_std_part: float = Field(0.1, ge=0.0)
    askew_std: float = Field(0.2, ge=0.0, lt=1.0)
    cross_std_part: float = Field(0.02, ge=0.0)
    relaxation_part: float = Field(0.02, ge=0.0)
    relaxation_std_part: float = Field(0.03, ge=0.0)
    side_un_um: float = Field(10.0, gt=0.0)
    side_std_part: float = Field(0.5, ge=0.0)
    shear_part: float = Field(4.0, ge=0.0)
    shear_std_part: float = Field(1.5, ge=0.0)
    shear_own_part: float = Field(0.6, ge=0.0)
    ei_length_um: float = Field(150.0, gt=0.0)
    reversal_um: float = Field(0.3, ge=0.0)
    soft_percent: float = Field(30.0, gt=0.0)

    @model_validator(mode="before")
    @classmethod
    def _shear_as_it_was_kept(cls, data: object) -> object:
        """Take over what older records say of shear, in um2 and of any fibre."""
        if not isinstance(data, Mapping) or not {"shear_um2", "shear_std_um2"} & set(data):
            return data
        kept = dict(data)
        width_um = float(kept.get("fibre_width_um", 30.0))
        for old, new in (("shear_um2", "shear_part"), ("shear_std_um2", "shear_std_part")):
            if old in kept:
                kept[new] = float(kept.pop(old)) / width_um**2
        return kept

    @property
    def radius_um(self) -> float:
        """Of the rounding that the middle of the fibre goes round."""
        return self.edge_radius_um + self.fibre_width_um / 2.0
