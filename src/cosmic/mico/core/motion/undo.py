"""What each assembly did last, so that it can be taken back."""

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import count
from threading import RLock
from typing import Final

from PySide6.QtCore import QObject, Qt, Signal

from cosmic.frame.errors import NotAvailable, refusal
from cosmic.frame.units import format_quantity
from cosmic.frame.verdict import Reason, refuse
from cosmic.mico.core.motion.cautions import Cautions
from cosmic.mico.core.motion.manager import DeviceManager
from cosmic.mico.core.motion.messages import MovementBegun, Order
from cosmic.mico.core.motion.orders import Motion, MoveTo, Step
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.hw.interface import PositionerKind

UNDO: Final = "undo"
DEPTH: Final = 10
"""How many movements of an assembly can be taken back."""
_BEGINNINGS: Final = ("initialisation",)
"""Sources after which there is no way back to before."""


@dataclass(frozen=True)
class UndoEntry:
    """One movement of an assembly, from standstill to standstill.

    Attributes
    ----------
    group : str
        Title of the assembly.
    before : mapping of float
        Where its axes stood before, by name, in gate coordinates.
    number : int
        Grows with each entry.
    felt : tuple of str
        What speaks against going back to before it, in words: what was held or felt when it ended,
        and what was touched on the way or since.
    """

    group: str
    before: Mapping[str, float]
    number: int
    felt: tuple[str, ...] = ()


