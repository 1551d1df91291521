"""A trajectory of ten thousand lines: how long it takes to read, to check and to rehearse.

The rehearsal goes through the pure gate on the shipped scene. It is set beside the time that the
same lines take on the simulated platform: a part of them is run at its own speed, and the whole
is reckoned from that.
"""

import random
import time
from collections.abc import Callable

import cosmic
from benchmarks.figures import Figure, main
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.trajectory.reader import parse

NAME = "trajectory"
LINES = 10_000
FEW = 500
RUN = 60
QUICK_RUN = 10
TELL_S = 0.5
REACH_UM = 400.0


def written(lines: int) -> str:
    """Return a trajectory that stays near the start pose: moves, blocks, steps, waits."""
    rng = random.Random(7)
    text = ["cosmic-trajectory 1", "platform FiberStation", "title benchmark", ""]
    text += [f"start {axis} 0 um" for axis in ("left.x", "left.y", "left.z", "right.z")]
    while len(text) < lines:
        kind = rng.random()
        axis = rng.choice(("left.x", "left.y", "left.z", "right.z"))
        place = f"{rng.uniform(0.0, REACH_UM) * (-1.0 if axis == 'left.x' else 1.0):.1f}"
        if kind < 0.8:
            text.append(f"{axis} to {place} um")
        elif kind < 0.9:
            other = f"    right.y to {rng.uniform(0.0, REACH_UM):.1f} um"
            text += ["together", f"    {axis} to {place} um", other, "end"]
        elif kind < 0.95:
            text.append(f"steps left.gripper {rng.choice((-5, 5))} 100 V 1000 Hz")
        else:
            text.append("speed left.y 5000 um/s  # a remark")
    return "\n".join(text) + "\n"


def took_s(action: Callable[[], object]) -> tuple[float, float]:
    """Return how long something takes, by the wall and in this thread."""
    began_s, cpu_s = time.perf_counter(), time.thread_time()
    action()
    return time.perf_counter() - began_s, time.thread_time() - cpu_s


def run_share(mico: Mico, lines: int) -> float:
    """Return how much longer than its rehearsal says a run takes on the twin."""
    mico.move({"left.x": 0.0, "left.y": 0.0, "left.z": 0.0, "right.z": 0.0})
    trajectory = mico.trajectories.parse(written(lines))
    wall_s, _ = took_s(lambda: mico.trajectories.run(trajectory))
    return wall_s / mico.trajectories.rehearse(trajectory).duration_s


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    text = written(FEW if quick else LINES)
    share = LINES / len(text.splitlines())
    with cosmic.connect(applications=("mico",)) as rig:
        mico = rig.mico
        api, times_s = mico.trajectories, []
        began_s = time.thread_time()
        read_s, read_cpu_s = took_s(
            lambda: parse(text, progress=lambda _part: times_s.append(time.thread_time()))
        )
        trajectory = parse(text)
        gaps_s = [
            later - before for before, later in zip([began_s, *times_s], times_s, strict=False)
        ]
        check_s, check_cpu_s = took_s(lambda: api.check(trajectory))
        rehearsal = api.rehearse(trajectory)  # the first one builds the pure gate as well
        _, cpu_s = took_s(lambda: api.rehearse(trajectory))
        longer = run_share(mico, QUICK_RUN if quick else RUN)
    run_s = rehearsal.duration_s * longer
    return [
        Figure(NAME, "10 000 lines read and checked", share * (read_s + check_s), "s", 5.0),
        Figure(NAME, "the same, CPU", share * (read_cpu_s + check_cpu_s), "s"),
        Figure(NAME, "longest time without progress, CPU", max(gaps_s, default=0.0), "s", TELL_S),
        Figure(NAME, "rehearsed, CPU per line", 1e3 * share * cpu_s / LINES, "ms"),
        Figure(NAME, "rehearsal beside the run (CPU / wall)", cpu_s / run_s, "", 1 / 50),
        Figure(NAME, "run beside what the rehearsal said", longer, ""),
        Figure(NAME, "refused lines", 0.0 if rehearsal.allowed else 1.0, "", 0.0),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
