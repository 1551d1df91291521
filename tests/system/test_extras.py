"""What works without the extras, what names a missing one, and a station without widgets."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

BLOCK = """
import sys
for name in {names!r}:
    sys.modules[name] = None
"""
EXTRAS = (
    "av",
    "nptdms",
    "sdl2",
    "harvesters",
    "genicam",
    "vhacdx",
    "zenoh",
    "msgpack",
    "qtconsole",
)
WIDGETS = ("PySide6.QtWidgets", "PySide6.QtGui", "PySide6.QtOpenGLWidgets", "pyqtgraph", "superqt")
ASKED = {
    "video": """
from cosmic.vico.core.recording.video_writer import check_codec
from cosmic.vico.core.recording.formats import ImageFormat, traits
coded = next(each for each in ImageFormat if traits(each).codec)
ask = lambda: check_codec(coded)
""",
    "gamepad": "from cosmic.mico.hw.sdl_library import load_sdl as ask",
    "gentl": """
from cosmic.vico.hw.factory import make_camera_library
ask = lambda: make_camera_library("harvesters", producers=["any.cti"])
""",
}


def run(code: str, *blocked: str) -> subprocess.CompletedProcess[str]:
    """Run `code` in a Python where some packages cannot be imported."""
    return subprocess.run(
        [sys.executable, "-c", BLOCK.format(names=blocked) + code],
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )


@pytest.mark.parametrize("extra", ASKED)
def test_what_needs_an_extra_names_it_where_it_is_missing(extra: str) -> None:
    code = f"""
from cosmic.frame.errors import CosmicError
{ASKED[extra]}
try:
    ask()
except CosmicError as exc:
    print(exc)
"""
    done = run(code, *EXTRAS)
    assert f"needs the extra '{extra}': pip install cosmic[{extra}]" in done.stdout, done.stderr


def test_an_export_to_tdms_names_its_extra_and_leaves_nothing(tmp_path: Path) -> None:
    code = f"""
import cosmic
with cosmic.connect(applications=("daqco",), rate=20.0) as rig:
    with rig.daqco.record({str(tmp_path / "run.h5")!r}):
        pass
from cosmic.daqco.api.export import export_file
try:
    export_file({str(tmp_path / "run.h5")!r}, "tdms")
except cosmic.NotAvailable as exc:
    print(exc)
"""
    done = run(code, *EXTRAS)
    assert "Export to TDMS needs the extra 'tdms': pip install cosmic[tdms]" in done.stdout, done
    assert [each.name for each in tmp_path.iterdir() if "tdms" in each.name] == []


def test_all_applications_run_without_any_extra() -> None:
    code = """
import cosmic
with cosmic.connect(rate=20.0) as rig:
    rig.mico["left.x"].move_by(5.0)
    print(rig.vico.snap().shape, sorted(rig.daqco.latest()))
"""
    done = run(code, *EXTRAS)
    assert done.returncode == 0, done.stderr
    assert "force" in done.stdout


def test_a_station_needs_no_widgets() -> None:
    code = """
from cosmic.app.cli import main
code = main(["serve", "--listen", "tcp/127.0.0.1:0"])
print(",".join(name for name, module in sys.modules.items() if module is not None))
sys.exit(code)
"""
    with subprocess.Popen(
        [sys.executable, "-c", BLOCK.format(names=WIDGETS) + code],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as station:
        assert station.stdout is not None
        assert "tcp/127.0.0.1" in station.stdout.readline()
        station.send_signal(signal.SIGTERM)
        said, _ = station.communicate(timeout=60)
    assert station.returncode == 0
    loaded = set(said.split("\n")[-2].split(","))
    assert "cosmic.app.commands.serve" in loaded
    assert not set(WIDGETS) & loaded
