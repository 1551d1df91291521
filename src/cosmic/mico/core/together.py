"""Several axes ordered at once: links, speeds that match, and one start for all."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from cosmic.mico.core.links import LinkTable
from cosmic.mico.core.matching import Leg, matched_frequencies
from cosmic.mico.core.movement import Movement
from cosmic.mico.core.orders import Grant, Motion, Order
from cosmic.mico.core.positioner import PositionerState, class_for
from cosmic.mico.core.settings import MotionDefaults

if TYPE_CHECKING:
    from cosmic.mico.core.device_manager import DeviceManager


def with_linked(
    motions: Mapping[str, Motion], links: LinkTable, manager: "DeviceManager"
) -> dict[str, Motion]:
    """Return `motions` with those of the axes linked to them."""
    if not links.links:
        return dict(motions)
    going = manager.gate.targets()
    stand = {
        name: going.get(name, state.position)
        for name, state in manager.states().items()
        if state.position is not None
    }
    known = {name: where for name, where in stand.items() if where is not None}
    return links.expanded(motions, known, manager.settings.watch.tolerance_um)


def frequencies(
    grants: Mapping[str, Grant],
    states: Mapping[str, PositionerState],
    defaults: MotionDefaults,
    usual_hz: Callable[[str], int],
) -> dict[str, int]:
    """Return the speed limit of every axis with which all arrive at the same time."""
    legs: dict[str, Leg] = {}
    for name, grant in grants.items():
        state = states[name]
        sensed = class_for(state.kind, state.positioner).has_sensor
        if not sensed or grant.target is None or state.position is None:
            continue
        rotary = state.unit == "deg"
        legs[name] = Leg(
            way=abs(grant.target - state.position),
            step=defaults.nominal_step_deg if rotary else defaults.nominal_step_um,
            approach=defaults.approach_deg if rotary else defaults.approach_um,
            top_hz=usual_hz(name),
        )
    return matched_frequencies(legs)


def give_up_together(orders: Mapping[str, Order]) -> None:
    """Have the failure of one of `orders` before the common start withdraw the others."""

    def on_end(ended: Movement) -> None:
        if ended.success:
            return
        for order in orders.values():
            start = order.start
            if not order.movement.done and start is not None and start.skew_ms is None:
                order.movement.cancel()

    for order in orders.values():
        order.movement.add_callback(on_end)
