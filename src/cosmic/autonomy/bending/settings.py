"""What the fit of a bend test is told about the instrument, and how much it may be wrong."""

from pydantic import Field

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
    drift_un_sqrt_s : float
        Random walk of the sensor's zero.
    way_std_um, way_scale_std_part : float
        Of one reading of the probe's axis, and of the encoder's scale.
    contact_std_um : float
        How well the position of contact along the fibre repeats from span to span.
    offset_um, offset_std_um : float
        What is known beforehand of the way from the tip of the jaws back to where the fibre is
        truly clamped, errors of `Span.nominal_um` included.
    edge_radius_um, fibre_width_um : float
        The probe's round edge and the fibre: a sloping fibre touches nearer to the clamp.
    hysteresis_percent, slip_um : float
        What loading and unloading may differ by, in force and in the position of first contact.
    soft_percent : float
        Half of the interval beyond which a result is too uncertain to be trusted.
    """

    sensor_un_um: float = Field(800.0, gt=0.0)
    sensor_std_part: float = Field(0.2, ge=0.0, le=1.0)
    range_un: float = Field(180.0, gt=0.0)
    gain_std_part: float = Field(0.01, ge=0.0, le=1.0)
    drift_un_sqrt_s: float = Field(0.02, ge=0.0)
    way_std_um: float = Field(0.05, ge=0.0)
    way_scale_std_part: float = Field(0.001, ge=0.0, le=1.0)
    contact_std_um: float = Field(1.0, gt=0.0)
    offset_um: float = 8.0
    offset_std_um: float = Field(8.0, gt=0.0)
    edge_radius_um: float = Field(10.0, ge=0.0)
    fibre_width_um: float = Field(30.0, ge=0.0)
    hysteresis_percent: float = Field(5.0, gt=0.0)
    slip_um: float = Field(1.0, gt=0.0)
    soft_percent: float = Field(30.0, gt=0.0)

    @property
    def radius_um(self) -> float:
        """Of the rounding that the middle of the fibre goes round."""
        return self.edge_radius_um + self.fibre_width_um / 2.0
