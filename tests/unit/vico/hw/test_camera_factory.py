"""Cameras by the name of their backend."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from contract.cameras.harvesters import HarvestersRig, virtual_producer
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import ConfigError
from cosmic.vico.hw.factory import make_camera_library


def test_each_backend_has_its_own_cameras_and_none_stands_in() -> None:
    opencv = make_camera_library("opencv", sources=["http://127.0.0.1:9/none"])
    assert opencv.name.startswith("OpenCV")
    assert [each.key for each in opencv.cameras()][:1] == ["http://127.0.0.1:9/none"]
    opencv.close()


def test_gentl_is_made_from_its_producers() -> None:
    producer = virtual_producer()
    if HarvestersRig.missing() or producer is None:
        pytest.skip(HarvestersRig.missing())
    library = make_camera_library("harvesters", producers=[producer])
    assert len(library.cameras()) == 3
    assert "viky.cti" in library.name
    library.close()


def test_gentl_takes_the_installed_producers_where_none_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    producer = virtual_producer()
    if HarvestersRig.missing() or producer is None:
        pytest.skip(HarvestersRig.missing())
    folders = (str(tmp_path / "not there"), "", str(producer.parent))
    monkeypatch.setenv("GENICAM_GENTL64_PATH", os.pathsep.join(folders))
    library = make_camera_library("harvesters")
    assert "viky.cti" in library.name
    library.close()


def test_what_a_backend_needs_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GENICAM_GENTL64_PATH", raising=False)
    with pytest.raises(ConfigError, match=r"\.cti"):
        make_camera_library("harvesters")
    with pytest.raises(ConfigError, match="scene"):
        make_camera_library("simulated", clock=ManualClock())
    with pytest.raises(ConfigError, match=r"'webcam'.*opencv \(cosmic .*simulated"):
        make_camera_library("webcam")


def test_importing_the_factory_loads_no_backend() -> None:
    code = (
        "import sys, cosmic.vico.hw.factory as f; f.make_camera_library('opencv').close();"
        "print(*(each for each in ('harvesters', 'genicam', 'cosmic.twin.scene', "
        "'cosmic.vico.hw.aravis') if each in sys.modules))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=60
    )
    assert not done.stdout.strip()
