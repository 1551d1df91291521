"""What other processes may set at MiCo: zeros, speeds, links, exemptions, poses."""

from cosmic.frame.errors import NotAvailable, refusal
from cosmic.frame.network.caller import current_call
from cosmic.frame.network.remote import remote
from cosmic.frame.network.station import Station
from cosmic.frame.verdict import Reason, refuse
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.links import check_linkable, check_links_may_change
from cosmic.mico.api.station_checks import finite, one_line
from cosmic.mico.api.station_orders import Key, OrderBook
from cosmic.mico.api.station_tell import MicoTeller
from cosmic.mico.api.station_words import (
    COMMANDS,
    MicoStatus,
    StampedState,
)
from cosmic.mico.core.collision.checker import NO_MODEL_TEXT
from cosmic.mico.core.collision.collision_manager import CollisionManager
from cosmic.mico.core.motion.orders import FREQUENCY_HZ
from cosmic.mico.core.poses import Pose


class SettingsSide:
    """What changes how axes move, or where they are said to be; the first part of MiCo's side."""

    def __init__(self, application: MicoApplication) -> None:
        self._application = application
        self._manager = application.manager
        self._orders = OrderBook()
        self._teller = MicoTeller(application, application.trajectories.policy)
        self._station: Station | None = None

    @remote(moves=True)
    def set_zero(self, axis: str, zero: float) -> StampedState | None:
        """Show positions relative to `zero`, in gate coordinates."""
        finite(zero, f"{axis}: a zero")
        self._log(f"{axis}: zero at {zero:g}", "")
        self._manager.device(axis).set_zero(self._manager.address(axis).channel, zero)
        return self._teller.note(axis)

    @remote(moves=True)
    def set_estimate(self, axis: str, position: float, std: float) -> StampedState | None:
        """Say where an axis without sensor stands, in gate coordinates."""
        self._log(f"{axis}: estimated at {position:g} ± {std:g}", "")
        channel = self._manager.address(axis).channel
        self._manager.device(axis).set_estimate(channel, position, std)
        return self._teller.note(axis)

    @remote(moves=True)
    def set_frequency(self, axis: str, frequency_hz: int) -> None:
        """Limit the closed-loop speed."""
        low, high = FREQUENCY_HZ
        if not low <= frequency_hz <= high:
            text = f"{axis}: frequency {frequency_hz} Hz is outside {low} to {high} Hz"
            raise refusal(refuse(Reason.LIMIT, text, axis=axis, value=frequency_hz, unit="Hz"))
        channel = self._manager.address(axis).channel
        self._manager.device(axis).set_frequency(channel, frequency_hz)

    @remote(moves=True)
    def link(self, first: str, second: str, ratio: float) -> MicoStatus:
        """Link two axes."""
        check_linkable(self._manager, first, second)
        self._log(f"link of {first} and {second}, {ratio:g}", "")
        self._manager.links.add(first, second, ratio)
        return self._teller.status()

    @remote(moves=True)
    def unlink(self, axis: str) -> MicoStatus:
        """Take away every link of an axis."""
        check_links_may_change(self._manager, {axis})
        self._log(f"{axis}: unlinked", "")
        self._manager.links.remove(axis)
        return self._teller.status()

    @remote(moves=True)
    def watch_axis(self, axis: str, watched: bool) -> MicoStatus:
        """Take an axis out of collision detection, or in again."""
        change = self._model().take_in if watched else self._model().take_out
        change(axis, source=self._who())
        return self._teller.status()

    @remote(moves=True)
    def set_contact(self, name: str, allowed: bool) -> MicoStatus:
        """Let the bodies of an operation touch, or watch them again."""
        change = self._model().allow_contact if allowed else self._model().forbid_contact
        change(name, source=self._who())
        return self._teller.status()

    # Poses

    @remote
    def put_pose(self, name: str, positions: dict[str, float]) -> MicoStatus:
        """Keep a named pose."""
        for axis, position in positions.items():
            self._manager.address(axis)
            finite(position, f"{axis}: a position")
        self._log(f"pose {name!r}", "")
        self._application.trajectories.poses.put(Pose(name, positions))
        return self._teller.status()

    @remote
    def remove_pose(self, name: str) -> MicoStatus:
        """Forget a named pose."""
        self._log(f"pose {name!r} removed", "")
        self._application.trajectories.poses.remove(name)
        return self._teller.status()

    # Who asks

    def _who(self) -> str:
        call = current_call()
        return call.caller.name if call is not None else "this program"

    def _key(self, number: int) -> Key:
        call = current_call()
        return (call.caller.token if call is not None else "", number)

    def _source(self, source: str) -> str:
        return f"{self._who()} {one_line(source)}".strip()

    def _log(self, what: str, source: str) -> None:
        if self._station is not None:
            self._station.publish(COMMANDS, f"{self._source(source)}: {what}"[:500])

    def _model(self) -> CollisionManager:
        model = self._application.collision
        if model is None:
            raise NotAvailable(f"{NO_MODEL_TEXT}: name a scene in the station's platform file")
        return model
