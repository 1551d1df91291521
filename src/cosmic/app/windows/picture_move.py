"""Moving the chosen tool in the pictures: its ghost, the gate's answer, and a detour."""

import logging
from collections.abc import Callable, Mapping
from typing import Final

import numpy as np
from PySide6.QtCore import QObject, QTimer

from cosmic.app.panels.scene import ScenePanel
from cosmic.app.panels.tool import USUAL, Shown, ToolPanel
from cosmic.app.rig import Rig
from cosmic.autonomy.coordinate_transform import PlatformTransform
from cosmic.frame.errors import CosmicError, MoveRefused, NotAvailable
from cosmic.frame.gui.theme import State, state_look
from cosmic.frame.verdict import MoveVerdict, Reason
from cosmic.mico.api.news import SentMotion
from cosmic.mico.core.motion.orders import MoveTo
from cosmic.mico.core.motion.positioner import positions_of
from cosmic.mico.gui.detour_request import DetourRequest
from cosmic.mico.gui.mico_widget import MicoWidget
from cosmic.mico.gui.scene.picking import Ray
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.coordinate_transform import Pixel
from cosmic.vico.gui.camera_view import CameraView

logger = logging.getLogger(__name__)

ASK_MS: Final = 80
"""So often the gate is asked while the mouse is dragged."""
_LEVEL: Final = 0.05
"""Least slope of a line of sight that meets the height of a tool at a point."""
_UM: Final = 1000.0


def directions_on(x_px: np.ndarray, y_px: np.ndarray) -> Shown:
    """Return where on a picture x and y lead, from what they add to a pixel, shape (2,) each."""
    level = abs(x_px[0]) * abs(y_px[1]) >= abs(x_px[1]) * abs(y_px[0])
    across, upright = (x_px, y_px) if level else (y_px, x_px)
    names = ("x", "y") if level else ("y", "x")
    right, up = 1 if across[0] > 0.0 else -1, 1 if upright[1] < 0.0 else -1
    return {
        (names[0], right): "right",
        (names[0], -right): "left",
        (names[1], up): "up",
        (names[1], -up): "down",
    }


