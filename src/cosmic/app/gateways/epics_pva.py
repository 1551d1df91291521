"""`PvaImages`: images of cameras as NTNDArrays over PV Access: the file that wraps p4p."""

import logging
from collections.abc import Sequence
from functools import partial
from typing import Any, Final

import numpy as np

from cosmic.app.configuration.gateways import EpicsSettings
from cosmic.frame.clock import WALL
from cosmic.frame.errors import NotAvailable
from cosmic.frame.network.station import Station
from cosmic.frame.network.transport import Rule
from cosmic.frame.plan_shape import unix_now_s
from cosmic.vico.api.sent_image import SentImage

logger = logging.getLogger(__name__)

IMAGES_EVERY_S: Final = 0.1
"""What comes faster is left out: the newest counts."""
_MONO, _RGB1 = 0, 2
"""Colour modes of areaDetector: of colours as they come, the colour varies fastest."""


class PvaImages:
    """The newest image of each camera, as areaDetector's NDPluginPva shows it; `close` it at last.

    Nobody can write to it: what moves goes over Channel Access or HTTP.

    Parameters
    ----------
    cameras : sequence of str
        Their names; that of the record is PREFIX + "microscope:Pva1:Image".

    Raises
    ------
    NotAvailable
        It cannot listen there.
    """

    def __init__(self, station: Station, cameras: Sequence[str], settings: EpicsSettings) -> None:
        from p4p.nt import NTNDArray  # an extra that is not installed is no reason to fail before
        from p4p.server import Server, StaticProvider
        from p4p.server.raw import SharedPV

        self._kind: Any = NTNDArray()
        self._shown: dict[str, Any] = {}
        self._due_s = dict.fromkeys(cameras, float("-inf"))
        provider = StaticProvider("images of CoSMic")
        for camera in cameras:
            record = SharedPV(initial=self._kind.wrap(np.zeros((1, 1), np.uint8)))
            self._shown[camera] = record
            provider.add(f"{settings.prefix}{camera.replace('.', '_')}:Pva1:Image", record)
        where = {
            "EPICS_PVAS_INTF_ADDR_LIST": settings.interface,
            "EPICS_PVAS_AUTO_BEACON_ADDR_LIST": "NO",  # it would tell the whole network
            "EPICS_PVAS_SERVER_PORT": str(settings.pva_port),
        }
        try:
            self._server = Server(providers=[provider], conf=where, useenv=False)
        except RuntimeError as exc:
            raise NotAvailable(
                f"images over PVA cannot be served at {settings.interface}: {exc}"
            ) from exc
        self._port = int(self._server.conf()["EPICS_PVAS_SERVER_PORT"])
        bus = station.bus
        self._subscriptions = [
            bus.subscribe(f"vico/camera_handles/{each}/shown", Rule.LATEST, partial(self._on, each))
            for each in cameras
        ]

    @property
    def port(self) -> int:
        """Where it listens."""
        return self._port

    def close(self) -> None:
        """Answer no more; harmless the second time."""
        for each in self._subscriptions:
            each.close()
        self._server.stop()

    def _on(self, camera: str, image: object) -> None:
        now_s = WALL.now_s()
        if not isinstance(image, SentImage) or now_s < self._due_s[camera]:
            return
        self._due_s[camera] = now_s + IMAGES_EVERY_S
        colour = image.data.ndim == 3
        value = self._kind.wrap(image.data, timestamp=unix_now_s())
        value.uniqueId = image.frame_id & 0x7FFFFFFF
        value.attribute = [{"name": "ColorMode", "value": _RGB1 if colour else _MONO}]
        value.dataTimeStamp = value.timeStamp
        self._shown[camera].post(value)
