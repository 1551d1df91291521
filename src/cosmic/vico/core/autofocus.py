"""Autofocus: by two images where the blur at this zoom is known, by a sweep otherwise.

What two images find is looked at once more, before it is believed.
"""

import logging
import math
from typing import Final

from cosmic.frame.clock import Clock
from cosmic.frame.errors import CosmicError, MoveCancelled, NotAvailable
from cosmic.frame.operation import Task
from cosmic.vico.core.camera_unit import CameraUnit
from cosmic.vico.core.defocus import DefocusModel, calibrate, in_focus
from cosmic.vico.core.focus import (
    FocusAnswer,
    FocusFault,
    FocusMeasure,
    FocusSearch,
    sharpness,
)
from cosmic.vico.core.focus_models import FocusModels, View
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.lens_control import PeripheralThread
from cosmic.vico.core.vision.algorithms import grey
from cosmic.vico.hw.interface import Pixels
from cosmic.vico.hw.peripherals import LensAxis

logger = logging.getLogger(__name__)

COARSE_STEPS: Final = 40
"""Over the whole travel; a step is then less than the depth of field up to 5x."""
FINE_STEPS: Final = 6
"""In one coarse step."""
NEAR_SHARE: Final = 0.2
"""Of the travel, to both sides: looked at first."""
MOVE_S: Final = 30.0
IMAGE_S: Final = 5.0
FRAMES: Final = 2
APART_PX: Final = 2.0
"""Between two images the focus moves by what blurs a sharp image by so much."""
SURE_PX: Final = 0.5
"""What two images find is believed where it is known to what blurs by so much."""
REACH_PX: Final = 5.0
"""Farther off, two images show too little to be believed."""
LEARNED_FROM: Final = 12
AS_SHARP, SHARPER = 0.99, 1.03
"""What two images find is as sharp as the better of them, and sharper than the other."""


