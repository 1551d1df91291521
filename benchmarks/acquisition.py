"""Acquisition as a whole: 32 channels x 15 kHz with recording and plot, and how a limit stops.

The boards are the simulated ones of the shipped platform; what the rest costs without them is
measured on the fast source. The plot is the window's own, drawn offscreen at 60 Hz. The reaction
is counted from the sample that crosses to the return of the stop of every channel.
"""

import os
import random
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import numpy as np
import numpy.typing as npt
from PySide6.QtCore import QEventLoop, QTimer
from PySide6.QtWidgets import QApplication

from benchmarks.figures import Figure, main, percentile
from benchmarks.stand import Stand, stand, wait_until
from cosmic.app.configuration.platform_file import load_platform
from cosmic.autonomy.interlocks import join_force_limits
from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.api.recording import open_recording
from cosmic.daqco.core.settings import ChannelSettings, DaqcoSettings, LimitSettings
from cosmic.daqco.gui.plotter import UDaqPlotter
from cosmic.daqco.hw.interface import BoardLibrary
from cosmic.daqco.hw.sim_library import SimulatedLibrary
from cosmic.frame.clock import Clock, WallClock
from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import FailurePolicy
from cosmic.testing.fast_board import FastLibrary

NAME = "acquisition"
CALL = "SA_Stop_A"
MOST_MS = 8.0
"""From the end of the crossing chunk to the last stop."""


def settings(boards: tuple[str, ...], rate_hz: float) -> DaqcoSettings:
    """Return 32 channels on `boards`, plotted at 60 Hz."""
    each = 32 // len(boards)
    channels = tuple(
        ChannelSettings(name=f"{board.lower()}.c{number}", board=board, input=f"ai{number}")
        for board in boards
        for number in range(each)
    )
    return DaqcoSettings(channel=channels, rate_hz=rate_hz, refresh_hz=60.0)


@contextmanager
def acquiring(library: BoardLibrary, wanted: DaqcoSettings) -> Iterator[Daqco]:
    """Give an application that acquires."""
    application = DaqcoApplication(library, wanted, clock=WallClock(), policy=FailurePolicy())
    application.initialize()
    try:
        yield Daqco(application)
    finally:
        application.shut_down()


def wait_s(app: QApplication, duration_s: float) -> None:
    """Run the event loop, as a window does."""
    del app
    loop = QEventLoop()
    QTimer.singleShot(round(1000 * duration_s), loop.quit)
    loop.exec()


def chain(
    name: str, library: BoardLibrary, wanted: DaqcoSettings, length_s: float, *, plot: bool
) -> list[Figure]:
    """Return what is lost, and what it costs, with everything at work."""
    app = QApplication.instance() or QApplication([])
    assert isinstance(app, QApplication)
    with tempfile.TemporaryDirectory() as folder, acquiring(library, wanted) as daqco:
        plotter = UDaqPlotter(daqco) if plot else None
        if plotter is not None:
            plotter.resize(1280, 800)
            plotter.show()
        wait_s(app, 1.0)
        file = Path(folder) / "run.h5"
        began_cpu_s, began_s = time.process_time(), time.perf_counter()
        with suppress(CosmicError), daqco.record(file):  # its failure is counted below
            wait_s(app, length_s)
        cpu = (time.process_time() - began_cpu_s) / (time.perf_counter() - began_s)
        problem = daqco.problem or daqco.recording.failure
        with open_recording(file) as recording:
            lost = sum(each.lost for each in recording.overruns)
            short_s = length_s - recording.samples / recording.rate_hz
        if plotter is not None:
            plotter.close()
            plotter.deleteLater()
            wait_s(app, 0.1)
    failed = 1.0 if problem else 0.0
    return [
        Figure(NAME, f"{name}: samples a channel lost", lost + failed, "samples", 0.0),
        Figure(NAME, f"{name}: missing at the end", max(0.0, 1000.0 * short_s), "ms"),
        Figure(NAME, f"{name}: processor", 100.0 * cpu, "% of a core", 35.0 if plot else 8.0),
    ]


def stress(factors: tuple[int, ...], length_s: float) -> list[Figure]:
    """Return how many times 32 x 15 kHz the chain with its recorder takes before it loses any."""
    found: list[Figure] = []
    most = 0
    for factor in factors:
        rate_hz = factor * 15_000.0  # beyond 15 kHz, which is as much as a channel may have
        wanted = settings(("Fast1",), 15_000.0).model_copy(update={"rate_hz": rate_hz})
        name = f"{factor} x"
        with patch("cosmic.daqco.core.plan.HIGHEST_RATE_HZ", float("inf")):
            lost, *_ = chain(name, FastLibrary(WallClock()), wanted, length_s, plot=factor == 10)
        if factor == 10:
            found.append(replace(lost, name="10 times that, with plot: samples a channel lost"))
        if lost.value:
            break
        most = factor
    return [*found, Figure(NAME, "most without a loss, recorded, times 32 x 15 kHz", most, "")]


