"""The panel "Scene": the bodies where they are, the nearest pair, and why a move was refused."""

import json
import logging
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Final

from PySide6.QtCore import QSettings, Qt, QTimer, Signal
from PySide6.QtGui import QHideEvent, QPaintEvent, QShowEvent
from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.build import named
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.theme import STEP_PX, State, state_look
from cosmic.frame.overrides import override
from cosmic.frame.verdict import MoveVerdict, Reason
from cosmic.mico.api.news import AxisRefused, MovementNews
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.model import SceneModel, pair_of
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.gui.mico_widget import MicoWidget
from cosmic.mico.gui.state_feed import StateFeed

if TYPE_CHECKING:
    from cosmic.mico.gui.scene.content import Path
    from cosmic.mico.gui.scene.scene_widget import SceneWidget

logger = logging.getLogger(__name__)

_STILL: Final = 1e-3
"""Share of its travel by which the position of an axis at rest may differ."""


def bodies_moved_by(model: SceneModel, axes: Iterable[str]) -> frozenset[str]:
    """Return the bodies that the axes move, with all that these carry."""
    wanted = frozenset(axes)
    driven = {drive.joint for drive in model.drives if drive.axis in wanted}
    moved: set[str] = set()
    for joint in model.joints:  # parents come before their children
        if joint.name in driven or joint.parent in moved:
            moved.add(joint.child)
    return frozenset(moved)


def margin_um(model: SceneModel, one: str, other: str) -> float:
    """Return how far apart two bodies must keep."""
    pair = pair_of(one, other)
    return next((each.margin_um for each in model.pairs if each.bodies == pair), 0.0)


def far(state: PositionerState, stood: float) -> bool:
    """Tell whether an axis stands elsewhere than where it stood."""
    if state.position is None:
        return False
    low, high = state.limits or (0.0, 1000.0)
    return abs(state.position - stood) > _STILL * (high - low)


PERIOD_MS: Final = 50
_STATE: Final = "scene/view"
_THERE: Final = 0.05


