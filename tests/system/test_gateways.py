"""The simulated platform through its gateways: ophyd's motor, a notebook over HTTP, other files."""

import io
import json
import os
import random
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import httpx
import numpy as np
import pytest
import tifffile

from contract.station_rig import free_port, wait_until
from system.docs_blocks import ROOT, blocks
from system.served_program import served_program

pytestmark = pytest.mark.slow
TUTORIALS: Final = ROOT / "docs" / "tutorials"
ADDRESS: Final = "http://127.0.0.1:8470"

CHILD: Final = Path(__file__).with_name("ophyd_child.py")
MAJOR: Final = 2
ASYNC_CHILD: Final = Path(__file__).with_name("ophyd_async_child.py")


@dataclass
class Served:
    http: httpx.Client
    port: int
    token: str


@pytest.fixture(scope="module")
def station(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    port, web = port_for_searches(), free_port()
    folder = tmp_path_factory.mktemp("served")
    more = {"EPICS_CA_SERVER_PORT": str(port)}
    options = ("--epics", "COSMIC:")
    with served_program(folder, web, free_port(), *options, variables=more) as program:
        yield Served(program.http, port, program.token)


@pytest.fixture
def served(station: Served) -> Iterator[Served]:
    """The station, left for the next test as it was found, whatever becomes of this one."""
    yield station
    http = station.http
    assert wait_until(lambda: http.get("/api/station").json()["control"]["local"])
    if http.get("/api/mico/state/stop_state").json()["reason"] is not None:
        assert http.post("/api/control").is_success
        assert http.post("/api/mico/reset_stop", json={}).is_success
    http.delete("/api/control")


def port_for_searches() -> int:
    """Return a port for TCP and UDP that no system gives away by itself while a station starts."""
    while True:
        port = random.randrange(15_000, 30_000)
        tcp, udp = socket.socket(), socket.socket(type=socket.SOCK_DGRAM)
        with tcp, udp, suppress(OSError):
            tcp.bind(("127.0.0.1", port))
            udp.bind(("", port))
            return port


def of_epics(served: Served) -> dict[str, str]:
    """Return the environment of a client of the station."""
    return os.environ | {
        "EPICS_CA_SERVER_PORT": str(served.port),
        "EPICS_CA_ADDR_LIST": "127.0.0.1",
        "EPICS_CA_AUTO_ADDR_LIST": "NO",
        "OPHYD_CONTROL_LAYER": "caproto",
    }


class Child:
    """A client of EPICS that says what it found, and goes on when it is told to."""

    def __init__(self, process: "subprocess.Popen[str]", complaints: Path) -> None:
        self._process, self._complaints = process, complaints

    def found(self) -> Any:
        assert self._process.stdout is not None
        said = self._process.stdout.readline()
        assert said, self._complaints.read_text()
        return json.loads(said)

    def go_on(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write("\n")
        self._process.stdin.flush()


@contextmanager
def client(script: Path, served: Served, folder: Path) -> Iterator[Child]:
    complaints = folder / "complaints.txt"
    with complaints.open("w") as stderr:
        process = subprocess.Popen(
            [sys.executable, "-W", "ignore", str(script)],
            env=of_epics(served),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=stderr,
            text=True,
        )
    try:
        yield Child(process, complaints)
    finally:
        process.kill()
        process.communicate(timeout=10)


def test_ophyds_motor_drives_an_axis_unchanged(served: Served, tmp_path: Path) -> None:
    with client(CHILD, served, tmp_path) as ophyd:
        found = ophyd.found()
        assert found["without control"] == "UnknownStatusFailure"
        assert found["with control"] == pytest.approx(10.0, abs=1.0)
        assert found["again"] == [pytest.approx(10.0, abs=1.0)] * 5
        assert found["asked"] == [0.0, 5.0, 10.0, 15.0, 20.0]
        assert found["scan"] == pytest.approx(found["asked"], abs=1.0)
        assert np.isfinite(found["force"]).all()
        assert found["turned"] == pytest.approx(3.0, abs=0.1)
        assert found["units"] == ["um", "deg"]
        assert found["limits"] == [-5500.0, 5500.0]
        assert found["beyond"] == "LimitError"
        height, width = tifffile.imread(
            io.BytesIO(served.http.get("/api/images/microscope.tif").content)
        ).shape
        image = found["image"]
        assert image["shape"] == [height, width]
        assert 20.0 < image["mean"] < 250.0
        assert (image["kind"], image["colours"]) == ("UInt8", "Mono")
        assert image["of"] == "microscope"
        assert served.http.post("/api/mico/stop", json={"reason": "test"}).is_success
        ophyd.go_on()
        stopped = {"while stopped": "UnknownStatusFailure", "alarm": 18}  # DISABLE
        assert ophyd.found() == stopped
    assert wait_until(lambda: served.http.get("/api/station").json()["control"]["local"], 5.0)


@pytest.mark.skipif(find_spec("ophyd_async") is None, reason="there is no ophyd-async here")
def test_ophyd_asyncs_motor_drives_an_axis_unchanged(served: Served, tmp_path: Path) -> None:
    with client(ASYNC_CHILD, served, tmp_path) as ophyd:
        found = ophyd.found()
        assert found["without control"] == [pytest.approx(0.0, abs=50.0), MAJOR]
        assert found["together"] == [pytest.approx(10.0, abs=1.0), pytest.approx(3.0, abs=0.1)]
        assert found["scan"] == pytest.approx([0.0, 5.0, 10.0, 15.0, 20.0], abs=1.0)
        assert found["units"] == {"motor": "um", "force": "uN"}
        assert found["beyond"] == "MotorLimitsError"
        assert served.http.post("/api/mico/stop", json={"reason": "test"}).is_success
        ophyd.go_on()
        assert ophyd.found() == {"while stopped": [pytest.approx(20.0, abs=1.0), MAJOR]}
    assert wait_until(lambda: served.http.get("/api/station").json()["control"]["local"], 5.0)


def test_a_notebook_moves_reads_and_fetches_over_http(served: Served) -> None:
    http = served.http
    assert http.get("/api/station").json()["applications"] == ["mico", "daqco", "vico"]
    with httpx.Client() as stranger:
        assert stranger.get(f"{http.base_url}/api/mico/state").status_code == 401
    motion = {"motion": {"kind": "MoveTo", "target": 12.0, "unit": "um"}}
    path = "/api/mico/axes/left.x/begin?wait=10"
    assert http.post(path, json=motion).json()["error"]["verdict"]["reason"] == "NO_LEASE"
    http.post("/api/control")
    assert http.post(path, json=motion).json()["result"] == pytest.approx(12.0, abs=1.0)
    motion["motion"]["target"] = 1e6
    beyond = http.post(path, json=motion)
    assert beyond.status_code == 409
    assert beyond.json()["error"]["verdict"]["reason"] == "LIMIT"
    http.delete("/api/control")
    position = http.get("/api/mico/state/axes/left.x/_latest/position").json()
    assert position == pytest.approx(12.0, abs=1.0)
    image = http.get("/api/images/microscope.tif")
    assert image.headers["content-type"] == "image/tiff"
    assert wait_until(lambda: http.get("/api/images/microscope.jpg").is_success)


def test_a_recording_is_made_listed_and_fetched(served: Served) -> None:
    http = served.http
    made = http.post("/api/daqco/start_recording", json={"path": "over_http.h5", "overwrite": True})
    assert made.is_success, made.text
    assert http.post("/api/daqco/stop_recording", json={}).is_success
    names = [each["name"] for each in http.get("/api/files").json()]
    assert "over_http.h5" in names
    fetched = http.get("/api/files/over_http.h5")
    assert fetched.content[:8] == b"\x89HDF\r\n\x1a\n"
    assert http.get("/api/files/..%2F..%2Fetc%2Fpasswd").status_code == 404


def test_an_image_over_http_has_its_scale_and_time(served: Served) -> None:
    coded = served.http.get("/api/images/microscope.tif").content
    with tifffile.TiffFile(io.BytesIO(coded)) as tif:
        assert tif.asarray().shape == (1200, 1600)
        assert "AcquisitionDate" in tif.ome_metadata
        assert "left.x_um" in tif.ome_metadata


@pytest.mark.skipif(
    find_spec("PySide6.QtWebEngineWidgets") is None, reason="there is no browser of Qt here"
)
def test_the_page_shows_no_force_of_before(served: Served) -> None:
    script = ROOT / "tests" / "contract" / "browser_child.py"
    page = f"{str(served.http.base_url).rstrip('/')}/#token={served.token}"
    browser = subprocess.Popen(
        [sys.executable, str(script), page, "no samples"],
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    time.sleep(5.0)  # until it is shown
    try:
        assert served.http.post("/api/daqco/stop", json={}).is_success
        said, _ = browser.communicate(timeout=45.0)
    finally:
        browser.kill()
        browser.communicate()
        served.http.post("/api/daqco/start", json={})
    assert "no samples" in said


def followed(page: str, served: Served, folder: Path, first: str = "", **words: str) -> None:
    """Run the blocks of a tutorial one after the other, in a process that has only them."""
    code = "\n".join(
        (first, *(each.text for each in blocks(TUTORIALS / page) if each.language == "python"))
    )
    for word, instead in words.items():
        code = code.replace(word, instead)
    ended = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code],
        env=of_epics(served),
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=110,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr


def test_the_tutorial_of_the_notebook_runs(served: Served, tmp_path: Path) -> None:
    where = str(served.http.base_url).rstrip("/")
    followed("from-a-notebook.md", served, tmp_path, TOKEN=served.token, **{ADDRESS: where})
    assert (tmp_path / "notebook.h5").stat().st_size > 1000
    with tifffile.TiffFile(tmp_path / "now.tif") as tif:
        assert tif.is_ome


def test_the_tutorial_of_epics_runs(served: Served, tmp_path: Path) -> None:
    # A client asks for an answer within 1 s, which beside other programs is no failure of ours.
    patient = "from ophyd.signal import EpicsSignalBase as Base\n"
    patient += "Base.set_defaults(connection_timeout=60, timeout=60)"
    followed("drive-it-from-epics.md", served, tmp_path, first=patient, **{"(20)": "(60)"})
