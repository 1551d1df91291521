"""Interlocks between subsystems: what one sees stops the other (D7, thesis 5.2)."""

import math
from collections import deque
from collections.abc import Iterator
from typing import Final

import numpy as np

from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.api.recorder import Recorder
from cosmic.daqco.core.chunk import DataChunk, Values
from cosmic.daqco.core.recording_format import AxisPosition
from cosmic.frame.clock import WALL, Clock
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.motion.stop_latch import StopState
from cosmic.mico.hw.interface import PositionerKind
from cosmic.vico.api.application import VicoApplication

MICRONEWTONS: Final = {"nN": 1e-3, "uN": 1.0, "µN": 1.0, "mN": 1e3, "N": 1e6}
"""How many micronewtons a unit of force is."""
TOUCH_S: Final = 0.02
"""Over so long a force is averaged, so that noise is no touch."""
TOUCH_AGAIN_S: Final = 0.1
"""How often a touch that lasts is told, for movements that begin in it."""


def join_force_limits(daqco: DaqcoApplication, mico: MicoApplication) -> None:
    """Have a limit of DAQCo that is crossed stop every actuator of MiCo, and keep it stopped.

    The stop is called in the acquisition thread, past every queue. Where MiCo is not hosted in
    this process, limits are watched and told, and stop nothing.
    """
    daqco.guard.trip = mico.manager.stop


def join_outputs(daqco: DaqcoApplication, mico: Mico) -> None:
    """Have a stop of MiCo stop the outputs of DAQCo as well, until that stop is reset.

    The boards are written to by a thread of their own, after every channel of MiCo was stopped.
    """

    def follow(state: StopState) -> None:
        if state.reason is not None:
            daqco.outputs.stop(state.reason)
        else:
            daqco.outputs.reset()

    mico.follow_stop(follow)
    daqco.stopped_outside = lambda: mico.stop_state.reason or ""


def join_lens(vico: VicoApplication, mico: Mico) -> None:
    """Have a stop of MiCo stop the motors of the lens as well: whoever stops wants all at rest."""

    def follow(state: StopState) -> None:
        if state.reason is not None:
            vico.stop_lens()

    mico.follow_stop(follow)


def join_force_cautions(daqco: DaqcoApplication, mico: MicoApplication) -> None:
    """Have undo and initialisation ask where a force is felt beyond ``[mico.undo] felt_un``.

    A touch that is over when a movement ends is told to undo as well. Only channels whose unit is
    one of force count, and of those the mean over `TOUCH_S`.
    """
    watch = TouchWatch(mico)

    def doubt() -> str:
        return watch.doubt() if daqco.buffer.latest_chunk is not None else ""

    mico.cautions.add(doubt)
    daqco.buffer.subscribe(watch.take)


class TouchWatch:
    """Tells the cautions of MiCo of touches that last `TOUCH_S`; acquisition thread."""

    def __init__(self, mico: MicoApplication) -> None:
        self._mico = mico
        self._published_s: dict[str, float] = {}
        self._recent: deque[tuple[Values, int]] = deque()
        self._last: DataChunk | None = None
        self._means: Values = np.empty(0)
        self._felt = ""

    def doubt(self) -> str:
        """Return which forces are felt now, on the mean of the last samples; any thread."""
        return self._felt

    def take(self, chunk: DataChunk) -> None:
        """Look at the mean force of the last samples; one that lasts is told again and again."""
        samples = self._average(chunk)
        least_un = self._mico.manager.settings.undo.felt_un
        felt: list[str] = []
        for name, scale, mean in zip(chunk.channels, chunk.scales, self._means, strict=True):
            force_un = abs(mean) * MICRONEWTONS.get(scale.unit, 0.0)
            if force_un <= least_un:
                continue
            felt.append(f"{name} feels {mean:.1f} {scale.unit}")
            # Not a number is no touch: the doubt tells it for as long as it lasts.
            if samples < TOUCH_S * chunk.rate_hz or np.isnan(force_un):
                continue
            if chunk.time_s >= self._published_s.get(name, -math.inf) + TOUCH_AGAIN_S:
                self._published_s[name] = chunk.time_s
                self._mico.cautions.touched(f"{name} felt more than {least_un:g} uN")
        self._felt = "; ".join(sorted(felt))

    def _average(self, chunk: DataChunk) -> int:
        """Take the mean of the last samples, and return of how many: fewer right after a start."""
        last, self._last = self._last, chunk
        if last is None or not _continues(chunk, last):
            self._recent.clear()
        self._recent.append((chunk.values.sum(axis=1), chunk.samples))
        samples = sum(each for _, each in self._recent)
        while samples - self._recent[0][1] >= TOUCH_S * chunk.rate_hz:
            samples -= self._recent.popleft()[1]
        self._means = np.sum([each for each, _ in self._recent], axis=0) / samples
        return samples


def _continues(chunk: DataChunk, last: DataChunk) -> bool:
    """Return False where another acquisition, or another meaning of its volts, begins."""
    return (
        chunk.first_sample >= last.first_sample
        and chunk.channels == last.channels
        and chunk.scales == last.scales
    )


def join_exposures(vico: VicoApplication, daqco: DaqcoApplication) -> None:
    """Have the sample at which an exposure began stand beside every image that it triggered."""

    def sample(camera: str, exposed_s: float) -> tuple[int, float] | None:
        trigger = daqco.settings.camera_trigger
        if trigger is None or trigger.camera != camera:
            return None
        found = daqco.exposure_near(exposed_s)
        return None if found is None else (found.sample, found.time_s)

    vico.sample_source = sample


def join_positions(recorder: Recorder, mico: Mico, clock: Clock) -> None:
    """Have the positions of all axes written into every recording, on its clock.

    Positions are gate coordinates, at the moment they were read. A counted position is never read:
    its moment is now. No axis goes back in time: what was read before it began to move was true
    until then.
    """
    newest_s: dict[str, float] = {}

    def positions() -> Iterator[AxisPosition]:
        now_s, now_wall_s = clock.now_s(), WALL.now_s()
        rate = clock.rate or 1.0
        for state in mico.states().values():
            read = state.in_motion and state.kind is not PositionerKind.OPEN_LOOP
            age_s = max(0.0, now_wall_s - state.read_wall_s) * rate if read else 0.0
            time_s = max(now_s - age_s, newest_s.get(state.name, -math.inf))
            newest_s[state.name] = time_s
            yield AxisPosition(
                time_s=time_s,
                axis=state.name,
                position=float("nan") if state.position is None else state.position,
                unit=state.unit,
                confidence=str(state.confidence),
            )

    recorder.position_source = positions


def join_stage_positions(vico: VicoApplication, mico: Mico) -> None:
    """Have the positions of all axes stand beside every image; gate coordinates."""

    def positions(_time_s: float) -> dict[str, float]:
        return {
            state.name: state.position
            for state in mico.states().values()
            if state.position is not None
        }

    axes = {each.name: each.unit for each in mico.settings.positioner}
    for unit in vico.units.values():
        unit.recordings.axes = axes
    vico.position_source = positions
