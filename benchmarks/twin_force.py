"""CPU time of the twin's force side for a second of the platform's time.

Two sensors are read at 15 kHz in chunks of 5 ms, as two boards with a guarded channel do, with
nothing moving, with the probe pushing, and with the probe sliding along the fibre. The ratio is
to a filter of one pole in plain Python over the same samples, in the same run.
"""

import time
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from benchmarks.figures import Figure, main
from cosmic.frame.clock import ManualClock
from cosmic.frame.config import shipped_config_dir
from cosmic.twin.cantilever import Cantilever
from cosmic.twin.force_side import ForceSide
from cosmic.twin.plates import Plates
from cosmic.twin.rod import EI_UN_UM2_PER_N_M2, held_at_both_ends
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings
from cosmic.twin.world import PLAIN, load_world

NAME = "twin_force"
RATE_HZ = 15_000.0
CHUNK = 75
Read = Callable[[npt.NDArray[np.float64]], object]


class Rig:
    """A scene and its time."""

    def __init__(self, world: str = PLAIN) -> None:
        settings = shipped_settings()
        drawn = load_world(world, shipped_config_dir())
        plates = Plates(drawn.applied(settings, 1), drawn, 1)
        self.scene = Scene.from_settings(plates.first(), ManualClock(), 1, plates=plates)
        assert self.scene.force_side is not None
        self.force_side: ForceSide = self.scene.force_side
        self.now_s = 0.0

    def go(self, name: str, target: float, speed: float) -> float:
        """Begin to move a stage, and return when it stands."""
        stage = self.scene.stages[name]
        route = stage.route(self.now_s)
        route.go(target, speed)
        stage.follow(route, held_until_s=1e9)
        return route.end_s

    def touch(self) -> None:
        """Bring the probe to the fibre: what is solved once for a grasp is a figure of its own."""
        self.now_s = self.go("probe.y", -4986.0, 2000.0) + 0.01
        self.force_side.timeline.moment(self.now_s)

    def cost(self, duration_s: float, *reads: Read) -> float:
        """Return CPU seconds for a second of platform time while `reads` are asked."""
        times = self.now_s + np.arange(round(duration_s * RATE_HZ)) / RATE_HZ
        self.now_s += duration_s
        before_s = time.thread_time()
        for start in range(0, times.size, CHUNK):
            for read in reads:
                read(times[start : start + CHUNK])
        return (time.thread_time() - before_s) / duration_s


def plain_filter_s(duration_s: float) -> float:
    """Return CPU seconds for a second of a one-pole filter in plain Python."""
    count = round(duration_s * RATE_HZ)
    before_s, state = time.thread_time(), 0.0
    for number in range(count):
        state += 0.3 * (number % 7 - state)
    return (time.thread_time() - before_s) / duration_s


def curve_us(make: Callable[[float], object], count: int) -> float:
    """Return CPU us for a curve that is not in the cache."""
    before_s = time.thread_time()
    for number in range(count):
        make(300.0 + 0.02 * number)
    return 1e6 * (time.thread_time() - before_s) / count


def cantilever(line_um: npt.NDArray[np.float64], ei: float) -> Cantilever:
    """Return a fibre clamped 8 um inside the jaws."""
    return Cantilever(*line_um.T, ei_un_um2=ei, depth_um=8.0, radius_um=25.0)


def second_s(rig: Rig, duration_s: float) -> tuple[float, float, float]:
    """Return CPU seconds for a second with nothing moving, with a push, and with a slide."""
    sensors = rig.force_side.sensors
    reads = tuple(sensors[name].volts for name in ("force", "spare"))
    for name, target in (("left.x", 3600.0), ("left.z", -810.0), ("probe.y", -4950.0)):
        rig.now_s = rig.go(name, target, 2000.0) + 0.01
        rig.force_side.timeline.moment(rig.now_s)
    still_s = rig.cost(duration_s, *reads)
    rig.touch()
    rig.go("probe.y", -5030.0, 50.0 / (2.0 * duration_s))
    pushing_s = rig.cost(duration_s, *reads)
    rig.now_s += duration_s + 0.01
    rig.go("left.x", 3400.0, 200.0 / (2.0 * duration_s))
    sliding_s = rig.cost(duration_s, *reads)
    return still_s, pushing_s, sliding_s


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    duration_s, count = (0.05, 5) if quick else (2.0, 500)
    plain_s = plain_filter_s(duration_s)
    still_s, pushing_s, sliding_s = second_s(Rig(), duration_s)
    real_still_s, real_pushing_s, real_sliding_s = second_s(Rig("realistic"), duration_s)
    ei, ea = 5e-11 * EI_UN_UM2_PER_N_M2, 7.2e6
    line = np.array([[0.0, 0.0], [600.0, 20.0], [1190.0, 80.0]])
    grasp_us = curve_us(lambda span: cantilever(line, ei).curve(span, sensor_un_um=800.0), 5)
    one = cantilever(line, ei)
    one_us = curve_us(lambda span: one.curve(span, sensor_un_um=800.0), count)
    both_us = curve_us(
        lambda span: held_at_both_ends(
            ei_un_um2=ei, ea_un=ea, span_um=span, distance_um=1000.0, slack_um=0.0,
            gripper_un_um=100.0, sensor_un_um=800.0,
        ),
        count,
    )  # fmt: skip
    return [
        Figure(NAME, "two sensors, nothing moves", still_s, "s CPU a second", 0.045),
        Figure(NAME, "two sensors, probe pushes", pushing_s, "s CPU a second", 0.045),
        Figure(NAME, "two sensors, probe slides along", sliding_s, "s CPU a second", 0.1),
        Figure(NAME, "realistic world, nothing moves", real_still_s, "s CPU a second", 0.03),
        Figure(NAME, "realistic world, probe pushes", real_pushing_s, "s CPU a second", 0.03),
        Figure(NAME, "realistic world, probe slides along", real_sliding_s, "s CPU a second"),
        Figure(NAME, "probe pushes, to a plain filter", pushing_s / plain_s, "times"),
        Figure(NAME, "all curves of a grasp", grasp_us, "us CPU"),
        Figure(NAME, "curve of a fibre held at one end", one_us, "us CPU"),
        Figure(NAME, "curve of a fibre held at both ends", both_us, "us CPU"),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