class PictureMove(QObject):
    """Asks the gate while the mouse aims, and shows what it answers; GUI thread.

    The click itself is made by the camera's view; in the scene it is made here.

    Parameters
    ----------
    rig : Rig
        The platform.
    gui : MicoWidget
        Shows refusals, and has detours planned.
    """

    def __init__(
        self,
        rig: Rig,
        gui: MicoWidget,
        tool: ToolPanel,
        scene: ScenePanel,
        cameras: list[CameraView],
        parent: QObject,
    ) -> None:
        super().__init__(parent)
        self._rig, self._gui, self._tool, self._scene = rig, gui, tool, scene
        self._aim: Callable[[], None] | None = None
        self._ask = QTimer(self, interval=ASK_MS, singleShot=True)
        self._ask.timeout.connect(self._on_ask)
        for view in cameras:
            self._follow(view)
        scene.aimed.connect(self._on_scene_aimed)
        scene.placed.connect(self._on_scene_placed)

    def _follow(self, view: CameraView) -> None:
        view.tools.aimed.connect(lambda point, what: self._on_aimed(view, point, what))
        view.tools.refused.connect(
            lambda verdict, point, what: self._on_refused(view, verdict, point, what)
        )
        view.view.height_wheeled.connect(self._on_wheeled)

    # Directions

    def show_directions(self, view: CameraView) -> None:
        """Have the pad point as axes move on the picture, where that is calibrated."""
        transform, image = self._transform, view.view.image
        if transform is None or image is None:
            return
        application = self._rig.vico.application
        plate_um = application.settings.plate_um if application is not None else 0.0
        try:
            mapped = transform.map_of(image, plate_um)
        except NotAvailable:
            self._tool.show_directions(USUAL)
            return
        here = np.asarray(mapped.to_px((0.0, 0.0)), float)
        ahead = {
            "x": np.asarray(mapped.to_px((100.0, 0.0)), float) - here,
            "y": np.asarray(mapped.to_px((0.0, 100.0)), float) - here,
        }
        self._tool.show_directions(directions_on(ahead["x"], ahead["y"]))

    # On an image

    def _on_aimed(self, view: CameraView, point_px: Pixel | None, what: str) -> None:
        ghost = view.ghost
        if point_px is None:
            self._aim = None
            ghost.aim(None)
            ghost.show_answer("", allowed=True)
            self._scene.set_planned(None)
        else:
            image, transform = view.view.image, self._transform
            known = transform.expected_tools(image).get(what) if transform and image else None
            if known is None:
                ghost.aim(point_px)
            else:
                ghost.aim(
                    point_px,
                    from_px=known.tip_px,
                    forward=known.forward,
                    width_px=known.width_px,
                    gap_px=known.gap_px,
                )
            self._aim = lambda: self._ask_image(view, point_px, what)
            if not self._ask.isActive():
                self._ask.start()
        view.view.redraw()

    @property
    def _transform(self) -> PlatformTransform | None:
        application = self._rig.vico.application
        found = application.transform if isinstance(application, VicoApplication) else None
        return found if isinstance(found, PlatformTransform) else None

    def _on_ask(self) -> None:
        if self._aim is not None:
            self._aim()

    def _ask_image(self, view: CameraView, point_px: Pixel, what: str) -> None:
        """Ask the gate for the way to a pixel, and say what it answers beside the ghost."""
        transform, image = self._transform, view.view.image
        if transform is None or image is None:
            return
        try:
            motions = transform.motions_to(image, point_px, what)
        except MoveRefused as exc:
            view.ghost.show_answer(str(exc.verdict), allowed=False)
        except CosmicError as exc:
            view.ghost.show_answer(str(exc), allowed=False)
        else:
            text, allowed = self._answer(motions)
            view.ghost.show_answer(text, allowed=allowed)
        view.view.redraw()

    def _answer(self, motions: Mapping[str, SentMotion]) -> tuple[str, bool]:
        """Return what the gate says to motions; the straight path is drawn in the scene."""
        now = positions_of(self._rig.mico.states())
        targets = {name: each.target for name, each in motions.items() if isinstance(each, MoveTo)}
        self._scene.set_planned([now, now | targets])
        try:
            verdict = self._rig.mico.check_motions(dict(motions))
        except MoveRefused as exc:
            verdict = exc.verdict
        except CosmicError as exc:
            return str(exc), False
        return ("" if verdict.allowed else str(verdict)), verdict.allowed

    def _on_refused(
        self, view: CameraView, verdict: MoveVerdict, point_px: Pixel, what: str
    ) -> None:
        """Show a refused click as a refused movement, and offer the detour by one button."""
        self._gui.verdict_given.emit(verdict)
        transform, image = self._transform, view.view.image
        if verdict.reason is not Reason.COLLISION or transform is None or image is None:
            return
        try:
            motions = transform.motions_to(image, point_px, what)
        except CosmicError as exc:
            logger.debug("no detour for a click: %s", exc)
            return
        self._offer_detour(verdict, motions)

    def _offer_detour(self, verdict: MoveVerdict, motions: Mapping[str, SentMotion]) -> None:
        targets = {name: each.target for name, each in motions.items() if isinstance(each, MoveTo)}
        if not targets:
            return
        (axis, target), *others = targets.items()
        request = DetourRequest(
            axis=axis,
            target=target,
            where=f"{target:.0f}",
            verdict=verdict,
            note=self._tool.say,
            refuse=lambda refused: self._gui.verdict_given.emit(refused),
            others=dict(others),
        )
        self._tool.offer_detour(lambda: self._gui.detour_wanted.emit(request))

    def _on_wheeled(self, notches: int) -> None:
        """Move the chosen tool up or down by the step of the pad, for each notch of the wheel."""
        name = self._tool.tool.axes.get("z")
        if name is None:
            self._tool.say(f"The {self._tool.tool.name} has no height axis")
            return
        self._tool.move_once(name, 1 if notches > 0 else -1)

    # In the scene

    def _on_scene_aimed(self, ray: Ray | None) -> None:
        if ray is None:
            self._aim = None
            self._scene.set_planned(None)
            return
        self._aim = lambda: self._ask_scene(ray)
        if not self._ask.isActive():
            self._ask.start()

    def _ask_scene(self, ray: Ray) -> None:
        try:
            motions = self._motions_along(ray)
        except CosmicError as exc:
            self._tool.say(f"{state_look(State.REFUSED).glyph} {exc}")
            return
        text, allowed = self._answer(motions)
        glyph = state_look(State.OK if allowed else State.REFUSED).glyph
        self._tool.say(f"{glyph} {text or 'free; let go to move there'}")

    def _on_scene_placed(self, ray: Ray) -> None:
        """Move the chosen tool to where the line of sight meets its height."""
        self._aim = None
        self._scene.set_planned(None)
        try:
            motions = self._motions_along(ray)
            self._tool.say("")
            if why := self._gui.busy:
                raise NotAvailable(why)
            self._rig.mico.begin_together(dict(motions), source="click")
        except MoveRefused as exc:
            self._gui.verdict_given.emit(exc.verdict)
            if exc.verdict.reason is Reason.COLLISION:
                self._offer_detour(exc.verdict, self._motions_along(ray))
        except CosmicError as exc:
            self._tool.say(f"{state_look(State.REFUSED).glyph} {exc}")

    def _motions_along(self, ray: Ray) -> Mapping[str, SentMotion]:
        """Return what brings the tool, at its height, onto a line of sight."""
        tool = self._rig.mico.tools[self._tool.tool.name]
        height = tool.position()[2]
        if abs(float(ray.direction[2])) < _LEVEL:
            raise CosmicError(
                "seen from the side its height cannot be held; use the view from above"
            )
        far = (height / _UM - float(ray.origin_mm[2])) / float(ray.direction[2])
        x, y = (_UM * np.asarray(ray.origin_mm + far * ray.direction)[:2]).tolist()
        return tool.motions((x, y, height))
