"""Which tool the left button has, and what comes of it."""

from PySide6.QtCore import QObject, QPointF, Signal
from PySide6.QtWidgets import QMenu

from cosmic.frame.errors import CosmicError, MoveRefused
from cosmic.frame.gui.theme import State, state_look
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.api.coordinate_transform import Pixel
from cosmic.vico.gui.image_view import CameraImageView, Layer, Tool
from cosmic.vico.gui.measures import MeasureLayer
from cosmic.vico.gui.tool_row import ToolRow
from cosmic.vico.gui.tools import AngleTool, ClickTool, DistanceTool, RoiLayer, RoiTool


class ImageTools(QObject):
    """Joins the buttons to the image.

    Signals
    -------
    message(str)
        One line for the operator: what was begun, or why not.
    region_chosen(int, int, int, int)
        x, y, width and height of the part to be read, in pixels of the image shown.
    aimed(object, str)
        A pixel is pointed at to which a click would move that tool; None: no longer.
    refused(object, object, str)
        The verdict on a click, its pixel, and the tool.
    menu_made(QMenu, object)
        The menu of the right button is about to be shown, for whoever has more to offer; and the
        pixel that was clicked.
    """

    message = Signal(str)
    aimed = Signal(object, str)
    refused = Signal(object, object, str)
    menu_made = Signal(QMenu, object)
    region_chosen = Signal(int, int, int, int)

    def __init__(
        self, view: CameraImageView, row: ToolRow, camera: CameraHandle, parent: QObject
    ) -> None:
        super().__init__(parent)
        self._view, self._row, self._camera = view, row, camera
        self._target = ""
        self.measures = MeasureLayer()
        self._roi, self._click = RoiTool(view, self), ClickTool(self)
        self.layers: tuple[Layer, ...] = (self.measures, RoiLayer(self._roi))
        self._tools: dict[str, Tool] = {
            "distance": DistanceTool(self.measures, self._scale),
            "angle": AngleTool(self.measures, self._scale),
            "region": self._roi,
        }
        row.tool_chosen.connect(self._on_tool)
        row.target_chosen.connect(self._on_target)
        view.delete_requested.connect(self._on_delete)
        view.cancel_requested.connect(self.put_away)
        view.menu_requested.connect(self._on_menu)
        self._click.clicked.connect(self._on_clicked)
        self._click.aimed.connect(lambda point_px: self.aimed.emit(point_px, self._target))
        self._roi.chosen.connect(self._on_region)

    def _scale(self) -> float | None:
        """Return the scale that was in force when the image shown was taken."""
        image = self._view.image
        return None if image is None else image.circumstances.scale_um_px

    @property
    def target(self) -> str:
        """What a click moves; empty where it moves nothing."""
        return self._target

    def refresh(self) -> None:
        """Put the tool away that can no longer be used."""
        if self._target and self._camera.calibration_problem:
            self.put_away()
            self._refuse(self._camera.calibration_problem)

    def put_away(self) -> None:
        """Let the mouse pan again."""
        self._row.choose("")
        self._on_tool("")

    def _on_tool(self, name: str) -> None:
        self._target = ""
        self._view.set_tool(self._tools.get(name))
        self.message.emit("")

    def _on_target(self, target: str) -> None:
        self._view.set_tool(self._click)
        self._target = target
        self.message.emit(
            f"click or drag to where {target} is to go; Ctrl+wheel changes its height; Esc ends"
        )

    def _on_clicked(self, point_px: Pixel) -> None:
        if not self._view.is_inside(point_px):
            self._refuse("that is outside the image")
            return
        try:
            self.message.emit(self._camera.click_to_move(point_px, self._target))
        except MoveRefused as exc:
            self._refuse(str(exc))
            self.refused.emit(exc.verdict, point_px, self._target)
        except CosmicError as exc:
            self._refuse(str(exc))

    def _refuse(self, reason: str) -> None:
        self.message.emit(f"{state_look(State.REFUSED).glyph} {reason}")

    def _on_region(self, x_px: int, y_px: int, width_px: int, height_px: int) -> None:
        self.put_away()
        self.region_chosen.emit(x_px, y_px, width_px, height_px)

    # Measurements

    def _on_delete(self) -> None:
        self.measures.remove(self.measures.chosen)
        self._view.redraw()

    def _on_clear(self) -> None:
        self.measures.clear()
        self._view.redraw()

    def _on_menu(self, point: QPointF) -> None:
        near = self.measures.at(point, self._view)
        if near is not None:
            self.measures.chosen = near
            self._view.redraw()
        menu = self.make_menu()
        self.menu_made.emit(menu, self._view.pixel_at(point))
        menu.aboutToHide.connect(menu.deleteLater)
        menu.popup(self._view.mapToGlobal(point.toPoint()))

    def make_menu(self) -> QMenu:
        """Return the menu of the right button."""
        menu = QMenu(self._view)
        for text, act, usable in (
            ("Delete this measurement", self._on_delete, self.measures.chosen is not None),
            ("Delete all measurements", self._on_clear, bool(self.measures.measures)),
            ("Fit", self._view.fit, True),
            ("1:1", self._view.one_to_one, True),
        ):
            action = menu.addAction(text)
            action.setEnabled(usable)
            action.triggered.connect(act)
        return menu
