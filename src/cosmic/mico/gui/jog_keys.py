"""Moves axes as long as their keys are held."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from PySide6.QtCore import QObject, QTimer
from PySide6.QtWidgets import QApplication

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.key_hold import HoldKeys
from cosmic.frame.units import format_quantity
from cosmic.mico.api.jogging import Jogging
from cosmic.mico.gui.positioner_gui import PositionerBaseGUI
from cosmic.mico.hw.interface import PositionerKind

logger = logging.getLogger(__name__)

RENEW_MS: Final = 40
_AT_LIMIT: Final = 1.0
"""How near its limit, um or deg, an axis stands that a jog has brought there."""


@dataclass(frozen=True, slots=True)
class JogKey:
    """What a key moves, and where: direction 1 or -1."""

    card: PositionerBaseGUI
    direction: int


class JogKeys(QObject):
    """Begins a jog when a key goes down, renews it by a timer, and lets go when it comes up.

    A window that hangs renews nothing, so the dead-man of the core stops the axis; a widget that
    takes text, another window or a stop ends all of them (see `HoldKeys`). A jog that ends while
    its key is held says why at its axis.

    Parameters
    ----------
    speed : callable
        Gives the speed for a kind of positioner, in its unit per second, or in Hz.
    """

    def __init__(
        self, app: QApplication, speed: Callable[[PositionerKind], float], parent: QObject
    ) -> None:
        super().__init__(parent)
        self._speed = speed
        self._keys: dict[str, JogKey] = {}
        self._running: dict[str, Jogging] = {}
        self._hold = HoldKeys(app, (), self)
        self._lost: dict[str, str] = {}
        self._hold.hold_lost.connect(self._on_hold_lost)
        self._hold.hold_started.connect(self._on_hold_started)
        self._hold.hold_ended.connect(self._on_hold_ended)
        self._timer = QTimer(self, interval=RENEW_MS)
        self._timer.timeout.connect(self._on_timer)

    @property
    def running(self) -> tuple[str, ...]:
        """The keys whose axes are being moved."""
        return tuple(self._running)

    def set_keys(self, keys: Mapping[str, JogKey]) -> None:
        """Listen to `keys`, as Qt writes them, from now on."""
        self._hold.set_keys(keys)
        self._keys = dict(keys)

    def release_all(self) -> None:
        """Let go of everything; the keys must come up before they move again."""
        self._hold.release_all()

    def _on_hold_started(self, key: str) -> None:
        jog = self._keys[key]
        axis, commands = jog.card.axis, jog.card.commands
        if commands.refuse_busy():
            return
        commands.abandon_series()
        self._lost.pop(key, None)
        try:
            running = axis.jog(jog.direction, self._speed(axis.kind), source="key")
        except CosmicError as exc:
            commands.refused.emit(None, str(exc))
            return
        self._running[key] = running
        commands.follow("jog", running.movement, why=lambda: self._why_ended(key, jog))
        self._timer.start()

    def _why_ended(self, key: str, jog: JogKey) -> str:
        """Return why a jog has ended that nobody refused; empty where its key came up."""
        why = self._lost.pop(key, "")
        if not why and key in self._running:
            why = _at_limit(jog) or (
                "it was not renewed in time, as the window was busy; let go and hold the key again"
            )
        if why:
            logger.info("%s: the jog by the key %s ended: %s", jog.card.axis.key, key, why)
        return f"the jog ended: {why}" if why else ""

    def _on_hold_lost(self, key: str, why: str) -> None:
        if key in self._running:
            self._lost[key] = why

    def _on_hold_ended(self, key: str) -> None:
        running = self._running.pop(key, None)
        if running is not None:
            running.end()
        if not self._running:
            self._timer.stop()

    def _on_timer(self) -> None:
        for key, running in self._running.items():
            if running.done:
                continue
            if why := self._keys[key].card.commands.busy():  # it has begun under the held key
                self._lost[key] = why
                running.end(why)
            else:
                running.renew()


def _at_limit(jog: JogKey) -> str:
    """Return the words for an axis that stands at the limit it was driven towards."""
    state = jog.card.axis.details
    position, limits = state.shown_position, state.shown_limits
    if position is None or limits is None:
        return ""
    limit = limits[1] if jog.direction > 0 else limits[0]
    if abs(position - limit) > _AT_LIMIT:
        return ""
    return f"the limit of its travel, {format_quantity(limit, state.unit)}, is reached"
