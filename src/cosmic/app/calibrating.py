"""Calibrations on a platform, for scripts, the command and the window."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from cosmic.autonomy.calibrating.book import CalibrationBook
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.places import PlatformPlaces
from cosmic.autonomy.procedures.run import ProcedureRun
from cosmic.autonomy.shipped.calibrate import build_calibrate
from cosmic.frame.arguments import checked
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.vico.api.application import VicoApplication

if TYPE_CHECKING:
    from cosmic.app.rig import Rig


def book_of(rig: "Rig") -> CalibrationBook:
    """Return the book of calibrations; see `Rig.calibrations`."""
    application = rig.vico.application
    places = application.places if isinstance(application, VicoApplication) else None
    if not isinstance(places, PlatformPlaces):
        raise NotAvailable("calibrations are kept where cameras and axes run in one program")
    return places.book


@checked
def calibration_on(
    rig: "Rig", settings: HandlingSettings | None, anew: Sequence[str], *, zooms: bool
) -> ProcedureRun[FibreWork]:
    """Return a run that calibrates, ready to begin; see `Rig.calibrate`."""
    settings, book = settings or HandlingSettings(), book_of(rig)
    known = {each.name for each in book.entries}
    if unknown := [each for each in anew if each not in known]:
        told = ", ".join(sorted(known)) or "none"
        raise ConfigError(f"there is no calibration {unknown[0]!r}; known are: {told}")
    for entry in book.entries:
        if entry.name in anew:
            book.forget(*entry.key)
    work = FibreWork.on(rig, settings)
    run = rig.procedure(build_calibrate(settings, zooms=zooms), work)

    def close() -> None:
        if run.over:
            work.close()

    run.on_change(close)
    return run
