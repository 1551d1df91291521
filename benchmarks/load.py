"""CPU time of the whole process, as a share of one core: window open, idle and busy.

Nothing is painted that the program does not paint by itself. The simulated library runs in the
same process; its share is measured in a run of its own, with a clock around each of its functions,
and told apart, because a real library would cost something else.
"""

import os
import time
from pathlib import Path

from benchmarks.figures import Figure, main
from benchmarks.stand import Stand, Traffic, stand

NAME = "load"
TASKS = Path("/proc/self/task")
SLOW_HZ = 400  # 0.6 mm/s: one way takes 17 s, so that nothing but motion is measured


def share(seconds: float) -> float:
    """Return the share of a core that this process takes during `seconds`, in percent."""
    began_s, cpu_s = time.perf_counter(), time.process_time()
    time.sleep(seconds)
    return 100.0 * (time.process_time() - cpu_s) / (time.perf_counter() - began_s)


def threads() -> dict[str, float]:
    """Return the CPU seconds of this process' threads so far by name; empty outside Linux."""
    found: dict[str, float] = {}
    for task in TASKS.glob("*") if TASKS.exists() else ():
        name = (task / "comm").read_text(encoding="utf-8").strip().rstrip("0123456789 ")
        name = "GUI" if task.name == str(os.getpid()) else name
        spent_ns = int((task / "schedstat").read_text(encoding="utf-8").split()[0])
        found[name] = found.get(name, 0.0) + 1e-9 * spent_ns
    return found


def moving(bench: Stand, seconds: float) -> tuple[float, dict[str, float]]:
    """Return the share with every axis in motion, and that of each kind of thread."""
    traffic = Traffic(bench.mico, SLOW_HZ)
    traffic.start()
    time.sleep(min(1.0, seconds))
    before = threads()
    percent = share(seconds)
    after = threads()
    traffic.end()
    kinds = {
        name: 100.0 * (spent - before.get(name, 0.0)) / seconds for name, spent in after.items()
    }
    return percent, kinds


def library_share(bench: Stand, seconds: float) -> float:
    """Return what the simulated library takes with every axis in motion, in percent."""
    traffic = Traffic(bench.mico, SLOW_HZ)
    traffic.start()
    time.sleep(min(1.0, seconds))
    began_s, cpu_s = time.perf_counter(), bench.library.cpu_s
    time.sleep(seconds)
    traffic.end()
    return 100.0 * (bench.library.cpu_s - cpu_s) / (time.perf_counter() - began_s)


def idle(seconds: float) -> float:
    """Return the share while nothing moves."""
    time.sleep(min(2.0, seconds))
    return share(seconds)


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    seconds = 0.05 if quick else 6.0
    devices = 1 if quick else 16
    with stand(repaint=False, traced=False) as bench:
        idle_percent = bench.beside(lambda: idle(seconds))
    with stand(repaint=False, traced=False) as bench:
        eleven, _ = bench.beside(lambda: moving(bench, seconds))
    with stand(repaint=False, traced=False, devices=devices) as bench:
        many, kinds = bench.beside(lambda: moving(bench, seconds))
    with stand(repaint=False, count_cpu=True, devices=devices) as bench:
        of_library = bench.beside(lambda: library_share(bench, seconds))
    title = f"{devices} devices, {3 * devices} axes moving"
    figures = [
        Figure(NAME, "idle, window open", idle_percent, "% of a core", 5),
        Figure(NAME, "4 devices, 11 axes moving", eleven, "% of a core"),
        Figure(NAME, title, many, "% of a core", 30),
        Figure(NAME, "of these: the simulated library", of_library, "% of a core"),
    ]
    biggest = sorted(kinds.items(), key=lambda item: -item[1])
    figures += [
        Figure(NAME, f"of these: threads '{name}'", percent, "% of a core")
        for name, percent in biggest
        if percent >= 0.5
    ]
    return figures


if __name__ == "__main__":
    main(__doc__, measure)
