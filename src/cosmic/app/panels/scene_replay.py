"""Movements of before, shown in the scene faster than they were."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from PySide6.QtCore import QObject, QTimer, Signal

from cosmic.app.panels.scene import ScenePanel
from cosmic.autonomy.campaign.records import Series

FRAME_MS: Final = 40
LONGEST_S: Final = 12.0
"""A replay takes no longer than this."""
SPEED: Final = 5.0


class SceneReplay(QObject):
    """Shows recorded positions of axes in a scene instead of the live ones; GUI thread.

    Signals
    -------
    ended()
        The scene shows again where the axes are.
    """

    ended = Signal()

    def __init__(self, scene: ScenePanel, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._scene = scene
        self._poses: list[dict[str, float]] = []
        self._next = 0
        self._title = ""
        self._timer = QTimer(self, interval=FRAME_MS)
        self._timer.timeout.connect(self._on_frame)

    @property
    def running(self) -> bool:
        """Whether something of before is shown."""
        return self._timer.isActive()

    def start(self, series: Sequence[Series], title: str) -> None:
        """Begin; without effect where nothing has moved.

        Parameters
        ----------
        series : sequence of Series
            Positions by axis, in gate coordinates; what is no axis is passed over.
        title : str
            What is shown, such as "fibre 3".
        """
        self.stop()
        self._poses = poses_of([each for each in series if each.unit in ("um", "deg")])
        if not self._poses:
            return
        self._next, self._title = 0, title
        self._scene.set_recorded(self._poses)
        self._timer.start()

    def stop(self) -> None:
        """Show what is live again; harmless when it is shown."""
        if self._timer.isActive():
            self._timer.stop()
            self._scene.set_replay(None, "")
            self._scene.set_recorded(None)
            self.ended.emit()

    def _on_frame(self) -> None:
        if self._next >= len(self._poses):
            self.stop()
            return
        self._scene.set_replay(self._poses[self._next], f"replay of {self._title}, not live")
        self._next += 1


def poses_of(series: Sequence[Series]) -> list[dict[str, float]]:
    """Return the poses of a replay, one a frame."""
    moving = [each for each in series if each.time_s.size]
    if not moving:
        return []
    begin_s = min(float(each.time_s[0]) for each in moving)
    end_s = max(float(each.time_s[-1]) for each in moving)
    shown_s = min((end_s - begin_s) / SPEED, LONGEST_S)
    frames = max(2, round(shown_s * 1000.0 / FRAME_MS))
    times_s = np.linspace(begin_s, end_s, frames)
    tracks = {each.name: np.interp(times_s, each.time_s, each.values) for each in moving}
    return [
        {name: float(values[frame]) for name, values in tracks.items()} for frame in range(frames)
    ]
