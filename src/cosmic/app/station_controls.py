"""Shows in a window who commands at each station, and takes and gives that right."""

from collections.abc import Sequence
from typing import Final

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QWidget

from cosmic.app.remote_station import RemoteStation, StationControl
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.controls_sign import ControlAction, ControlsSign
from cosmic.frame.gui.relay import Unsubscribe
from cosmic.frame.network.lease import LeaseState, StationLease

HERE: Final = "this window"
_TAKE_OVER: Final = "take over"
_OFFER: Final = "offer"


class StationControls(QObject):
    """Joins the sign in the top bar to the leases of this station and of those it uses.

    Parameters
    ----------
    own : StationLease or None
        Of what this window serves to others.
    hosts : bool
        Something runs in this process, too.

    Signals
    -------
    control_changed(StationControl)
        Somebody else commands at a station, or it is away, or back; in the GUI thread.
    failed(str)
        What the operator asked for was not possible.
    """

    control_changed = Signal(object)
    failed = Signal(str)
    _told = Signal(object)
    _own_told = Signal(object)

    def __init__(
        self,
        sign: ControlsSign,
        stations: Sequence[RemoteStation],
        own: StationLease | None,
        parent: QWidget,
        *,
        hosts: bool,
    ) -> None:
        super().__init__(parent)
        self._sign = sign
        self._hosts = hosts
        self._stations = {each.name: each for each in stations}
        self._known = {name: StationControl(name) for name in self._stations}
        self._own = own
        self._own_state: LeaseState | None = None
        self._told.connect(self._on_told)
        self._own_told.connect(self._on_own_told)
        sign.action_requested.connect(self._on_action)
        self._ends: list[Unsubscribe] = [
            each.on_control(self._told.emit) for each in self._stations.values()
        ]
        if own is not None:
            self._ends.append(own.subscribe(self._own_told.emit))

    def end(self) -> None:
        """Listen no more; harmless the second time."""
        while self._ends:
            self._ends.pop()()

    # What is told

    def _on_told(self, control: StationControl) -> None:
        self._known[control.station] = control
        self._show()
        self.control_changed.emit(control)

    def _on_own_told(self, state: LeaseState) -> None:
        self._own_state = state
        self._show()

    def _show(self) -> None:
        words, tips, actions, warn = [], [], [], False
        if self._own_state is not None:
            word, action = _own_words(self._own_state)
            words.append(word)
            tips.append(f"Movements here are commanded by {word}")
            actions += [action] if action is not None else []
            warn = not self._own_state.local
        elif self._hosts:
            words.append(HERE)
            tips.append(f"Movements here are commanded by {HERE}")
        alone = len(self._known) == 1 and not self._hosts
        for control in self._known.values():
            who, action = _words(control, alone=alone)
            words.append(who)
            tips.append(f"Movements at {control.station} are commanded by {who}")
            actions += [action] if action is not None else []
            warn = warn or (alone and not control.here)
        self._sign.show_holder("; ".join(words), warn=warn, tip="\n".join(tips))
        self._sign.set_actions(actions)

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
            there.later(there.take_control if what == "take" else there.release_control, self._say)

    def _say(self, error: CosmicError) -> None:
        self.failed.emit(str(error))


def _own_words(state: LeaseState) -> tuple[str, ControlAction | None]:
    """Return who commands here, and what the operator can do about it."""
    if not state.local:
        tip = f"What {state.holder} moves stops, and it cannot take control back until you offer it"
        return state.holder, ControlAction(_TAKE_OVER, "Take over", tip)
    if not state.offered:
        tip = "Let other programs take control again"
        return f"{HERE}, kept", ControlAction(_OFFER, "Offer", tip)
    return HERE, None


def _words(control: StationControl, *, alone: bool) -> tuple[str, ControlAction | None]:
    """Return who commands at another station, and what can be done about it from here."""
    station = control.station
    at = "" if alone else f" {station}"
    if control.away:
        return f"{station} is away", None
    if control.here:
        tip = f"Give the control over {station} back; what moves by it stops"
        who = HERE if alone else f"{HERE} ({station})"
        return who, ControlAction(f"release at {station}", f"Release{at}", tip)
    tip = f"Command the movements at {station} from this window"
    action = ControlAction(f"take at {station}", f"Take control{' of' if at else ''}{at}", tip)
    return control.holder or f"nobody known ({station})", action if control.offered else None
