"""What platform.toml says about control loops."""

from pydantic import Field

from cosmic.frame.config import StrictModel


class ControlSettings(StrictModel):
    """Section ``[control]`` of platform.toml."""

    rate_hz: float = Field(default=200.0, ge=10.0, le=1000.0)
    real_time: bool = True
    priority: int = Field(default=10, ge=1, le=99)
    stale_s: float = Field(default=0.5, gt=0.0, le=30.0)
    latency_s: float = Field(default=0.05, ge=0.02, le=0.5)
    response_s: float = Field(default=0.2, ge=0.1, le=60.0)
    travel_um: float = Field(default=500.0, gt=0.0)
    speed_um_s: float = Field(default=50.0, gt=0.0)
    approach_um_s: float = Field(default=20.0, gt=0.0)
    stiffness_un_um: float = Field(default=20.0, gt=0.0)
    contact_un: float = Field(default=3.0, gt=0.0)
    ramp_un_s: float = Field(default=50.0, gt=0.0)
    tolerance_un: float = Field(default=2.0, gt=0.0)
    tolerance_percent: float = Field(default=5.0, ge=0.0, le=50.0)
    settle_s: float = Field(default=0.3, gt=0.0, le=10.0)

    def tolerance(self, set_point: float) -> float:
        """Return how far from `set_point` a force counts as held, uN."""
        return max(self.tolerance_un, abs(set_point) * self.tolerance_percent / 100.0)
