"""Referencing the platform in its safe order (thesis 7.1; the full sequence comes later)."""

from collections.abc import Mapping, Sequence

from cosmic.frame.errors import CosmicError, MoveCancelled
from cosmic.frame.task import Task
from cosmic.mico.api.group import move_together
from cosmic.mico.core.device_manager import DeviceManager
from cosmic.mico.core.orders import Motion, MoveTo, Reference
from cosmic.mico.core.positioner import PositionerState
from cosmic.mico.hw.interface import PositionerKind, ReferenceKind

SOURCE = "initialisation"


def plan(manager: DeviceManager) -> list[Mapping[str, Motion]]:
    """Return the groups of movements that initialise the platform, in order.

    Axes that the configured order does not name come last, one by one. Axes without sensor, or
    of a type without reference, have nothing to find and are left where they are.
    """
    states = manager.states()
    order: list[tuple[str, ...]] = list(manager.settings.initialisation.order)
    named = {name for names in order for name in names}
    order += [(name,) for name in states if name not in named]
    groups: list[Mapping[str, Motion]] = [
        {name: Reference() for name in names if _can_reference(states.get(name))} for names in order
    ]
    if manager.settings.initialisation.go_to_start:
        # Back in the opposite order: what was lifted first comes down last.
        groups += [_start_pose(manager, names, states) for names in reversed(order)]
    return [group for group in groups if group]


def _can_reference(state: PositionerState | None) -> bool:
    if state is None or not state.present or state.kind is PositionerKind.OPEN_LOOP:
        return False
    found = state.positioner
    return found is None or found.reference is not ReferenceKind.NONE


def _start_pose(
    manager: DeviceManager, names: Sequence[str], states: Mapping[str, PositionerState]
) -> Mapping[str, Motion]:
    starts = {each.name: each.start for each in manager.settings.positioner}
    targets: dict[str, Motion] = {}
    for name in names:
        start, state = starts.get(name), states.get(name)
        if start is not None and state is not None and _can_reference(state):
            targets[name] = MoveTo(start, state.unit)
    return targets


def run(manager: DeviceManager, task: Task) -> None:
    """Carry the plan out and end `task`; in the application's thread."""
    try:
        groups = plan(manager)
        for number, group in enumerate(groups):
            _run_group(manager, task, group, number / len(groups))
        task.finish()
    except CosmicError as exc:
        task.fail(exc)


def _run_group(
    manager: DeviceManager, task: Task, group: Mapping[str, Motion], fraction: float
) -> None:
    if task.cancel_requested:
        raise MoveCancelled("initialisation was cancelled")
    what = "referencing" if any(isinstance(m, Reference) for m in group.values()) else "moving"
    task.report(fraction, f"{what} {', '.join(group)}")
    move_together(manager, group, task, source=SOURCE, consent=True)
