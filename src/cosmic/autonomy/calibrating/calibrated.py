"""What all calibrations have in common as operations: made when due, refused when poor."""

from collections.abc import Generator, Mapping

from typing_extensions import override

from cosmic.autonomy.calibrating.registry import CalibrationEntry, CalibrationStanding
from cosmic.autonomy.handling.context import FibreOperation, HandlingContext, Measured
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed, Steps, Yielded
from cosmic.frame.errors import NotAvailable
from cosmic.vico.core.calibration_fit import CalibrationRefused

POOR = "calibration poor"

Holds = Generator[Yielded, object, CalibrationEntry | None]
"""Of a check: the entry that holds, with what may be put right; or None."""


class Calibrated(FibreOperation):
    """A calibration that is made when there is none, or it is too old; refused when poor.

    A fresh one of the registry is used as it is. One of an earlier start of the program
    is looked at first, by `check`, because stages are referenced anew. Subclasses override
    `measure`, which ends with `kept`, and what else applies.

    Attributes
    ----------
    key : str
        Its name in the registry, in reports and in messages.
    """

    key = ""

    @override
    def steps(self, work: HandlingContext) -> Steps:
        if work.calibration.fresh(self.key, work.clock.now_s(), work.settings.calibration.age_s):
            return
        if (yield from self._found(work)):
            return
        try:
            yield from self.measure(work)
        except (NotAvailable, CalibrationRefused) as exc:
            self._refused(work, str(exc))
            raise OperationFailed(POOR, f"{self.key}: {exc}") from exc
        yield SAFE_POINT

    def _found(self, work: HandlingContext) -> Generator[Yielded, object, bool]:
        """Use one of the registry that is fresh, or that is seen to hold."""
        registry, longest_s = work.calibration.registry, work.settings.calibration.age_s
        entry = registry.get(self.key, self.tool(work))
        if entry is None or entry.made_with != self.made_with(work):
            return False
        standing = registry.standing(entry, longest_s)
        if standing is CalibrationStanding.UNCHECKED:
            try:
                holds = yield from self.check(work, entry)
            except (NotAvailable, CalibrationRefused):
                return False
            if holds is None:
                return False
            entry = registry.confirm(holds, work.clock.now_s())
        elif standing is not CalibrationStanding.FRESH:
            return False
        self.restore(work, entry)
        self._note(work, entry)
        return True

    # What subclasses say

    def measure(self, work: HandlingContext) -> Steps:
        """Measure it, and keep it by `kept`."""
        raise NotImplementedError

    def check(self, work: HandlingContext, entry: CalibrationEntry) -> Holds:  # noqa: ARG002 - for subclasses
        """Look whether one of an earlier start still holds; without a way to tell it does not."""
        return None
        yield  # what makes it a generator

    def restore(self, work: HandlingContext, entry: CalibrationEntry) -> None:
        """Put what stands in the registry in force."""

    def tool(self, work: HandlingContext) -> str:
        """Return of what, or with what, it is measured."""
        return work.gripper.name

    def made_with(self, work: HandlingContext) -> str:
        """Return what it rests on: with anything else it has to be made anew."""
        tip = ", ".join(f"{each:g}" for each in work.gripper.tip_um)
        camera = work.settings.camera or "first camera"
        return f"{camera}, zoom {work.settings.zoom:g}, {work.gripper.name} at {tip}"

    # What subclasses call

    def kept(
        self,
        work: HandlingContext,
        residual: float,
        unit: str,
        largest: float,
        *,
        values: Mapping[str, float] | None = None,
        how: str = "",
    ) -> None:
        """Note that it was made, or refuse it."""
        entry = self._entry(work, residual, unit, largest, values or {}, how)
        if not residual <= largest:
            text = f"residual {residual:.3g} {unit}, at most {largest:g} is allowed"
            work.calibration.registry.refuse(entry, text)
            raise OperationFailed(POOR, f"{self.key}: {text}")
        work.calibration.registry.put(entry)
        self._note(work, entry)

    def _refused(self, work: HandlingContext, problem: str) -> None:
        work.calibration.registry.refuse(self._entry(work, 0.0, "", 0.0, {}, ""), problem)

    def _entry(
        self,
        work: HandlingContext,
        residual: float,
        unit: str,
        largest: float,
        values: Mapping[str, float],
        how: str,
    ) -> CalibrationEntry:
        registry = work.calibration.registry
        return CalibrationEntry(
            self.key,
            self.tool(work),
            values,
            residual,
            unit,
            largest,
            registry.now(),
            work.clock.now_s(),
            registry.session,
            zoom=work.shared.zoomed,
            made_with=self.made_with(work),
            how=how,
        )

    def _note(self, work: HandlingContext, entry: CalibrationEntry) -> None:
        age_s = work.calibration.registry.age_s(entry)
        work.calibration.made[self.key] = Measured(
            work.clock.now_s() - age_s, entry.residual, entry.unit
        )
