"""What works without the extras, what names a missing one, and a station without widgets."""

import json
import signal
import subprocess
import sys

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


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What a program without any extra said, by what it was asked; started once for all."""
    file = tmp_path_factory.mktemp("without") / "run.h5"
    parts = "".join(
        f"""
{code}
try:
    said[{extra!r}] = repr(ask())
except cosmic.CosmicError as exc:
    said[{extra!r}] = str(exc)
"""
        for extra, code in ASKED.items()
    )
    done = run(
        f"""
import json, os
import cosmic
said = {{}}
with cosmic.connect(rate=20.0) as rig:
    rig.mico["left.x"].move_by(5.0)
    said["run"] = f"{{rig.vico.snap().shape}} {{sorted(rig.daqco.latest())}}"
    with rig.daqco.record({str(file)!r}):
        pass
from cosmic.daqco.api.export import export_file
try:
    export_file({str(file)!r}, "tdms")
except cosmic.NotAvailable as exc:
    said["export"] = str(exc)
said["folder"] = " ".join(os.listdir({str(file.parent)!r}))
{parts}
print(json.dumps(said))
""",
        *EXTRAS,
    )
    assert done.returncode == 0, done.stderr
    found: dict[str, str] = json.loads(done.stdout.splitlines()[-1])
    return found


@pytest.mark.parametrize("extra", ASKED)
def test_what_needs_an_extra_names_it_where_it_is_missing(said: dict[str, str], extra: str) -> None:
    assert f"needs the extra '{extra}': pip install cosmic[{extra}]" in said[extra]


def test_an_export_to_tdms_names_its_extra_and_leaves_nothing(said: dict[str, str]) -> None:
    assert "Export to TDMS needs the extra 'tdms': pip install cosmic[tdms]" in said["export"]
    assert "run.h5" in said["folder"]
    assert "tdms" not in said["folder"]


def test_all_applications_run_without_any_extra(said: dict[str, str]) -> None:
    assert "force" in said["run"]


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