class UndoHistory(QObject):
    """Hears of every movement of every source and remembers where it began; any thread.

    What an assembly does while any of its axes moves is one entry. Movements from an unknown
    position leave none, and initialising an axis takes its entries away: there is no way back.

    Signals
    -------
    changed()
        There is more or less to be taken back; in any thread.
    """

    changed = Signal()

    def __init__(
        self,
        manager: DeviceManager,
        cautions: Cautions | None = None,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self._manager = manager
        self._cautions = cautions or Cautions()
        self._lock = RLock()
        self._numbers = count(1)
        self._entries: dict[str, deque[UndoEntry]] = {}
        self._open: dict[str, dict[str, float]] = {}
        self._moving: dict[str, set[str]] = {}
        self._touches: dict[str, dict[str, None]] = {}
        self._group_of = {
            name: group.title for group in manager.settings.group for name in group.positioners
        }
        direct = Qt.ConnectionType.DirectConnection
        manager.movement_begun.connect(self._on_movement_begun, direct)
        manager.state_changed.connect(self._on_state_changed, direct)
        self._cautions.on_touch(self._on_touch)

    def group_of(self, axis: str) -> str:
        """Return the assembly that an axis belongs to; an axis of no group is its own."""
        return self._group_of.get(axis, axis)

    @property
    def entries(self) -> tuple[UndoEntry, ...]:
        """What can be taken back, the newest first."""
        with self._lock:
            found = [entry for entries in self._entries.values() for entry in entries]
        return tuple(sorted(found, key=lambda entry: -entry.number))

    # Recording, in the threads of the devices

    def _on_movement_begun(self, event: MovementBegun) -> None:
        if event.source == UNDO:
            return
        unknown = self._manager.state(event.name).confidence is Confidence.UNKNOWN
        if unknown or event.from_position is None or event.source in _BEGINNINGS:
            self._forget(event.name)
            return
        group = self.group_of(event.name)
        with self._lock:
            self._open.setdefault(group, {}).setdefault(event.name, event.from_position)
            self._moving.setdefault(group, set()).add(event.name)

    def _on_state_changed(self, state: PositionerState) -> None:
        if state.in_motion:
            return
        group = self.group_of(state.name)
        with self._lock:
            moving = self._moving.get(group)
            if moving is None or state.name not in moving:
                return
            moving.discard(state.name)
            if moving:
                return
            del self._moving[group]
            before = self._open.pop(group, {})
            touches = tuple(self._touches.pop(group, {}))
        self._close(group, before, touches)

    def _close(self, group: str, before: Mapping[str, float], touches: tuple[str, ...]) -> None:
        moved = {name: where for name, where in before.items() if not self._stands_at(name, where)}
        if not moved:  # back where it began, but it touched something there
            self._add_to_newest(touches)
            return
        felt = (*(f"when a movement ended, {text}" for text in self._cautions.reasons()), *touches)
        with self._lock:
            entries = self._entries.setdefault(group, deque(maxlen=DEPTH))
            entries.append(UndoEntry(group, moved, next(self._numbers), felt))
        self.changed.emit()

    def _on_touch(self, text: str) -> None:
        """Remember a touch with what moves, or else with what moved last; returns at once."""
        since = f"since it began, {text}"
        with self._lock:
            for group in self._open:
                self._touches.setdefault(group, {})[since] = None
            moving = bool(self._open)
        if not moving:
            self._add_to_newest((since,))

    def _add_to_newest(self, texts: tuple[str, ...]) -> None:
        """Have going back before anything ask for what was touched: all ways lead by the newest."""
        with self._lock:
            last = max(
                (entries for entries in self._entries.values() if entries),
                key=lambda entries: entries[-1].number,
                default=None,
            )
            if last is None or set(texts) <= set(last[-1].felt):
                return
            last[-1] = replace(last[-1], felt=tuple(dict.fromkeys((*last[-1].felt, *texts))))
        self.changed.emit()

    def _stands_at(self, name: str, where: float) -> bool:
        state = self._manager.state(name)
        watch = self._manager.settings.watch
        near = watch.tolerance_deg if state.unit == "deg" else watch.tolerance_um
        return state.position is not None and abs(state.position - where) <= 0.5 * near

    def _forget(self, axis: str) -> None:
        group = self.group_of(axis)
        with self._lock:
            self._open.get(group, {}).pop(axis, None)
            self._moving.get(group, set()).discard(axis)
            entries = self._entries.get(group, deque())
            kept = [entry for entry in entries if axis not in entry.before]
            if len(kept) == len(entries):
                return
            self._entries[group] = deque(kept, maxlen=DEPTH)
        self.changed.emit()

    def forget_all(self) -> None:
        """Forget everything that could be taken back."""
        with self._lock:
            self._entries.clear()
        self.changed.emit()

    # Taking back

    def newest(self, group: str | None = None) -> UndoEntry:
        """Return what is to be taken back first, of one assembly or of all.

        What has come about by itself, as of an axis that followed one it is linked to, is passed
        over and forgotten.

        Raises
        ------
        NotAvailable
            There is nothing, or no such assembly, or it moves.
        """
        self._known(group)
        for entry in self.entries:
            if group not in (None, entry.group):
                continue
            if all(self._stands_at(name, where) for name, where in entry.before.items()):
                self.drop(entry)
                continue
            self._stands(entry)
            return entry
        raise NotAvailable(f"there is nothing to undo{f' of {group}' if group else ''}")

    def _known(self, group: str | None) -> None:
        titles = dict.fromkeys(self.group_of(name) for name in self._manager.names())
        if group is not None and group not in titles:
            raise NotAvailable(f"there is no group {group!r}; there are {', '.join(titles)}")

    def _stands(self, entry: UndoEntry) -> None:
        moving = [
            state.name
            for state in self._manager.states().values()
            if state.in_motion and self.group_of(state.name) == entry.group
        ]
        if moving:
            raise NotAvailable(f"{', '.join(moving)} is moving; undo when it is stationary")

    def order(self, entry: UndoEntry) -> dict[str, Order]:
        """Begin to move back at the speed of `[mico.undo]`; raises `MoveRefused`, the entry stays.

        What was come to carefully must not be left, or come back to, at travel speed.
        """
        motions = {name: self._return_motion(name, where) for name, where in entry.before.items()}
        slow_hz = {
            name: self._slow_hz(name, motion.unit)
            for name, motion in motions.items()
            if isinstance(motion, MoveTo)
        }
        return self._manager.groups.order_together(motions, source=UNDO, slow_hz=slow_hz)

    def _slow_hz(self, name: str, unit: str) -> int:
        defaults, undo = self._manager.settings.defaults, self._manager.settings.undo
        if unit == "deg":
            hertz = undo.speed_deg_s / defaults.nominal_step_deg
        else:
            hertz = undo.speed_um_s / defaults.nominal_step_um
        low, high = self._manager.state(name).frequency_range_hz
        return max(low, min(high, math.ceil(hertz)))

    def _return_motion(self, name: str, where: float) -> Motion:
        state = self._manager.state(name)
        if state.kind is not PositionerKind.OPEN_LOOP:
            return MoveTo(where, state.unit)
        defaults = self._manager.settings.defaults
        found = next(each for each in self._manager.settings.positioner if each.name == name)
        step_um = found.step_um or defaults.nominal_step_um
        travel_um = where - (state.position or 0.0)
        steps = round(travel_um / step_um * 100.0 / defaults.amplitude_v)
        if not abs(steps) <= state.most_steps:
            text = f"{name}: {format_quantity(travel_um, 'um')} back is more than it steps at once"
            raise refusal(refuse(Reason.LIMIT, text, axis=name))
        slow_hz = min(defaults.frequency_hz, self._manager.settings.jog.frequency_hz)
        return Step(steps, defaults.amplitude_v, slow_hz)

    def drop(self, entry: UndoEntry) -> None:
        """Forget an entry that was taken back; harmless the second time.

        What was touched on the way back is remembered with the entry before.
        """
        with self._lock:
            entries = self._entries.get(entry.group, deque())
            found = next((each for each in entries if each.number == entry.number), None)
            if found is None:
                return
            entries.remove(found)
        self._add_to_newest(tuple(text for text in found.felt if text not in entry.felt))
        self.changed.emit()


def undo_text(entry: UndoEntry, states: Mapping[str, PositionerState]) -> str:
    """Return where taking `entry` back leads, such as "left.x from 100.0 µm to 0.0 µm"."""
    texts = []
    for name, where in entry.before.items():
        state = states.get(name)
        if state is None or state.position is None:
            texts.append(name)
            continue
        now, then = (
            format_quantity(each - state.zero, state.unit) for each in (state.position, where)
        )
        texts.append(f"{name} from {now} to {then}")
    return ", ".join(texts)
