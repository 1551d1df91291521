"""Where the axes of a trajectory should stand, and how they get there."""

from collections.abc import Mapping
from typing import Final

from cosmic.frame.errors import NotAvailable
from cosmic.frame.units import format_quantity
from cosmic.mico.api.trajectory_site import TrajectorySite
from cosmic.mico.api.trajectory_state import StartMode
from cosmic.mico.core.motion.orders import MoveTo
from cosmic.mico.core.trajectory.binding import Bound, BoundLeg, BoundStep

PATH_BUDGET_S: Final = 2.0
_SLACK: Final = 2.0
"""How many tolerances an axis may stand away from where a line left it."""


class AwayFromStartError(NotAvailable):
    """Axes do not stand where a trajectory begins or goes on; the text says which and how far.

    Attributes
    ----------
    targets : mapping of float
        Where they should stand, in gate coordinates.
    """

    def __init__(self, text: str, targets: Mapping[str, float]) -> None:
        super().__init__(text)
        self.targets = dict(targets)


class StartPositions:
    """Keeps where each line has left the axes; one thread at a time."""

    def __init__(self, site: TrajectorySite, bound: Bound) -> None:
        self._site = site
        self._bound = bound
        self._expected: dict[str, float] = {
            axis: bound.start[axis] for axis in bound.trajectory.start if axis in bound.start
        }

    def note(self, leg: BoundLeg) -> None:
        """Remember where a line has brought its axes."""
        for axis, motion in leg.motions.items():
            if isinstance(motion, MoveTo):
                self._expected[axis] = motion.target
            else:
                self._expected.pop(axis, None)

    def home(self) -> dict[str, float]:
        """Return where the axes with a sensor stand before the first line."""
        start, facts = self._bound.start, self._site.facts().axes
        axes = [axis for axis in self._bound.trajectory.axes if axis in start]
        return {axis: start[axis] for axis in axes if axis in facts and facts[axis].has_sensor}

    def begin_again(self) -> None:
        """Expect the axes where they stood before the first line."""
        self._expected |= self.home()

    def wanted(self, following: BoundStep | None, *, begun: bool) -> dict[str, float]:
        """Return where axes should stand that the next line does not send anywhere itself."""
        own = following.motions if isinstance(following, BoundLeg) and begun else {}
        return {axis: value for axis, value in self._expected.items() if axis not in own}

    def refuse_away(self, wanted: Mapping[str, float], *, begun: bool) -> None:
        """Raise `AwayFromStartError` where axes stand elsewhere."""
        away = self.away(wanted, self._site.positions())
        if away:
            raise AwayFromStartError(
                f"the axes are not where it {'goes on' if begun else 'begins'}: "
                f"{', '.join(away)}; go there first, or run it with start='straight' or "
                "start='detour'",
                wanted,
            )

    def check_loop(self, end: Mapping[str, float]) -> None:
        """Raise `AwayFromStartError` where a trajectory does not end where it begins."""
        away = self.away(self.home(), end)
        if away:
            raise AwayFromStartError(
                f"it does not end where it begins ({', '.join(away)}), so it cannot be looped; "
                "run it with start='straight' or start='detour' to go back each time",
                self.home(),
            )

    def stands(self, wanted: Mapping[str, float]) -> bool:
        """Return True when all axes stand where they should."""
        return not self.away(wanted, self._site.positions())

    def away(self, wanted: Mapping[str, float], stands: Mapping[str, float]) -> list[str]:
        """Return which axes stand elsewhere, in words."""
        watch = self._site.manager.settings.watch
        words = []
        for axis, target in wanted.items():
            unit = self._site.manager.state(axis).unit
            slack = _SLACK * (watch.tolerance_deg if unit == "deg" else watch.tolerance_um)
            position = stands.get(axis)
            if position is None or not abs(position - target) <= slack:
                where = "unknown" if position is None else format_quantity(position, unit)
                words.append(f"{axis} at {where} instead of {format_quantity(target, unit)}")
        return words

    def waypoints(
        self, wanted: Mapping[str, float], mode: StartMode
    ) -> tuple[Mapping[str, float], ...]:
        """Return the path to where the axes should be; raises `MoveRefused`."""
        if mode == "straight" or self._site.worker.collision is None:
            return (wanted,)
        return self._site.worker.plan_path(wanted, PATH_BUDGET_S).waypoints
