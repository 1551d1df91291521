"""The twin's motorised lens: where zoom and focus truly are at any moment."""

import random
from typing import Final, Literal

from cosmic.twin.lens_motor import LensMotor, LensPhase
from cosmic.twin.lens_settings import LensSettings

LensAxisName = Literal["zoom", "focus"]

AXES: Final[tuple[LensAxisName, ...]] = ("zoom", "focus")


class TwinLens:
    """Two stepper motors without home switches, their controller, and the lens they turn.

    Parameters
    ----------
    settings : LensSettings
        Constants.
    seed : int
        Of where the motors stand after power-up.
    cold : bool
        False: homed, each motor at its configured start and counted truly. True: just switched
        on, each somewhere, its counter at zero.

    Notes
    -----
    Counts are steps from the near stop. Any thread may look, also at the past; one at a time
    commands. Commands take whole counts and do not look at the limits: steps beyond a stop are
    lost, as on the real one.
    """

    def __init__(self, settings: LensSettings, seed: int = 0, *, cold: bool = False) -> None:
        self.settings = settings
        self.cold = cold
        self._motors: dict[LensAxisName, LensMotor] = {}
        chance = random.Random(f"lens {seed}")
        for axis in AXES:
            motor = settings.zoom if axis == "zoom" else settings.focus
            somewhere = chance.uniform(0.0, motor.limit_counts)
            start = somewhere if cold else motor.start_counts
            counter = 0.0 if cold else float(round(start))
            self._motors[axis] = LensMotor(motor, start_counts=start, counter=counter)

    @property
    def zoom_range_counts(self) -> tuple[float, float]:
        """Lowest and highest zoom."""
        return 0.0, float(self.settings.zoom.limit_counts)

    @property
    def focus_range_counts(self) -> tuple[float, float]:
        """Ends of the focus."""
        return 0.0, float(self.settings.focus.limit_counts)

    def position_counts(self, axis: LensAxisName, now_s: float) -> float:
        """Return where the lens truly is at `now_s`, which may lie in the past."""
        return self._motors[axis].leg(now_s).lens_at(now_s)

    def run_number(self, axis: LensAxisName, now_s: float) -> int:
        """Return which run left the lens where it is at `now_s`: 1 for the first, 0 before."""
        return self._motors[axis].leg(now_s).run

    def counter(self, axis: LensAxisName, now_s: float) -> int:
        """Return what the controller counts; wrong after lost steps."""
        return round(self._motors[axis].leg(now_s).counter_at(now_s))

    def phase(self, axis: LensAxisName, now_s: float) -> tuple[LensPhase, int, bool]:
        """Return what the controller is about, the direction (1, -1), and whether it slows."""
        leg = self._motors[axis].leg(now_s)
        _, falling = leg.ramp.speed(now_s - leg.start_s)
        phase = leg.phase if now_s < leg.end_s else LensPhase.IDLE
        return phase, leg.direction, falling

    def seek(self, axis: LensAxisName, target_counts: int, now_s: float) -> None:
        """Go to a count; on the way back beyond it first, so that the play lies on one side."""
        motor = self._motors[axis]
        distance = target_counts - motor.leg(now_s).counter_at(now_s)
        play = float(motor.settings.backlash_counts)
        if distance < 0.0 < play:
            motor.begin(now_s, ((LensPhase.SEEK, distance - play), (LensPhase.BACKLASH, play)))
        elif distance != 0.0:
            motor.begin(now_s, ((LensPhase.SEEK, distance),))

    def home(self, axis: LensAxisName, now_s: float) -> None:
        """Run against the near stop, further than the travel is long, and count from there."""
        motor = self._motors[axis]
        settings = motor.settings
        back = -float(settings.limit_counts + settings.home_margin_counts)
        off = float(settings.backlash_counts)
        motor.begin(now_s, ((LensPhase.TO_HOME, back), (LensPhase.OFF_HOME, off)))
        motor.zero()

    def limit(self, axis: LensAxisName, now_s: float) -> None:
        """Go to the far limit as the controller counts it."""
        motor = self._motors[axis]
        distance = motor.settings.limit_counts - motor.leg(now_s).counter_at(now_s)
        motor.begin(now_s, ((LensPhase.TO_LIMIT, distance),))

    def abort(self, axis: LensAxisName, now_s: float) -> None:
        """Slow down and stand."""
        self._motors[axis].abort(now_s)

    def lose_steps(self, axis: LensAxisName, share: float) -> None:
        """Lose that part of the steps of each movement that begins from now on."""
        if not 0.0 <= share <= 1.0:
            raise ValueError(f"a part of the steps lies between 0 and 1, got {share!r}")
        self._motors[axis].lost_share = share

    def turn_by_hand(self, axis: LensAxisName, travel_counts: float, now_s: float) -> None:
        """Turn the ring; the controller does not notice."""
        self._motors[axis].turn(now_s, travel_counts)
