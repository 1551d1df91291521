"""Images over PV Access, as p4p of another process reads them: NTNDArrays nobody can write to."""

import json
import subprocess
import sys
import time
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from cosmic.app.configuration.gateways import EpicsSettings
from cosmic.frame.errors import NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.station import Station
from cosmic.vico.api.sent_image import SentImage
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.hw.interface import Frame

pytestmark = pytest.mark.skipif(find_spec("p4p") is None, reason="there is no p4p here")

CHILD = Path(__file__).with_name("pva_child.py")
TOPIC = "vico/camera_handles/microscope/shown"
NAME = "T:microscope:Pva1:Image"


def image(number: int, data: np.ndarray) -> SentImage:
    frame = Frame(data, frame_id=number, time_s=1.0, exposed_s=0.9)
    return SentImage.of(CameraImage("microscope", frame, Circumstances()), None)


@pytest.mark.timeout(60)
@pytest.mark.parametrize("colour", [False, True])
def test_a_client_of_pv_access_follows_the_images_and_writes_nothing(*, colour: bool) -> None:
    from cosmic.app.gateways.epics_pva import PvaImages

    shape = (30, 40, 3) if colour else (30, 40)
    kind = np.uint8 if colour else np.uint16
    data = np.random.default_rng(1).integers(0, 200, shape).astype(kind)
    station = Station("fibres", FailurePolicy())
    images = PvaImages(station, ["microscope"], EpicsSettings(prefix="T:", pva=True))
    child = subprocess.Popen(
        [sys.executable, str(CHILD), str(images.port), NAME], stdout=subprocess.PIPE, text=True
    )
    assert child.stdout is not None
    try:
        number = 1
        while child.poll() is None:
            station.bus.publish(TOPIC, image(number, data))
            number += 1
            time.sleep(0.05)
        found = json.loads(child.stdout.readline())
        assert found["shape"] == list(shape)
        assert found["kind"] == np.dtype(kind).str
        assert found["total"] == int(data.astype(int).sum())
        assert found["colour"] == (2 if colour else 0)
        assert abs(found["time_s"] - time.time()) < 60.0
        assert found["refused"]
        assert child.stdout.readline() == "another\n"
    finally:
        child.kill()
        child.communicate(timeout=10)
        images.close()


def test_where_it_cannot_listen_it_says_so() -> None:
    from cosmic.app.gateways.epics_pva import PvaImages

    settings = EpicsSettings(prefix="T:", pva=True, interface="203.0.113.7")
    with pytest.raises(NotAvailable, match=r"203\.0\.113\.7"):
        PvaImages(Station("fibres", FailurePolicy()), ["microscope"], settings)
