"""Finding what is in focus by one sweep of the lens: stop, look, go on."""

from collections.abc import Generator

import numpy as np

from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.procedures.operation import Yielded
from cosmic.frame.errors import NotAvailable
from cosmic.vico.api.lens import LensHandle
from cosmic.vico.core.calibration_fit import CalibrationRefused
from cosmic.vico.core.focus import FocusAnswer, FocusFault, FocusMeasure, peak_of, sharpness
from cosmic.vico.core.image import CameraImage
from cosmic.vico.hw.peripherals import LensAxis

SWEEPS = 3
PLAY_COUNTS = 100
"""More than the play of the focus: each sweep begins so far below, and only goes upwards."""

Found = Generator[Yielded, object, tuple[float, float]]
"""Where the focus is, and the standard deviation of that; counts."""


def lens_of(work: HandlingContext) -> LensHandle:
    """Return the lens; raises `NotAvailable` where its focus cannot be moved."""
    lens = work.vico.lens
    if lens is None:
        raise NotAvailable("the lens has no motor: it cannot focus")
    return lens


def focus_now(work: HandlingContext) -> float:
    """Return where the focus stands, counts."""
    state = lens_of(work).state(LensAxis.FOCUS)
    if state is None or not state.homed:
        raise NotAvailable("the focus is unknown: home the lens, then try again")
    return float(state.position_counts)


def find_focus_near(
    work: HandlingContext, about_counts: float, reach_counts: float, what: str
) -> Found:
    """Sweep through a focus that is about known; where it lies at an end, sweep again there.

    Raises
    ------
    CalibrationRefused
        There is none; the text says why.
    """
    answer: FocusAnswer | None = None
    for _ in range(SWEEPS):
        answer = yield from _sweep(work, about_counts, reach_counts)
        if answer.position is not None and answer.std is not None:
            return answer.position, answer.std
        if answer.fault is not FocusFault.AT_END or answer.position is None:
            break
        about_counts = answer.position
    why = answer.text if answer is not None else "nothing was looked at"
    raise CalibrationRefused(f"{what}: {why}")


def seek_from_below(work: HandlingContext, counts: float) -> Generator[Yielded, object, None]:
    """Focus somewhere with the play taken up as in a sweep."""
    lens = lens_of(work)
    yield lens.seek_focus(max(0, round(counts) - PLAY_COUNTS))
    yield lens.seek_focus(round(counts))


def _sweep(
    work: HandlingContext, about_counts: float, reach_counts: float
) -> Generator[Yielded, object, FocusAnswer]:
    lens, frames = lens_of(work), work.settings.calibration.focus_frames
    state = lens.state(LensAxis.FOCUS)
    limit = state.limit_counts if state is not None else 0
    low = max(0.0, about_counts - reach_counts)
    high = min(float(limit), about_counts + reach_counts)
    if not high - low > reach_counts:
        raise CalibrationRefused("the focus lies outside the travel of the lens")
    curve: list[tuple[float, float]] = []
    yield lens.seek_focus(max(0, round(low) - PLAY_COUNTS))
    for position in np.linspace(low, high, frames).round().tolist():
        yield lens.seek_focus(int(position))
        image = yield work.image()
        assert isinstance(image, CameraImage)
        # The whole image, and its edges: of a tool, how much of it is dark tells little.
        curve.append((position, sharpness(image.data, None, FocusMeasure.TENENGRAD)))
    return peak_of(curve)
