"""What is known of lens and light at this moment."""

from dataclasses import dataclass

from cosmic.vico.hw.peripherals import LensAxis, LensState


@dataclass(frozen=True, slots=True)
class PeripheralState:
    """Lens and light as last heard.

    Attributes
    ----------
    time_s, wall_s : float
        Platform time and wall time of it.
    zoom, focus : LensState or None
        None while the lens cannot be asked.
    light_percent : float or None
        None while the lamp cannot be asked.
    lens_problem, light_problem : str
        Why not; empty when all is well.
    """

    time_s: float
    wall_s: float
    zoom: LensState | None = None
    focus: LensState | None = None
    light_percent: float | None = None
    lens_problem: str = ""
    light_problem: str = ""

    def axis(self, axis: LensAxis) -> LensState | None:
        """Return one of the motors."""
        return self.zoom if axis is LensAxis.ZOOM else self.focus

    @property
    def moving(self) -> bool:
        """A motor runs."""
        return any(each is not None and each.moving for each in (self.zoom, self.focus))
