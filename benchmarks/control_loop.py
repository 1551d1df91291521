"""How well a control loop keeps its period, and how well it holds a force on the twin.

The force-servo of `rig.control` at 200 Hz on the whole simulated platform in this process, in real
time. The ratio is to the same pacing with nothing else in the process. Priority is what the system
grants; where real-time priority is refused the table says 0.
"""

import numpy as np
from typing_extensions import override

import cosmic
from benchmarks.figures import Figure, main
from cosmic.autonomy.control.handle import ControlHandle
from cosmic.autonomy.control.pace import LoopTimer, PaceStatistics, ask_real_time
from cosmic.frame.clock import WALL
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread

NAME = "control_loop"
PERIOD_S = 0.005
SET_POINT_UN = 50.0
LOWER_UN = 25.0


class Bare(WorkerThread):
    """Keeps the period and does nothing."""

    def __init__(self, cycles: int) -> None:
        super().__init__("bare pace", FailurePolicy())
        self._cycles = cycles
        self.timer = LoopTimer(PERIOD_S)

    @override
    def run_body(self) -> None:
        ask_real_time(10)
        self.timer.begin()
        for _ in range(self._cycles):
            self.timer.wait()


def bare(cycles: int) -> PaceStatistics:
    """Return the pace of a thread that is alone."""
    thread = Bare(cycles)
    thread.start()
    thread.join(cycles * PERIOD_S * 10 + 5)
    return thread.timer.meter.statistics()


def errors_un(loop: ControlHandle, hold_s: float) -> tuple[float, float]:
    """Return how far the mean over 0.1 s was off, and the greatest such, while a force is held."""
    WALL.sleep(hold_s)
    trace = loop.trace(0.95 * hold_s)
    width = max(1, round(0.1 / PERIOD_S))
    off = trace.measured - trace.set_point
    means = np.convolve(off, np.ones(width) / width, mode="valid")
    return float(abs(off.mean())), float(np.abs(means).max())


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    hold_s = 0.5 if quick else 15.0
    alone = bare(100 if quick else 4000)
    with cosmic.connect(applications=("mico", "daqco")) as rig:
        rig.mico.move({"left.z": -800.0, "left.x": 3600.0})
        rig.mico["probe.y"].move_to(-4975.0)
        begun_s = WALL.now_s()
        with rig.control.hold_force("force", "probe.y", SET_POINT_UN, direction=-1) as loop:
            loop.wait_settled(timeout_s=60.0)
            settled_s = WALL.now_s() - begun_s
            off_un, most_un = errors_un(loop, hold_s)
            peak_un = float(loop.trace(20.0).measured.max())
            loop.aim(LOWER_UN)
            loop.wait_settled(timeout_s=60.0)
            lower_off_un, lower_most_un = errors_un(loop, hold_s)
            statistics = loop.statistics
    pace = statistics.pace
    deviation_ms, alone_ms = 1e3 * pace.deviation_p99_s, 1e3 * alone.deviation_p99_s
    return [
        Figure(NAME, "period off by, p99", deviation_ms, "ms", 2.0),
        Figure(NAME, "period, p50", 1e3 * pace.period_p50_s, "ms"),
        Figure(NAME, "longest period", 1e3 * pace.longest_s, "ms"),
        Figure(NAME, "missed, of 1000", 1e3 * pace.missed / pace.cycles, "periods"),
        Figure(NAME, "alone: period off by, p99", alone_ms, "ms"),
        Figure(NAME, "period off by, to alone", deviation_ms / alone_ms, ""),
        Figure(NAME, "real-time priority", 0.0 if statistics.real_time else 1.0, "granted"),
        Figure(NAME, "approach 25 um, push 50 uN: until held", settled_s, "s"),
        Figure(NAME, "force while held at 50 uN, off by", off_un, "uN", 2.5),
        Figure(NAME, "the same, greatest over 0.1 s", most_un, "uN", 2.5),
        Figure(NAME, "force while held at 25 uN, off by", lower_off_un, "uN", 2.0),
        Figure(NAME, "the same, greatest over 0.1 s", lower_most_un, "uN", 2.0),
        Figure(NAME, "peak above 50 uN", max(0.0, peak_un - SET_POINT_UN), "uN"),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
