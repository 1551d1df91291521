"""What all calibrations have in common as operations: made when due, refused when poor."""

from collections.abc import Generator, Mapping

from typing_extensions import override

from cosmic.autonomy.calibrating.book import CalibrationEntry, CalibrationStanding
from cosmic.autonomy.handling.in_hand import Measured
from cosmic.autonomy.handling.operation import FibreOperation
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed, Steps, Wish
from cosmic.frame.errors import NotAvailable
from cosmic.vico.core.calibration_fit import CalibrationRefused

POOR = "calibration poor"

Holds = Generator[Wish, object, CalibrationEntry | None]
"""Of a check: the entry that holds, with what may be put right; or None."""


class Calibrated(FibreOperation):
    """A calibration that is made when there is none, or it is too old; refused when poor.

    One that is in the book and fresh is taken from there. One of an earlier start of the program
    is looked at first, by `check`, because stages are referenced anew. Subclasses override
    `measure`, which ends with `kept`, and what else applies.

    Attributes
    ----------
    key : str
        Its name in the book, in reports and in messages.
    """

    key = ""

    @override
    def steps(self, work: FibreWork) -> Steps:
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

    def _found(self, work: FibreWork) -> Generator[Wish, object, bool]:
        """Take one from the book, where there is one that may be used, or that is seen to hold."""
        book, longest_s = work.calibration.book, work.settings.calibration.age_s
        entry = book.get(self.key, self.tool(work))
        if entry is None or entry.made_with != self.made_with(work):
            return False
        standing = book.standing(entry, longest_s)
        if standing is CalibrationStanding.UNCHECKED:
            try:
                holds = yield from self.check(work, entry)
            except (NotAvailable, CalibrationRefused):
                return False
            if holds is None:
                return False
            entry = book.confirm(holds, work.clock.now_s())
        elif standing is not CalibrationStanding.FRESH:
            return False
        self.restore(work, entry)
        self._note(work, entry)
        return True

    # What subclasses say

    def measure(self, work: FibreWork) -> Steps:
        """Measure it, and keep it by `kept`."""
        raise NotImplementedError

    def check(self, work: FibreWork, entry: CalibrationEntry) -> Holds:  # noqa: ARG002 - for subclasses
        """Look whether one of an earlier start still holds; without a way to tell it does not."""
        return None
        yield  # what makes it a generator

    def restore(self, work: FibreWork, entry: CalibrationEntry) -> None:
        """Put what stands in the book in force."""

    def tool(self, work: FibreWork) -> str:
        """Return of what, or with what, it is measured."""
        return work.gripper.name

    def made_with(self, work: FibreWork) -> str:
        """Return what it rests on: with anything else it has to be made anew."""
        tip = ", ".join(f"{each:g}" for each in work.gripper.tip_um)
        camera = work.settings.camera or "first camera"
        return f"{camera}, zoom {work.settings.zoom:g}, {work.gripper.name} at {tip}"

    # What subclasses call

    def kept(
        self,
        work: FibreWork,
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
            work.calibration.book.refuse(entry, text)
            raise OperationFailed(POOR, f"{self.key}: {text}")
        work.calibration.book.put(entry)
        self._note(work, entry)

    def _refused(self, work: FibreWork, problem: str) -> None:
        work.calibration.book.refuse(self._entry(work, 0.0, "", 0.0, {}, ""), problem)

    def _entry(
        self,
        work: FibreWork,
        residual: float,
        unit: str,
        largest: float,
        values: Mapping[str, float],
        how: str,
    ) -> CalibrationEntry:
        book = work.calibration.book
        return CalibrationEntry(
            self.key,
            self.tool(work),
            values,
            residual,
            unit,
            largest,
            book.now(),
            work.clock.now_s(),
            book.session,
            zoom=work.zoomed,
            made_with=self.made_with(work),
            how=how,
        )

    def _note(self, work: FibreWork, entry: CalibrationEntry) -> None:
        age_s = work.calibration.book.age_s(entry)
        work.calibration.made[self.key] = Measured(
            work.clock.now_s() - age_s, entry.residual, entry.unit
        )
