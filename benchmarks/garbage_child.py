"""The process that `benchmarks.garbage` starts: how long a window with a campaign stands still."""

import gc
import json
import sys
import tempfile
import threading
import time
from pathlib import Path

from PySide6.QtCore import QTimer

from cosmic.app.cli import main
from cosmic.app.windows import run_window
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.frame.garbage import objects_of

SECONDS = float(sys.argv[1])
TICK_S = 0.001
SETTLE_MS = 2000
open_hardware = OperatorWindow.open_hardware


class Pauses:
    """Notes how long each collection took, and how late a thread was that ticks."""

    def __init__(self) -> None:
        self.took_s: dict[int, list[float]] = {0: [], 1: [], 2: []}
        self.cpu_s = 0.0
        self.late_s = 0.0
        self._began_s = self._began_cpu_s = 0.0
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._tick, daemon=True)

    def begin(self) -> None:
        """Watch from now on."""
        gc.callbacks.append(self._on_collection)
        self._thread.start()

    def end(self) -> None:
        """Watch no longer."""
        gc.callbacks.remove(self._on_collection)
        self._over.set()
        self._thread.join()

    def _on_collection(self, phase: str, info: dict[str, int]) -> None:
        if phase == "start":
            self._began_s, self._began_cpu_s = time.perf_counter(), time.thread_time()
        else:
            self.cpu_s = max(self.cpu_s, time.thread_time() - self._began_cpu_s)
            self.took_s[info["generation"]].append(time.perf_counter() - self._began_s)

    def _tick(self) -> None:
        last_s = time.perf_counter()
        while not self._over.wait(TICK_S):
            now_s = time.perf_counter()
            self.late_s = max(self.late_s, now_s - last_s - TICK_S)
            last_s = now_s


def full_look_s() -> float:
    """Return the CPU time of one look through all objects, s: what Python's own rules come to."""
    gc.unfreeze()
    began_s = time.thread_time()
    gc.collect()
    return time.thread_time() - began_s


def _opened(window: OperatorWindow) -> None:
    open_hardware(window)
    QTimer.singleShot(SETTLE_MS, window, lambda: _work(window))


def _work(window: OperatorWindow) -> None:
    campaign = window._rig.campaign("quick", Path(folder) / "campaign")
    began_s = time.process_time()
    pauses.begin()
    campaign.start()

    def finish() -> None:
        pauses.end()
        found.update(
            full_ms=1e3 * full_look_s(),
            longest_cpu_ms=1e3 * pauses.cpu_s,
            late_ms=1e3 * pauses.late_s,
            cpu_s=time.process_time() - began_s,
            longest_ms={n: 1e3 * max(all_s, default=0.0) for n, all_s in pauses.took_s.items()},
            counts={n: len(all_s) for n, all_s in pauses.took_s.items()},
            total_ms=1e3 * sum(sum(all_s) for all_s in pauses.took_s.values()),
            objects=objects_of() + gc.get_freeze_count(),
            running=not campaign.over,
        )
        campaign.abort("the benchmark is over")
        window.close_now()

    QTimer.singleShot(round(1000 * SECONDS), window, finish)


if __name__ == "__main__":
    pauses, found = Pauses(), {}
    run_window.OperatorWindow.open_hardware = _opened  # type: ignore[method-assign]
    with tempfile.TemporaryDirectory() as folder:
        code = main(["--offscreen", str(SECONDS + 60.0)])
        sys.stdout.write(json.dumps(found) + "\n")
    sys.exit(code or not found)
