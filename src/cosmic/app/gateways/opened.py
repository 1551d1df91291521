"""`Gateways`: the doors of one station for programs that are not CoSMic."""

import logging
from collections.abc import Mapping
from contextlib import ExitStack
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Final

from cosmic.app.configuration.gateways import Doors, EpicsSettings
from cosmic.frame.errors import NotAvailable, needs_extra
from cosmic.frame.network.host import Host
from cosmic.frame.network.station import Station

if TYPE_CHECKING:
    from cosmic.app.gateways.session import Approve

logger = logging.getLogger(__name__)

_NEEDED: Final = {
    "http": ("HTTP", ("starlette", "uvicorn", "websockets")),
    "epics": ("EPICS", ("caproto",)),
    "pva": ("Images over PVA", ("p4p",)),
}


class Gateways:
    """What of `doors` is open; `close` it in every case.

    Raises
    ------
    NotAvailable
        The extra is not installed, or it cannot listen there.
    """

    def __init__(
        self,
        station: Station,
        hosts: Mapping[str, Host],
        facts: Mapping[str, object],
        doors: Doors,
        approve: "Approve | None" = None,
    ) -> None:
        self._lines: list[str] = []
        asked = approve if doors.asks_first else None
        with ExitStack() as undo:
            if doors.http is not None:
                require("http")
                from cosmic.app.gateways.http import HttpGateway

                http = HttpGateway(station, hosts, doors.http, facts, asked)
                undo.callback(http.close)
                said = f" (token {doors.token})" if doors.token else ""
                self._lines.append(f"HTTP at {http.address}{said}")
            if doors.epics is not None:
                require("epics")
                from cosmic.app.gateways.epics import EpicsGateway

                epics = EpicsGateway(station, hosts, doors.epics, asked)
                undo.callback(epics.close)
                self._lines.append(f"EPICS at {epics.address}")
                if doors.epics.pva and "vico" in hosts:
                    self._open_images(station, hosts["vico"], doors.epics, undo)
            self._undo = undo.pop_all()
        for line in self._lines:
            logger.info("%s", line.partition(" (token")[0])

    def _open_images(
        self, station: Station, vico: Host, settings: EpicsSettings, undo: ExitStack
    ) -> None:
        require("pva")
        from cosmic.app.gateways.epics_pva import PvaImages

        cameras: Any = vico.state(whole=False).values["camera_handles"]
        images = PvaImages(station, list(cameras), settings)
        undo.callback(images.close)
        self._lines.append(f"images over PVA at port {images.port}")

    @property
    def lines(self) -> tuple[str, ...]:
        """Where each is reached, a line each, with the token that was made for this run."""
        return tuple(self._lines)

    def close(self) -> None:
        """Stop what their clients have set in motion and answer no more; any state."""
        self._undo.close()


def require(extra: str) -> None:
    """Check that what a gateway needs is installed.

    Raises
    ------
    NotAvailable
        It is not; the text says what to do.
    """
    what, packages = _NEEDED[extra]
    missing = [name for name in packages if find_spec(name) is None]
    if missing:
        raise NotAvailable(f"{needs_extra(what, extra)} (missing: {', '.join(missing)})")
