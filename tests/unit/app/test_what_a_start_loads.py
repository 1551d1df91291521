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


def test_building_the_shipped_platform_loads_no_heavy_library() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
