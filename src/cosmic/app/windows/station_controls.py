"""What a window shows of stations: who commands where, and which panels have lost theirs."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget

from cosmic.app.platform import Platform
from cosmic.app.stations.host import StationHost
from cosmic.app.stations.remote_station import RemoteStation, StationControl
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.controls_indicator import ControlAction, ControlsIndicator
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.server_gui import CosmicServerGui
from cosmic.frame.gui.theme import State
from cosmic.frame.network.lease import LeaseState, StationLease

HERE: Final = "this window"
AXES: Final = "axes"
_OPERATOR: Final = "the operator at "
_TAKE_OVER: Final = "take over"
_OFFER: Final = "offer"


class StationControls(QObject):
    """Joins the indicator in the top bar to the leases of this station and of those it uses.

    Parameters
    ----------
    hosts : mapping of str to collection of str
        By station, the applications used there; those that run in this process under "".
    own : StationLease or None
        Of what this window serves to others.

    Signals
    -------
    control_changed(StationControl)
        Somebody else commands at a station, or it is away, or back; in the GUI thread.
    failed(str)
        What the operator asked for was not possible.
    """

    control_changed = Signal(object)
    failed = Signal(str)

    def __init__(
        self,
        indicator: ControlsIndicator,
        stations: Sequence[RemoteStation],
        hosts: Mapping[str, Collection[str]],
        own: StationLease | None,
        parent: QWidget,
    ) -> None:
        super().__init__(parent)
        self._indicator = indicator
        self._moving = {name: _what_moves(applications) for name, applications in hosts.items()}
        self._stations = {each.name: each for each in stations}
        self._known = {name: StationControl(name) for name in self._stations}
        self._own = own
        self._own_state: LeaseState | None = None
        indicator.action_requested.connect(self._on_action)
        self._say_later = Relay(self._say)
        self._relay, self._own_relay = Relay(self._on_control), Relay(self._on_own_state)
        for each in self._stations.values():
            self._relay.follow(each.on_control)
        if own is not None:
            self._own_relay.follow(own.subscribe)

    def end(self) -> None:
        """Listen no more; harmless the second time."""
        self._relay.end()
        self._own_relay.end()

    # What is told

    def _on_control(self, control: StationControl) -> None:
        self._known[control.station] = control
        self._show()
        self.control_changed.emit(control)

    def _on_own_state(self, state: LeaseState) -> None:
        self._own_state = state
        self._show()

    def _show(self) -> None:
        entries = [
            _words(control, self._moving[control.station])
            for control in self._known.values()
            if self._moving.get(control.station)
        ]
        if self._moving.get("") or not entries:
            entries.append(_own_words(self._own_state, self._moving.get("", "")))
        entries.sort(key=lambda each: AXES not in each.what)  # what moves the axes stands first
        text = entries[0].who
        if len(entries) > 1:
            text = "; ".join(f"{each.what}: {each.who.removeprefix(_OPERATOR)}" for each in entries)
        tip = "\n".join(f"{each.what or 'movements'}: commanded by {each.who}" for each in entries)
        self._indicator.show_holder(text, warn=not entries[0].here, tip=tip)
        self._indicator.set_actions([each.action for each in entries if each.action is not None])

    # What is asked for

    def _on_action(self, name: str) -> None:
        what, _, station = name.partition(" at ")
        if self._own is not None and what == _TAKE_OVER:
            self._own.take_over()
        elif self._own is not None and what == _OFFER:
            self._own.offer()
        elif station in self._stations:
            there = self._stations[station]
            # Aside, for a window must not wait for a line.
            what_to_do = there.take_control if what == "take" else there.release_control
            there.later(what_to_do, self._say_later)

    def _say(self, error: CosmicError) -> None:
        self.failed.emit(str(error))


@dataclass(frozen=True, slots=True)
class _Entry:
    """Who commands, what the operator can do about it, and whether it is this window."""

    what: str
    who: str
    action: ControlAction | None
    here: bool


def _what_moves(applications: Collection[str]) -> str:
    """Return what these applications move, for the operator; empty where nothing moves."""
    return ", ".join(
        what for name, what in (("mico", AXES), ("vico", "lens")) if name in applications
    )


def _own_words(state: LeaseState | None, what: str) -> _Entry:
    """Return the entry of what runs in this process."""
    if state is None:
        return _Entry(what, HERE, None, here=True)
    if not state.local:
        tip = f"What {state.holder} moves stops, and it cannot take control back until you offer it"
        return _Entry(what, state.holder, ControlAction(_TAKE_OVER, "Take over", tip), here=False)
    if not state.offered:
        tip = "Let other programs take control"
        return _Entry(what, f"{HERE}, kept", ControlAction(_OFFER, "Offer", tip), here=True)
    return _Entry(what, HERE, None, here=True)


def _words(control: StationControl, what: str) -> _Entry:
    """Return the entry of another station."""
    station = control.station
    if control.away:
        return _Entry(what, f"{station} is away", None, here=False)
    if control.here:
        tip = f"Release the control of {station}; what moves under it stops"
        action = ControlAction(f"release at {station}", f"Release {what}", tip)
        return _Entry(what, HERE, action, here=True)
    tip = f"Command the movements at {station} from this window"
    take = ControlAction(f"take at {station}", f"Take {what}", tip)
    who = control.holder or "not known yet"
    return _Entry(what, who, take if control.offered else None, here=False)


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
        for application, station in platform.remote.host_of.items():
            hosts.setdefault(station.name, []).append(application)
            self._panels.setdefault(station.name, []).extend(panels.get(application, ()))
        self._said = ""
        self._controls = StationControls(
            window.top_bar.controls,
            platform.remote.stations,
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