class Step:
    """A source that is quiet until it is told to jump."""

    def __init__(self) -> None:
        self.jump_s = float("inf")

    def volts(self, times_s: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Return 0 V before the jump and 5 V after it."""
        return np.where(times_s >= self.jump_s, 5.0, 0.0)


def reactions(times: int) -> list[Figure]:
    """Return how long it takes from a crossing sample to the stop of every channel.

    Counted from when the source jumps, up to a sample before the board sees it, to the return of
    the last `SA_Stop_A`; nothing of the guard's own reckoning takes part.
    """
    source, clock = Step(), WallClock()
    one = ChannelSettings(name="force", board="Dev1", input="ai0")
    wanted = DaqcoSettings(channel=(one,), rate_hz=1000.0)
    with stand(repaint=False) as bench:
        application = DaqcoApplication(
            SimulatedLibrary(clock, {("Dev1", "ai0"): source}),
            wanted,
            clock=clock,
            policy=FailurePolicy(),
        )
        join_force_limits(application, bench.mico.application)
        application.initialize()
        plotter = UDaqPlotter(Daqco(application))
        plotter.resize(1280, 800)
        plotter.show()
        try:
            found = bench.beside(lambda: jumps(bench, Daqco(application), source, clock, times))
        finally:
            plotter.close()
            plotter.deleteLater()
            application.shut_down()
    limit = 1000.0 * wanted.chunk_s + MOST_MS
    return [
        Figure(NAME, "crossing to last stop, p50", percentile(found, 50), "ms"),
        Figure(NAME, "crossing to last stop, p99", percentile(found, 99), "ms", limit),
        Figure(NAME, "crossing to last stop, worst", max(found), "ms"),
    ]


def jumps(bench: Stand, daqco: Daqco, source: Step, clock: Clock, times: int) -> list[float]:
    """Let the source jump `times` times; return how long each took to the last stop, ms."""
    rng = random.Random(1)
    axes = len(list(bench.mico))
    reached: dict[tuple[int, int], float] = {}

    def note(_when_s: float, args: tuple[int, ...]) -> None:
        reached.setdefault((args[0], args[1]), clock.now_s())

    found: list[float] = []
    for _ in range(times):
        source.jump_s = float("inf")
        time.sleep(0.03)  # until samples of the new level have come
        bench.manager.reset_stop()
        daqco.set_limit(LimitSettings(channel="force", high=1.0, armed=True))
        reached.clear()
        bench.library.left[CALL] = note
        source.jump_s = clock.now_s() + rng.uniform(0.03, 0.05)
        wait_until(lambda: len(reached) == axes)
        del bench.library.left[CALL]
        found.append(1000.0 * (max(reached.values()) - source.jump_s))
    return found


def chunk_costs(length_s: float) -> list[Figure]:
    """Return what the shipped channels cost without a window, by the length of a chunk."""
    shipped = load_platform(None)[0].daqco
    assert shipped is not None
    found = []
    for chunk_s in (0.01, 0.005, 0.002):
        wanted = shipped.model_copy(update={"chunk_s": chunk_s})
        with acquiring(SimulatedLibrary(WallClock()), wanted):
            began_cpu_s, began_s = time.process_time(), time.perf_counter()
            time.sleep(length_s)
            cpu = (time.process_time() - began_cpu_s) / (time.perf_counter() - began_s)
        name = f"shipped channels, chunks of {1000.0 * chunk_s:g} ms: processor"
        found.append(Figure(NAME, name, 100.0 * cpu, "% of a core"))
    return found


def measure(quick: bool) -> list[Figure]:
    """Measure all of it."""
    length_s = 2.0 if quick else 60.0
    clock = WallClock()
    full = settings(("Dev1", "Dev2"), 15_000.0)
    figures = chain("32 x 15 kHz with plot", SimulatedLibrary(clock), full, length_s, plot=True)
    fast = settings(("Fast1",), 15_000.0)
    figures += chain("no source, no plot", FastLibrary(clock), fast, length_s / 4, plot=False)
    figures += stress((10,) if quick else (10, 20, 40, 80, 160), 1.0 if quick else 5.0)
    figures += chunk_costs(1.0 if quick else 10.0)
    return figures + reactions(10 if quick else 200)


if __name__ == "__main__":
    main(__doc__, measure)