class Autofocus:
    """One search for the focus, in the application's thread."""

    def __init__(
        self,
        task: Task,
        unit: CameraUnit,
        lens: PeripheralThread,
        clock: Clock,
        models: FocusModels,
    ) -> None:
        self._task, self._unit, self._lens, self._clock = task, unit, lens, clock
        self._models = models
        self._taken, self._since_s = 0, 0.0
        self._seen: dict[float, Pixels] = {}

    def run(self) -> None:
        """Find the focus and go there; where none is found the lens goes back."""
        state = self._lens.state.axis(LensAxis.FOCUS)
        if state is None or not state.homed:
            self._task.fail(NotAvailable("the lens has not been homed; home it, then try again"))
            return
        before, limit = state.position_counts, state.limit_counts
        try:
            position, text = self._by_two(before, limit) or self._by_sweep(before, limit)
            # From below, as the sweep went, so that the play lies on the same side.
            for target in (max(0.0, position - limit / COARSE_STEPS), position):
                self._lens.seek(LensAxis.FOCUS, round(target)).wait(MOVE_S)
            self._task.report(1.0, f"{text}; {self._taken} images")
            self._task.finish()
        except CosmicError as exc:
            # After a cancel it stays, for somebody wanted it to stand.
            if not self._task.cancel_requested:
                self._lens.seek(LensAxis.FOCUS, before)
            self._task.fail(exc)

    # Two images

    def _by_two(self, before: float, limit: float) -> tuple[float, str] | None:
        """Return the focus from an image here and one beside; None where that is not sure."""
        view = self._view()
        model = None if view is None else self._models.find(view)
        if model is None:
            return None
        per_px = 1.0 / math.sqrt(model.growth)
        apart = round(APART_PX * per_px)
        beside = before + apart if before + apart <= limit else before - apart
        if not 0.0 <= beside <= limit or apart == 0:
            return None
        try:
            one = self._image_at(before)
            other = self._image_at(beside)
            found = in_focus((before, grey(one.data)), (beside, grey(other.data)), model)
        except NotAvailable as exc:
            logger.info("autofocus: %s; it sweeps", exc)
            return None
        off = abs(found.position - 0.5 * (before + beside))
        sure = found.std <= SURE_PX * per_px and off <= REACH_PX * per_px
        if not (sure and 0.0 <= found.position <= limit):
            logger.info("autofocus: two images are not sure (%s); it sweeps", found)
            return None
        # Where only dust on the sensor is seen, which is always sharp, both agree in a wrong one.
        self._lens.seek(LensAxis.FOCUS, max(0, round(found.position - apart))).wait(MOVE_S)
        there = self._image_at(found.position)
        low, high = sorted((_edges(one), _edges(other)))
        if not (_edges(there) >= AS_SHARP * high and _edges(there) >= SHARPER * low):
            logger.info("autofocus: what two images found is not sharper than they are; it sweeps")
            return None
        return found.position, f"sharpest at {found.position:.4g} ± {found.std:.2g}"

    def _view(self) -> View | None:
        """Return through what the camera looks; None where the zoom is not known."""
        zoom, settings = self._lens.state.axis(LensAxis.ZOOM), self._unit.thread.settings
        if zoom is None or not zoom.homed or settings is None:
            return None
        return View(self._unit.config.name, float(zoom.position_counts), settings.binning)

    # A sweep

    def _by_sweep(self, before: float, limit: float) -> tuple[float, str]:
        reach = NEAR_SHARE * limit
        near = max(0.0, before - reach), min(float(limit), before + reach)
        answer = self._sweep(near, limit / COARSE_STEPS)
        if answer.fault in (FocusFault.AT_END, FocusFault.FLAT):
            answer = self._sweep((0.0, float(limit)), limit / COARSE_STEPS)
        if answer.position is None:
            raise NotAvailable(answer.text)
        self._learn(answer.position)
        return answer.position, answer.text

    def _sweep(self, span: tuple[float, float], coarse: float) -> FocusAnswer:
        low, high = span
        search = FocusSearch(
            low, high, coarse_step=coarse, fine_step=coarse / FINE_STEPS, frames=FRAMES
        )
        whole = FRAMES * ((high - low) / coarse + 3 * FINE_STEPS + 2)
        at, taken = None, 0
        while (target := search.target) is not None:
            image = self._image_at(target, move=target != at)
            at, taken = target, taken + 1
            self._seen[float(round(target))] = image.data
            search.add(float(round(target)), _edges(image))
            self._task.report(min(0.99, taken / whole), f"focus at {round(target)} counts")
        answer = search.answer
        if answer is None:
            raise NotAvailable("no focus found")
        return answer

    def _learn(self, position: float) -> None:
        """Learn from the images of a sweep how fast they blur, for the next search here."""
        view, near = self._view(), sorted(self._seen, key=lambda each: abs(each - position))
        # Half of them next to the focus, and half at the distance of the coarse steps.
        chosen = sorted({*near[: LEARNED_FROM // 2], *near[LEARNED_FROM // 2 :: 2][:LEARNED_FROM]})
        if view is None:
            return
        try:
            model: DefocusModel = calibrate([(at, grey(self._seen[at])) for at in chosen])
            self._models.learn(view, model)
        except CosmicError as exc:
            logger.info("autofocus: the blur was not learned (%s)", exc)
        finally:
            self._seen.clear()

    def _image_at(self, target: float, *, move: bool = True) -> CameraImage:
        """Return an image with the focus at a position; raises `MoveCancelled`, `NotAvailable`."""
        if self._task.cancel_requested:
            raise MoveCancelled("autofocus was cancelled")
        if move:
            self._lens.seek(LensAxis.FOCUS, round(target)).wait(MOVE_S)
            self._since_s = self._clock.now_s()
        image = self._unit.thread.next_image(self._since_s, IMAGE_S)
        # A frame is used once: the next one must be exposed after it was complete.
        self._since_s = image.frame.time_s
        self._taken += 1
        return image


def _edges(image: CameraImage) -> float:
    """Return how sharp the edges are: how much of an image is dark says little of few fibres."""
    return sharpness(image.data, None, FocusMeasure.TENENGRAD)
