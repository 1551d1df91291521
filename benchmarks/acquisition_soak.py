"""Acquisition at full rate for a long time, recorded and plotted: nothing is lost, nothing grows.

`python -m benchmarks.acquisition_soak --minutes 30`. A new file is begun each minute and the one
before is removed, so that the disk lasts. The first tenth is warm-up: plot and buffers fill.
"""

import argparse
import gc
import tempfile
from pathlib import Path

from PySide6.QtWidgets import QApplication

from benchmarks.acquisition import acquiring, settings, wait_s
from benchmarks.figures import Figure, table
from benchmarks.soak import resident_kb, thread_count
from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.api.recording import open_recording
from cosmic.daqco.gui.plotter import UDaqPlotter
from cosmic.daqco.hw.sim_library import SimulatedLibrary
from cosmic.frame.clock import WallClock

NAME = "acquisition_soak"
PIECES = 30


def one_file(app: QApplication, daqco: Daqco, file: Path, length_s: float) -> int:
    """Record for a while and return how many samples a channel were lost."""
    with daqco.record(file):
        wait_s(app, length_s)
    with open_recording(file) as recording:
        lost = sum(each.lost for each in recording.overruns)
    file.unlink()
    return lost


def soak(minutes: float) -> list[Figure]:
    """Return what was lost and what grew."""
    existing = QApplication.instance()
    app = existing if isinstance(existing, QApplication) else QApplication([])
    wanted = settings(("Dev1", "Dev2"), 15_000.0)
    lost, resident, threads = 0, [], []
    with (
        tempfile.TemporaryDirectory() as folder,
        acquiring(SimulatedLibrary(WallClock()), wanted) as daqco,
    ):
        plotter = UDaqPlotter(daqco)
        plotter.resize(1280, 800)
        plotter.show()
        for number in range(PIECES):
            lost += one_file(app, daqco, Path(folder) / f"{number}.h5", 60.0 * minutes / PIECES)
            gc.collect()
            resident.append(resident_kb())
            threads.append(thread_count())
        problem = daqco.problem
        plotter.close()
        plotter.deleteLater()
        wait_s(app, 0.1)
    warm = PIECES // 10
    return [
        Figure(NAME, "length", minutes, "min"),
        Figure(NAME, "samples a channel lost", lost + (1.0 if problem else 0.0), "samples", 0.0),
        Figure(NAME, "resident after the warm-up", resident[warm], "kB"),
        Figure(NAME, "resident grown since", resident[-1] - resident[warm], "kB", 20_000.0),
        Figure(NAME, "threads more", threads[-1] - threads[warm], "threads", 0.0),
    ]


def measure(quick: bool = False) -> list[Figure]:
    """Measure for ten minutes."""
    return soak(0.1 if quick else 10.0)


def main() -> None:
    """Read the command line and run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=30.0)
    print(table(soak(parser.parse_args().minutes)))


if __name__ == "__main__":
    main()
