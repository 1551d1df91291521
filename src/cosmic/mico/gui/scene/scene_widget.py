"""`SceneWidget`: the scene as it is now, what is nearest, and why a movement was refused."""

import logging
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import (
    QGridLayout,
    QLabel,
    QSizePolicy,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from cosmic.frame.errors import NotAvailable
from cosmic.frame.gui.build import named
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.overrides import override
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.gui.scene.arms import Preset
from cosmic.mico.gui.scene.clearance_line import ClearanceLine, RefusedLine
from cosmic.mico.gui.scene.content import Path, SceneContent
from cosmic.mico.gui.scene.gl_context import GLContext
from cosmic.mico.gui.scene.look_bar import BodiesButton, LookBar
from cosmic.mico.gui.scene.projection_view import ProjectionView
from cosmic.mico.gui.scene.view import SceneView

logger = logging.getLogger(__name__)

_NO_MODEL: Final = "this platform has none: only the limits of the axes are checked"


class SceneWidget(QWidget):
    """The scene in 3D, or in two projections where there is no OpenGL; GUI thread.

    It knows nothing of where its data come from, and paints only when something it was given
    changed: call `set_positions` and `set_nearest` at up to 30 Hz.

    Parameters
    ----------
    prefer_gl : bool
        Try OpenGL first.

    Signals
    -------
    hovered(str)
        The body under the cursor; empty when there is none.
    refused_cleared()
        The operator took the refused movement out of the picture.
    aimed(object), placed(object)
        See `SceneView`.
    """

    hovered = Signal(str)
    refused_cleared = Signal()
    aimed = Signal(object)
    placed = Signal(object)

    def __init__(self, parent: QWidget | None = None, *, prefer_gl: bool = True) -> None:
        super().__init__(parent)
        self.setObjectName("SceneWidget")
        self._content = SceneContent()
        self._moving = False
        self._preset = "home"
        self._bodies = BodiesButton()
        self._bodies.hidden_changed.connect(self._on_hidden_changed)
        self._toolbar = LookBar(self._bodies)
        self._toolbar.look_requested.connect(self.look)
        self._nearest = ClearanceLine()
        self._refused = RefusedLine()
        self._refused.cleared.connect(self._on_cleared)
        self._none = named(QLabel(), "sceneNone")
        self._none.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._none.setWordWrap(True)
        self._none.setMargin(2 * STEP_PX)
        self._stack = QStackedWidget()
        self._stack.addWidget(self._none)
        self._view = self._make_view(prefer_gl)
        self._arrange()
        self.set_model(None)

    def _arrange(self) -> None:
        for each in (self._toolbar, self._nearest, self._refused):
            each.setSizePolicy(QSizePolicy.Policy.Preferred, QSizePolicy.Policy.Fixed)
        # The refusal lies over the picture, so that it does not make it jump.
        middle = QWidget()
        grid = QGridLayout(middle)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setSpacing(0)
        grid.addWidget(self._stack, 0, 0)
        grid.addWidget(self._refused, 0, 0, Qt.AlignmentFlag.AlignBottom)
        self._refused.raise_()
        column = QVBoxLayout(self)
        column.setContentsMargins(0, STEP_PX // 2, 0, STEP_PX // 2)
        column.setSpacing(STEP_PX // 2)
        column.addWidget(self._toolbar)
        column.addWidget(middle, 1)
        column.addWidget(self._nearest)

    def set_compact(self, compact: bool) -> None:
        """Show the view alone, as an inset does, or with its buttons and the nearest pair."""
        for each in (self._toolbar, self._nearest):
            each.setVisible(not compact)
        self._refused.set_compact(compact)

    def set_moving(self, on: bool) -> None:
        """Have the left button aim a tool, or turn what is seen."""
        self._moving = on
        self._view.set_moving(on)

    def _make_view(self, prefer_gl: bool) -> SceneView:
        view: SceneView
        try:
            view = _gl_view(self._content) if prefer_gl else ProjectionView(self._content)
        except NotAvailable as exc:
            logger.info("the scene is shown as projections: %s", exc)
            view = ProjectionView(self._content, str(exc))
        view.hovered.connect(self.hovered)
        view.aimed.connect(self.aimed)
        view.placed.connect(self.placed)
        view.set_moving(self._moving)
        # Queued: it fails while it is painted, and cannot be replaced there.
        view.failed.connect(self._on_failed, Qt.ConnectionType.QueuedConnection)
        self._stack.addWidget(view)
        return view

    # What is shown

    @property
    def view(self) -> SceneView:
        """What draws the bodies: the 3D view, or the projections."""
        return self._view

    @property
    def content(self) -> SceneContent:
        """What is shown at the moment."""
        return self._content

    @property
    def hovered_body(self) -> str:
        """The body under the cursor."""
        return self._view.hovered_body

    @property
    def nearest_text(self) -> str:
        """What is said of the nearest pair."""
        return self._nearest.text

    @property
    def refused_text(self) -> str:
        """What is said of the refused movement; empty when there is none."""
        return self._refused.text

    def set_model(self, model: SceneModel | None, reason: str = "") -> None:
        """Show another platform; paths, ghost and nearest pair of the one before are gone.

        Parameters
        ----------
        model : SceneModel or None
            None: there is none, which is said in words.
        reason : str
            Why there is none.
        """
        self._content.set_model(model)
        self._none.setText(f"no collision model: {reason or _NO_MODEL}")
        self._stack.setCurrentWidget(self._none if model is None else self._view)
        self._nearest.set_nearest(None)
        self._refused.set_refused(None)
        self._bodies.set_bodies(self._content.meshes)
        self._content.hidden = self._bodies.hidden
        self._toolbar.set_presets(self._content.presets)
        for widget in (self._toolbar, self._nearest):
            widget.setEnabled(model is not None)
        self._view.rebuild()
        self.look(self._preset)

    def set_positions(self, positions: Mapping[str, float]) -> None:
        """Show the bodies with axes at these positions of the gate, um or deg.

        Axes that are not named stay where they were.
        """
        if self._content.set_positions(positions):
            self._view.refresh()

    def set_nearest(self, approach: Approach | None) -> None:
        """Show the two nearest points and their distance; None: not known."""
        if self._content.set_nearest(approach):
            self._nearest.set_nearest(approach)
            self._view.update()

    def show_refused(self, approach: Approach | None) -> None:
        """Show where a refused movement would have led; None takes it out of the picture."""
        self._content.set_refused(approach)
        self._refused.set_refused(approach)
        self._view.refresh()

    def clear_refused(self) -> None:
        """Hide the refused movement."""
        self.show_refused(None)

    def set_planned(self, path: Path | None, bodies: Sequence[str] = ()) -> None:
        """Show the way the tips of bodies will take; see `SceneContent.tracks`."""
        self._content.planned = self._content.tracks(path, bodies)
        self._view.update()

    def set_recorded(self, path: Path | None, bodies: Sequence[str] = ()) -> None:
        """Show the way the tips of bodies took, in another colour."""
        self._content.recorded = self._content.tracks(path, bodies)
        self._view.update()

    def set_unwatched(self, bodies: Iterable[str]) -> None:
        """Mark the bodies that are taken out of collision detection."""
        unwatched = frozenset(bodies)
        if unwatched != self._content.unwatched:
            self._content.unwatched = unwatched
            self._view.refresh()

    # Looking

    def presets(self) -> tuple[Preset, ...]:
        """Return the places to look from."""
        return self._content.presets

    def look(self, name: str) -> None:
        """Look from the preset `name`, at the bodies where they are now; "home" if there is none.

        Home, top, front, side, and the arms of the model, such as left, right, probe.
        """
        known = {preset.name: preset for preset in self._content.presets}
        if not known:
            return
        preset = known.get(name) or known["home"]
        self._preset = preset.name
        self._view.look(self._content.sight(preset))

    def _on_hidden_changed(self, hidden: frozenset[str]) -> None:
        self._content.hidden = hidden
        self._view.refresh()

    def _on_cleared(self) -> None:
        self.clear_refused()
        self.refused_cleared.emit()

    # What outlives the window

    def save_state(self) -> dict[str, object]:
        """Return what `restore_state` takes: the hidden bodies and where to look from."""
        return {"hidden": sorted(self._bodies.hidden), "preset": self._preset}

    def restore_state(self, state: Mapping[str, object]) -> None:
        """Take over what `save_state` returned; what cannot be read is left as it is."""
        hidden = state.get("hidden")
        if isinstance(hidden, list | tuple):
            self._bodies.set_hidden(name for name in hidden if isinstance(name, str))
        preset = state.get("preset")
        if isinstance(preset, str):
            self._preset = preset
            self.look(preset)

    # OpenGL may go

    def _on_failed(self, reason: str) -> None:
        if isinstance(self._view, ProjectionView):
            return
        logger.warning("the 3D view cannot draw any more, projections instead: %s", reason)
        before = self._view
        self._view = ProjectionView(self._content, f"OpenGL failed ({reason})")
        self._view.hovered.connect(self.hovered)
        self._stack.addWidget(self._view)
        if self._content.model is not None:
            self._stack.setCurrentWidget(self._view)
        self._stack.removeWidget(before)
        before.deleteLater()
        self._view.rebuild()
        self.look(self._preset)

    @override
    def closeEvent(self, event: QCloseEvent) -> None:
        self._view.release()
        super().closeEvent(event)


def _gl_view(content: SceneContent) -> SceneView:
    """Return the 3D view; pyqtgraph's OpenGL takes most of a second to import, so only here."""
    context = GLContext()
    try:
        from cosmic.mico.gui.scene.gl_view import GLSceneView
    except (ImportError, OSError, AttributeError) as exc:  # PyOpenGL without its library
        raise NotAvailable(f"no OpenGL here ({exc})") from exc
    return GLSceneView(content, context)
