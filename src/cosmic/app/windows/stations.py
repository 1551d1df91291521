"""What a window shows of other stations: who commands, and which panels have lost theirs."""

from collections.abc import Mapping, Sequence

from PySide6.QtCore import QObject

from cosmic.app.platform import Platform
from cosmic.app.stations.host import StationHost
from cosmic.app.stations.remote_station import StationControl
from cosmic.app.windows.station_controls import StationControls
from cosmic.frame.gui.server_gui import CosmicServerGui
from cosmic.frame.gui.theme import State


class WindowStations(QObject):
    """Greys the panels of a station that is away; GUI thread.

    Parameters
    ----------
    host : StationHost or None
        What the window serves to others.
    panels : mapping of str to sequence of str
        By application, the titles of its panels.
    """

    def __init__(
        self,
        window: CosmicServerGui,
        platform: Platform,
        host: StationHost | None,
        panels: Mapping[str, Sequence[str]],
    ) -> None:
        super().__init__(window)
        self._window = window
        self._panels: dict[str, list[str]] = {}
        hosts: dict[str, list[str]] = {"": list(platform.own)}
        for application, station in platform.elsewhere.host_of.items():
            hosts.setdefault(station.name, []).append(application)
            self._panels.setdefault(station.name, []).extend(panels.get(application, ()))
        self._said = ""
        self._controls = StationControls(
            window.top_bar.controls,
            platform.elsewhere.stations,
            hosts,
            host.lease if host is not None else None,
            window,
        )
        self._controls.control_changed.connect(self._on_control_changed)
        self._controls.failed.connect(self._on_failed)

    def end(self) -> None:
        """Listen no more; harmless the second time."""
        self._controls.end()

    def _on_control_changed(self, control: StationControl) -> None:
        window, reason = self._window, f"{control.station} is away: {control.away}"
        for title in self._panels.get(control.station, ()):
            if control.away:
                window.set_failed(title, reason, rescan=False)
            elif window.dock(title).failure:
                window.clear_failed(title)
        if control.away:
            self._said = reason
            window.top_bar.set_message(reason, State.ERROR)
        elif self._said and window.top_bar.message == self._said:
            window.top_bar.set_message("")

    def _on_failed(self, text: str) -> None:
        self._window.top_bar.set_message(text, State.REFUSED)
