"""What lies on the plate, described by how it is spread rather than piece by piece."""

from typing import Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel


class SampleSettings(StrictModel):
    """A plate with fibres of one pulp; the twin's seed and `seed` decide which and where.

    Lengths, widths and stiffness are lognormal: a median, and the standard deviation of the
    logarithm.

    Attributes
    ----------
    single, crossing, stuck : int
        Fibres that lie alone, pairs of which one lies over the other, and pairs that lie along
        each other.
    debris : int
        Short broken pieces.
    length_low_um, length_high_um, ei_low_n_m2 : float
        What lies outside is drawn again.
    wall_um : float
        Of the two walls that lie on each other when the lumen has collapsed.
    elastic_gpa : float
        Of the wall along the fibre; with width and thickness it gives the axial stiffness.
    curl_deg, kink_deg : float
        By how much fibres turn from end to end, and kinked ones in their middle; standard
        deviations.
    kinked : float
        The part of fibres with a kink.
    crossing_un, stuck_un : float
        Median pull at which one fibre comes off the other.
    radius_um : float
        Everything lies within this distance of the plate's middle.
    distance_um : float
        Between fibres that do not touch, from edge to edge.
    gap_um : float
        How far the grippers stand open; they hold nothing.
    faults : bool
        Handling goes wrong now and then, as `[handling]` has it.
    """

    seed: int = 0
    single: int = Field(ge=0, le=500)
    crossing: int = Field(default=0, ge=0, le=100)
    stuck: int = Field(default=0, ge=0, le=100)
    debris: int = Field(default=0, ge=0, le=500)
    length_um: float = Field(default=1400.0, gt=0.0)
    length_sigma_ln: float = Field(default=0.25, ge=0.0, le=2.0)
    length_low_um: float = Field(default=800.0, gt=0.0)
    length_high_um: float = Field(default=2600.0, gt=0.0)
    width_um: float = Field(default=32.0, gt=0.0)
    width_sigma_ln: float = Field(default=0.15, ge=0.0, le=1.0)
    wall_um: float = Field(default=4.0, gt=0.0)
    ei_n_m2: float = Field(default=5e-11, gt=0.0)
    ei_sigma_ln: float = Field(default=0.55, ge=0.0, le=3.0)
    ei_low_n_m2: float = Field(default=0.0, ge=0.0)
    elastic_gpa: float = Field(default=30.0, gt=0.0)
    curl_deg: float = Field(default=25.0, ge=0.0, le=60.0)
    kinked: float = Field(default=0.0, ge=0.0, le=1.0)
    kink_deg: float = Field(default=30.0, ge=0.0, le=60.0)
    crossing_un: float = Field(default=20.0, gt=0.0)
    stuck_un: float = Field(default=3000.0, gt=0.0)
    debris_um: float = Field(default=120.0, gt=0.0)
    radius_um: float = Field(default=4000.0, gt=0.0, le=12_000.0)
    distance_um: float = Field(default=150.0, ge=0.0)
    gap_um: float = Field(default=600.0, gt=0.0)
    faults: bool = True

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.length_low_um <= self.length_um <= self.length_high_um:
            raise ValueError("length_low_um, length_um and length_high_um must rise")
        if not self.length_high_um < 2.0 * self.radius_um:
            raise ValueError("length_high_um is more than the region of radius_um is wide")
        if not self.ei_low_n_m2 <= self.ei_n_m2:
            raise ValueError("ei_low_n_m2 lies above ei_n_m2")
        return self
