"""A start loads no library that takes long and is not needed before somebody works."""

import subprocess
import sys

HEAVY = ("trimesh", "networkx", "scipy.stats", "scipy.optimize", "yourdfpy", "matplotlib", "pandas")
PROGRAM = f"""
import sys
from cosmic.app.platform import build_platform
build_platform().shut_down()
sys.stdout.write(", ".join(each for each in {HEAVY} if each in sys.modules))
"""


def loaded_by(program: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def test_building_the_shipped_platform_loads_no_heavy_library() -> None:
    assert loaded_by(PROGRAM) == ""


WINDOW = f"""
import sys
from PySide6.QtCore import QTimer
from cosmic.app.windows import run_window
from cosmic.app.windows.operator_window import OperatorWindow

def looked(window):
    seen.update(each for each in {(*HEAVY, "av", "sdl2")} if each in sys.modules)
    window.close()

def open_and_look(window):
    QTimer.singleShot(200, window, lambda: looked(window))

seen = set()
OperatorWindow.open_hardware = open_and_look
run_window.run_window(run_window.WindowOptions(offscreen_s=20.0))
sys.stdout.write(", ".join(sorted(seen)))
"""


def test_a_window_loads_no_heavy_library_before_its_panel_is_looked_at() -> None:
    assert loaded_by(WINDOW) == ""
