"""Calibrations on a platform, for scripts, the command and the window."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from cosmic.autonomy.calibrating.registry import CalibrationRegistry
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.places import PlatformPlaces
from cosmic.autonomy.procedures.run import ProcedureRun
from cosmic.autonomy.shipped.calibrate import build_calibrate
from cosmic.frame.arguments import checked
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.vico.api.application import VicoApplication

if TYPE_CHECKING:
    from cosmic.app.rig import Rig


def registry_of(rig: "Rig") -> CalibrationRegistry:
    """Return the calibration registry; see `Rig.calibrations`."""
    application = rig.vico.application
    places = application.places if isinstance(application, VicoApplication) else None
    if not isinstance(places, PlatformPlaces):
        raise NotAvailable("calibrations are kept where cameras and axes run in one program")
    return places.registry


@checked
def calibration_on(
    rig: "Rig", settings: HandlingSettings | None, anew: Sequence[str], *, zooms: bool
) -> ProcedureRun[HandlingContext]:
    """Return a run that calibrates, ready to begin; see `Rig.calibrate`."""
    settings, registry = settings or HandlingSettings(), registry_of(rig)
    known = {each.name for each in registry.entries}
    if unknown := [each for each in anew if each not in known]:
        told = ", ".join(sorted(known)) or "none"
        raise ConfigError(f"there is no calibration {unknown[0]!r}; known are: {told}")
    for entry in registry.entries:
        if entry.name in anew:
            registry.forget(*entry.key)
    work = HandlingContext.on(rig, settings)
    run = rig.procedure(build_calibrate(settings, zooms=zooms), work)

    def close() -> None:
        if run.over:
            work.close()

    run.on_change(close)
    return run
