"""What is known of one axis of the scripted API."""

from collections.abc import Callable

from PySide6.QtCore import QObject, Qt

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import NotAvailable
from cosmic.frame.events import notify
from cosmic.frame.units import AxisUnit
from cosmic.mico.api.axis_shape import AxisShape
from cosmic.mico.core.collision.checker import NO_MODEL_TEXT
from cosmic.mico.core.motion.device_commander import DeviceCommander
from cosmic.mico.core.motion.positioner import Confidence, PositionerState, Status
from cosmic.mico.hw.interface import Activity, PositionerKind


@checked_class
class AxisFacts(AxisShape):
    """The state of an axis, as scripts and widgets read and follow it; any thread."""

    commander: DeviceCommander

    @property
    def details(self) -> PositionerState:
        """Everything known of it, frozen; positions in gate coordinates."""
        return self._manager.state(self._name)

    @property
    def kind(self) -> PositionerKind:
        """linear, rotary or open-loop."""
        return self.details.kind

    @property
    def unit(self) -> AxisUnit:
        """Unit of its positions: "um" or "deg"."""
        return self.details.unit

    @property
    def state(self) -> Status:
        """OK, BUSY, ERROR, or UNKNOWN when its device does not answer."""
        return self.details.status

    @property
    def activity(self) -> Activity:
        """What the controller says it is doing."""
        return self.details.activity

    @property
    def error(self) -> str:
        """What is wrong with it; empty when nothing is."""
        return self.details.error

    @property
    def confidence(self) -> Confidence:
        """How well its position is known: known, estimated (counted steps) or unknown."""
        return self.details.confidence

    @property
    def limits(self) -> tuple[float, float] | None:
        """Soft limits (low, high) in `unit` from the user's zero; None without a sensor."""
        return self.details.shown_limits

    @property
    def collision_detection(self) -> bool:
        """Whether its movements are checked for collisions; set it to take the axis out (CL.13).

        Raises
        ------
        NotAvailable
            It is set, and there is no collision model.
        """
        model = self._manager.exemptions
        return model is not None and self._name not in model.taken_out

    @collision_detection.setter
    def collision_detection(self, on: bool) -> None:
        model = self._manager.exemptions
        if model is None:
            raise NotAvailable(f"{NO_MODEL_TEXT}: name a scene in the platform file")
        change = model.take_in if on else model.take_out
        change(self._name, source=self.commander.source)

    @property
    def linked_to(self) -> dict[str, float]:
        """How far each axis linked to it goes when it goes 1; empty where it is linked to none."""
        return dict(self._manager.links.companions(self._name))

    @property
    def position_um(self) -> float | None:
        """Position in um; counted from steps without a sensor; None before the first reading.

        Raises
        ------
        NotAvailable
            The axis is rotary: use `angle_deg`.
        """
        return self._position("um", "angle_deg")

    @property
    def position_std_um(self) -> float:
        """Standard deviation of the position in um: 0 where it is measured, inf where unknown.

        It grows with the steps of an axis without sensor, until its end stop or
        `set_estimate` says where it is.

        Raises
        ------
        NotAvailable
            The axis is rotary.
        """
        self._position("um", "angle_deg")
        return self.details.std

    @property
    def angle_deg(self) -> float | None:
        """Angle in degrees; None before the first reading.

        Raises
        ------
        NotAvailable
            The axis is not rotary: use `position_um`.
        """
        return self._position("deg", "position_um")

    def _position(self, unit: AxisUnit, other: str) -> float | None:
        state = self.details
        if state.unit != unit:
            raise NotAvailable(f"{self._name} is a {state.kind} axis: use {other}")
        return state.shown_position

    def subscribe(self, callback: Callable[[PositionerState], None]) -> Callable[[], None]:
        """Call `callback(state)` after each change; returns the function that ends it.

        It is called in the device's thread and must return at once; a position in motion is read
        about 20 times a second.
        """

        def on_state(state: PositionerState) -> None:
            if state.name == self._name:
                notify(callback, state)

        direct = Qt.ConnectionType.DirectConnection
        connection = self.commander.state_changed.connect(on_state, direct)

        def unsubscribe() -> None:
            QObject.disconnect(connection)

        return unsubscribe