class ScenePanel(QWidget):
    """Brings the live platform to a `SceneWidget`, at most 20 times a second; GUI thread.

    The widget is made after the window was painted for the first time: OpenGL takes most of a
    second to load. While nobody sees the panel, nothing is drawn and nothing computed.

    Parameters
    ----------
    panel : MicoWidget
        Whose platform is shown; its refusals are, too.
    settings : QSettings
        Where hidden bodies and the place to look from are kept.

    Signals
    -------
    refused_gone()
        The refused movement was taken out of the image.
    aimed(object), placed(object)
        The lines of sight on which a tool is aimed and placed, while `set_moving` is on.
    """

    refused_gone = Signal()
    aimed = Signal(object)
    placed = Signal(object)

    def __init__(
        self, panel: MicoWidget, settings: QSettings, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self.setObjectName("ScenePanel")
        self._panel = panel
        self._mico = panel.mico
        self._settings = settings
        self._scene: SceneWidget | None = None
        self._asked = False
        self._model: SceneModel | None = self._mico.application.scene
        self._positions: dict[str, float] = {}
        self._unknown: dict[str, bool] = {}
        self._verdict: MoveVerdict | None = None
        self._stood: dict[str, float | None] = {}
        self._planned: Path | None = None
        self._replayed = False
        self._movements = Relay(self._on_movement).follow(self._mico.follow_movements)
        self._compact = False
        self._moving = False
        self._feed = StateFeed(self._mico, self, period_ms=PERIOD_MS)
        self._feed.set_paused(True)
        self._wait = named(QLabel("The scene is loading"), "sceneWait")
        self._wait.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._note = named(ElidedLabel(), "sceneUnknown")
        self._note.setContentsMargins(STEP_PX, 0, STEP_PX, 0)
        self._note.hide()
        self._column = QVBoxLayout(self)
        self._column.setContentsMargins(0, 0, 0, 0)
        self._column.setSpacing(0)
        self._column.addWidget(self._wait, 1)
        self._column.addWidget(self._note)
        self.setMinimumSize(30 * STEP_PX, 30 * STEP_PX)
        self._connect()
        self._follow_axes()

    def _connect(self) -> None:
        self._panel.refreshed.connect(self._follow_axes)
        self._panel.verdict_given.connect(self._on_refused)
        self._panel.collision.changed.connect(self._on_collision_changed)
        self._feed.flushed.connect(self._on_flushed)
        watch = self._mico.application.clearance_watch
        if watch is not None:
            watch.changed.connect(self._on_nearest)

    @property
    def scene(self) -> "SceneWidget | None":
        """What draws the scene; None before the window was painted for the first time."""
        return self._scene

    # Making it

    @override
    def paintEvent(self, event: QPaintEvent) -> None:
        super().paintEvent(event)
        if not self._asked:
            self._asked = True
            QTimer.singleShot(0, self.make_scene)

    def make_scene(self) -> None:
        """Make the view of the scene now, if that was not done yet."""
        self._asked = True
        if self._scene is not None:
            return
        # Imported here: it waits for the first image of the window.
        from cosmic.mico.gui.scene.scene_widget import SceneWidget

        scene = SceneWidget(prefer_gl=self._model is not None)
        self._scene = scene
        scene.set_compact(self._compact)
        scene.set_model(self._model)
        scene.restore_state(self._stored())
        self._column.replaceWidget(self._wait, scene)
        self._wait.deleteLater()
        words = scene.findChild(ElidedLabel, "sceneRefused")
        if words is not None:
            words.clicked.connect(self.clear_refused)
        scene.refused_cleared.connect(self._on_refused_cleared)
        scene.aimed.connect(self.aimed)
        scene.placed.connect(self.placed)
        scene.set_moving(self._moving)
        self._show_all()

    def set_compact(self, compact: bool) -> None:
        """Show the scene alone, in the room of an inset, or with all that belongs to it."""
        self._compact = compact
        least = 12 * STEP_PX if compact else 30 * STEP_PX
        self.setMinimumSize(least, 9 * STEP_PX if compact else least)
        if self._scene is not None:
            self._scene.set_compact(compact)

    @property
    def moving(self) -> bool:
        """Whether the left button aims a tool."""
        return self._moving

    def set_moving(self, on: bool) -> None:
        """Have the left button aim a tool, or turn what is seen."""
        self._moving = on
        if self._scene is not None:
            self._scene.set_moving(on)

    def _stored(self) -> dict[str, object]:
        try:
            state = json.loads(str(self._settings.value(_STATE, "{}")))
        except ValueError:
            logger.warning("the saved view of the scene is damaged; the default is used")
            return {}
        return state if isinstance(state, dict) else {}

    def save(self) -> None:
        """Keep hidden bodies and the place to look from for the next start."""
        if self._scene is not None:
            self._settings.setValue(_STATE, json.dumps(self._scene.save_state()))

    def _show_all(self) -> None:
        self._on_flushed()
        self._on_collision_changed()
        watch = self._mico.application.clearance_watch
        self._on_nearest(watch.latest if watch is not None else None)
        self._show_refused()
        self.set_planned(self._planned)

    # Live

    @override
    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self._feed.set_paused(False)
        if self._scene is not None:
            self._show_all()

    @override
    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        self._feed.set_paused(True)

    def _follow_axes(self) -> None:
        """Take the axes there are now."""
        self._feed.clear()
        self._unknown.clear()
        try:
            for axis in self._mico:
                self._feed.add(axis.key, self)
        except CosmicError as exc:
            logger.debug("the scene is shown after the rescan: %s", exc)
        self._on_flushed()

    def show_state(self, state: PositionerState) -> None:
        """Take the position of one axis; for the feed."""
        if state.position is not None:
            self._positions[state.name] = state.position
        self._unknown[state.name] = state.position is None or state.confidence is Confidence.UNKNOWN

    def _on_flushed(self) -> None:
        if self._verdict is not None and self._moves_again():
            self.clear_refused()
        if self._scene is None or not self.isVisible() or self._replayed:
            return
        self._scene.set_positions(self._positions)
        unknown = [name for name, is_unknown in self._unknown.items() if is_unknown]
        mark = state_look(State.UNKNOWN).glyph
        self._note.set_text(
            f"{mark} position unknown, drawn at the last reading: {', '.join(unknown)}"
        )
        self._note.setVisible(bool(unknown) and self._model is not None)

    def _on_nearest(self, nearest: Approach | None) -> None:
        if self._scene is not None and self.isVisible():
            self._scene.set_nearest(nearest)

    def _on_collision_changed(self) -> None:
        if self._scene is not None and self._model is not None:
            axes = self._panel.collision.unwatched
            self._scene.set_unwatched(bodies_moved_by(self._model, axes))

    # What was refused

    def _on_movement(self, news: MovementNews) -> None:
        if isinstance(news, AxisRefused):
            self._on_refused(news.verdict)

    def _on_refused(self, verdict: MoveVerdict) -> None:
        if verdict.reason is not Reason.COLLISION or not verdict.bodies:
            return
        self._verdict = verdict
        self._stood = dict.fromkeys(self._refused_axes(verdict))
        self._moves_again()  # notes where they stand, if they do
        self._show_refused()

    def _refused_axes(self, verdict: MoveVerdict) -> list[str]:
        if verdict.axis:
            return [verdict.axis]
        return [
            axis
            for axis, there in verdict.pose
            if abs(there - self._positions.get(axis, there)) > _THERE
        ]

    def _moves_again(self) -> bool:
        """Tell whether an axis of the refused movement was at rest since, and moved from there."""
        again = False
        for axis, stood in self._stood.items():
            state = self._mico[axis].details
            if stood is None:
                self._stood[axis] = None if state.in_motion else state.position
            elif state.in_motion or far(state, stood):
                again = True
        return again

    def _show_refused(self) -> None:
        if self._scene is not None:
            self._scene.show_refused(self._approach())

    def _approach(self) -> Approach | None:
        verdict = self._verdict
        if verdict is None or verdict.place_um is None or self._model is None:
            return None
        one, other = verdict.bodies
        return Approach(
            bodies=(one, other),
            distance_um=verdict.clearance_um or 0.0,
            places_um=(verdict.place_um, verdict.place_um),
            margin_um=margin_um(self._model, one, other),
            pose=self._ghost_pose(verdict),
        )

    def _ghost_pose(self, verdict: MoveVerdict) -> dict[str, float]:
        """Return where the axes that were to move would stand.

        The pose of the verdict also has a place for every axis that is known by its steps only,
        in the middle of where it may be; to draw that would tell of a movement nobody wished.
        """
        if verdict.axis:
            return {axis: there for axis, there in verdict.pose if axis == verdict.axis}
        return {
            axis: there
            for axis, there in verdict.pose
            if self._mico[axis].details.confidence is Confidence.KNOWN
            or self._mico[axis].details.in_motion
        }

    def clear_refused(self) -> None:
        """Take the refused movement out of the image."""
        self._on_refused_cleared()
        if self._scene is not None:
            self._scene.clear_refused()

    def _on_refused_cleared(self) -> None:
        self._verdict = None
        self._stood = {}
        self.refused_gone.emit()

    # What is planned

    def set_bar(self, bar: QWidget) -> None:
        """Have `bar` above the scene."""
        self._column.insertWidget(0, bar)

    def set_planned(self, path: "Path | None") -> None:
        """Draw the way that all axes are about to go, pose by pose; None: none."""
        self._planned = path
        if self._scene is not None:
            self._scene.set_planned(path)

    # What was

    def set_recorded(self, path: "Path | None") -> None:
        """Draw the way that all axes took, pose by pose; None: none."""
        if self._scene is not None:
            self._scene.set_recorded(path)

    def set_replay(self, pose: Mapping[str, float] | None, text: str) -> None:
        """Show a pose of before, and say so; None: where the axes are."""
        self._replayed = pose is not None
        if pose is None:
            self._on_flushed()
            return
        if self._scene is not None:
            self._scene.set_positions(pose)
        self._note.set_text(f"{state_look(State.REFUSED).glyph} {text}")
        self._note.show()
