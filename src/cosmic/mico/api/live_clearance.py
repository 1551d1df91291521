"""`LiveClearance`: the distance of the nearest bodies, for monitors and suspenders of bluesky."""

import math
from collections.abc import Callable

from PySide6.QtCore import QObject, Qt
from typing_extensions import override

from cosmic.frame.events import Unsubscribe
from cosmic.frame.plan_shape import DataKeys, Readings, number_key, unix_now_s
from cosmic.frame.plan_signal import PlanSignal
from cosmic.mico.core.collision.clearance_watch import ClearanceWatch


class LiveClearance(PlanSignal):
    """``rig.mico.live_clearance``: how far the nearest bodies are apart, as axes move; any thread.

    Bluesky's monitors and suspenders take it. Where it is not known, a suspender is told minus
    infinity, so that it suspends, and a reading is NaN.
    """

    parent: None = None
    name = "clearance_um"

    def __init__(self, watch: ClearanceWatch) -> None:
        self._watch = watch

    @override
    def get(self) -> float:
        """Return the distance in um; minus infinity while it is not known."""
        nearest = self._watch.latest
        return -math.inf if nearest is None else nearest.distance_um

    def read(self) -> Readings:
        """Return the distance as a bluesky reading; NaN while it is not known."""
        nearest = self._watch.latest
        value = math.nan if nearest is None else nearest.distance_um
        return {self.name: {"value": value, "timestamp": unix_now_s()}}

    def describe(self) -> DataKeys:
        """Return what `read` returns, in bluesky's terms."""
        return {self.name: number_key("collision model", "um")}

    @override
    def _on_news(self, listener: Callable[[], object]) -> Unsubscribe:
        direct = Qt.ConnectionType.DirectConnection
        connection = self._watch.changed.connect(lambda _nearest: listener(), direct)

        def unsubscribe() -> None:
            QObject.disconnect(connection)

        return unsubscribe
