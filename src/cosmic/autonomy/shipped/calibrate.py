"""Calibration: before fibres are handled, and everything there is on its own."""

from cosmic.autonomy.calibrating.calibrated import POOR, Calibrated
from cosmic.autonomy.calibrating.drift import CheckDrift
from cosmic.autonomy.calibrating.heights import HeightByFocus, HeightsAsFiled
from cosmic.autonomy.calibrating.touching import TouchJaw
from cosmic.autonomy.calibrating.zooms import CalibrateZooms
from cosmic.autonomy.handling.context import FibreOperation, HandlingContext
from cosmic.autonomy.handling.prepare import (
    CalibrateHeld,
    CalibratePlate,
    ComparePositions,
    InitialiseAgain,
    MakeReady,
    Register,
    TurnOn,
    make_safe,
)
from cosmic.autonomy.handling.put_away import ClearUp
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.handling.survey import Survey
from cosmic.autonomy.handling.turning import FindRotationCentre
from cosmic.autonomy.procedures.combinators import Fallback, Retry, Sequence
from cosmic.autonomy.procedures.procedure import Node, Part, Procedure


def calibrated(settings: HandlingSettings) -> tuple[Part[HandlingContext], ...]:
    """Return what is calibrated of an arm before it sees any fibre; nothing where all is fresh."""
    chosen = settings.calibration
    heights = Fallback("heights", HeightByFocus(), HeightsAsFiled())
    return (
        CheckDrift(),
        *((heights,) if chosen.heights else ()),
        *(
            _tried(settings, each)
            # The maps last: nothing runs the zoom between them and the fibres.
            for each in (ComparePositions(), CalibratePlate(), CalibrateHeld())
        ),
        *((_tried(settings, TouchJaw()),) if chosen.touch else ()),
        Register(),
    )


def build_calibrate(
    settings: HandlingSettings | None = None, *, zooms: bool = True
) -> Procedure[HandlingContext]:
    """Return the procedure that calibrates everything that is not fresh.

    Parameters
    ----------
    zooms : bool
        The map at every step of the lens as well; fibres are handled without most of them.
    """
    settings = settings or HandlingSettings()
    everything: tuple[FibreOperation, ...] = (
        ComparePositions(),
        *((CalibrateZooms(),) if zooms else ()),
        CalibratePlate(),
        CalibrateHeld(),
        TouchJaw(),
    )
    root = Sequence(
        "calibrate",
        InitialiseAgain(),
        ClearUp(),
        MakeReady(),
        Fallback("heights", HeightByFocus(), HeightsAsFiled()),
        *(_tried(settings, each) for each in everything),
        Register(),
        Survey(),
        FindRotationCentre(),
    )
    return Procedure("calibrate", root, make_safe=make_safe)


def calibration_names() -> frozenset[str]:
    """Return the names of the calibrations that are made here, made before or not."""
    waiting: list[Part[HandlingContext]] = [build_calibrate().root]
    found = set()
    while waiting:
        part = waiting.pop()
        if isinstance(part, Calibrated):
            found.add(part.key)
        elif isinstance(part, Node):
            waiting += part.parts
    return frozenset(found)


def _tried(settings: HandlingSettings, part: FibreOperation) -> Part[HandlingContext]:
    """Return an operation tried several times: what lies below may hide a tool."""
    return Retry(part, settings.calibration.tries, only={POOR}, between=TurnOn())
