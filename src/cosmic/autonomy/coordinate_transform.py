"""Pixels and positions on the platform: what is calibrated, and moving a tool to a pixel."""

import logging
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

from typing_extensions import override

from cosmic.autonomy.calibrating.registry import CalibrationRegistry
from cosmic.autonomy.calibrations import Calibrations
from cosmic.autonomy.rotation_procedure import RotationProcedure
from cosmic.autonomy.stage_check import StageCheck, StageReport
from cosmic.autonomy.stage_procedure import StageProcedure
from cosmic.autonomy.tools import axis_targets, expected, tip_um
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.frame.operation import Operation, Task
from cosmic.mico.api.application_base import MicoApplicationBase
from cosmic.mico.api.mico import mico_of
from cosmic.mico.api.news import SentMotion
from cosmic.mico.core.motion.orders import MoveTo
from cosmic.mico.core.motion.positioner import positions_of
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.coordinate_transform import (
    CalibrationShown,
    CoordinateTransform,
    Pixel,
    RotationShown,
)
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.pixel_map import PixelMap
from cosmic.vico.core.tool_settings import ToolSettings, tool_mistakes
from cosmic.vico.core.vision.algorithms import (
    FindFibres,
    FindTips,
    FindTools,
    TrackHeldFibres,
)
from cosmic.vico.core.vision.tool_types import ExpectedTool

logger = logging.getLogger(__name__)
NO_TABLE: Final = "no axis turns the plate; name it as vico.table_axis in the platform file"

SOURCE: Final = "click"
REACH_PX: Final = 40.0
LEAST_GAP_PX: Final = 3.0
"""Jaws nearer to each other are one body on an image."""


class PlatformTransform(CoordinateTransform):
    """Joins the cameras of ViCo and the axes of MiCo; any thread.

    Parameters
    ----------
    folder : Path or None
        Where calibrations are kept; None: until the end of the program.
    version : str
        Of the program, for the calibration registry.

    Attributes
    ----------
    calibrations : Calibrations
        Maps from platform to image, and the rotation centre.
    registry : CalibrationRegistry
        All that procedures measure, those maps among it.

    Raises
    ------
    ConfigError
        A tool names an axis that is not there, or a file of calibrations is broken.
    """

    def __init__(
        self,
        vico: VicoApplication,
        mico: MicoApplicationBase,
        folder: Path | None,
        version: str = "",
    ) -> None:
        self._vico = vico
        self._mico = mico_of(mico, SOURCE)
        self._tools = {each.name: each for each in vico.settings.tool}
        axes = [each.name for each in self._mico.settings.positioner]
        if mistakes := tool_mistakes(vico.settings.tool, axes):
            raise ConfigError("\n".join(mistakes))
        self.calibrations = Calibrations(vico.units, self._tools, folder)
        self.registry = CalibrationRegistry(folder, clock=vico.clock, version=version)

    # Pixels to positions

    @override
    def scale_um_px(self, camera: str, zoom_counts: float | None) -> float | None:
        zoom = self._zoom(camera, zoom_counts)
        if zoom is None:
            return None
        try:
            found = self.calibrations.find(camera, zoom, self._vico.settings.plate_um)
        except NotAvailable:
            return None
        return found.map.scale_um_px

    @override
    def problem(self, image: CameraImage) -> str:
        try:
            self._plate_map(image)
        except NotAvailable as exc:
            return str(exc)
        return ""

    @override
    def platform_um(self, image: CameraImage, point_px: Pixel) -> tuple[float, float]:
        x, y = self._plate_map(image).to_um(point_px)
        return float(x), float(y)

    def map_of(self, image: CameraImage, height_um: float, tool: str | None = None) -> PixelMap:
        """Return the map for the pixels of an image, of things at a height.

        Raises
        ------
        NotAvailable
            Not calibrated there; the text says what to do.
        """
        settings = self._vico.unit(image.camera).thread.settings
        zoom = self._zoom(image.camera, image.circumstances.zoom_counts)
        if zoom is None:
            raise NotAvailable(f"{image.camera}: the zoom is not known; home the lens")
        # Asked for each image in the window's thread: it must not wait for the pixels.
        if settings is None or (settings.roi.width_px, settings.roi.height_px) != image.size_px:
            raise NotAvailable(f"{image.camera}: the image was taken with other settings")
        found = self.calibrations.find(image.camera, zoom, height_um, tool)
        roi = settings.roi
        return found.map.for_window(x_px=roi.x_px, y_px=roi.y_px, binning=settings.binning)

    def _plate_map(self, image: CameraImage) -> PixelMap:
        return self.map_of(image, self._vico.settings.plate_um)

    def _zoom(self, camera: str, zoom_counts: float | None) -> float | None:
        return zoom_counts if self._vico.unit(camera).config.behind_lens else 0.0

    # Tools

    @property
    @override
    def targets(self) -> Sequence[str]:
        return tuple(self._tools)

    @override
    def move_to(self, image: CameraImage, point_px: Pixel, what: str) -> str:
        running = self._vico.running_task
        if running is not None and not running.done:
            raise NotAvailable(
                f"{running.title} is running; wait until it has ended, then click again"
            )
        if why := self._mico.application.busy():
            raise NotAvailable(why)
        tool = self._tool(what)
        x_um, y_um, z_um = self._point_um(image, point_px, tool)
        motions = self._reaching(tool, (x_um, y_um, z_um))
        self._mico.begin_together(motions, source=SOURCE)
        logger.info("click: %s to %.1f, %.1f um", what, x_um, y_um)
        return f"{tool.shown} moves to x {x_um:.1f}, y {y_um:.1f} µm"

    def motions_to(self, image: CameraImage, point_px: Pixel, what: str) -> dict[str, SentMotion]:
        """Return what would bring a tool to a pixel, at its height; nothing moves.

        Raises
        ------
        MoveRefused
            The point cannot be reached.
        NotAvailable
            It cannot be told where that is.
        """
        tool = self._tool(what)
        return self._reaching(tool, self._point_um(image, point_px, tool))

    def _point_um(
        self, image: CameraImage, point_px: Pixel, tool: ToolSettings
    ) -> tuple[float, float, float]:
        tip = tip_um(tool, self.positions())
        if tip is None:
            raise NotAvailable(f"{tool.name}: its position is unknown; initialise the platform")
        x_um, y_um = self.map_of(image, tip[2], tool.name).to_um(point_px).tolist()
        return x_um, y_um, tip[2]

    def _reaching(
        self, tool: ToolSettings, point_um: tuple[float, float, float]
    ) -> dict[str, SentMotion]:
        """Return what brings a tool over a point: by the scene, where that has the tool.

        Raises
        ------
        MoveRefused
            The point cannot be reached.
        """
        try:
            in_scene = tool.name in self._mico.tools
        except NotAvailable:
            in_scene = False
        if in_scene:
            return self._mico.tools[tool.name].motions(point_um)
        targets = axis_targets(tool, *point_um[:2])
        return {axis: MoveTo(target, "um") for axis, target in targets.items()}

    def expected_tools(self, image: CameraImage) -> Mapping[str, ExpectedTool]:
        """Return where the tips should be on an image; those that cannot be told are missing."""
        return self._expected(image, any_map=False)

    @override
    def expected_bodies(self, image: CameraImage) -> Mapping[str, ExpectedTool]:
        # To some pixels the map of another tool at that height does as well.
        return self._expected(image, any_map=True)

    def _expected(self, image: CameraImage, *, any_map: bool) -> Mapping[str, ExpectedTool]:
        positions = image.circumstances.positions
        found: dict[str, ExpectedTool] = {}
        for tool in self._tools.values():
            tip = tip_um(tool, positions)
            if tip is None:
                continue
            try:
                mapped = self._map_by(image, tip[2], tool.name, any_map=any_map)
            except NotAvailable:
                continue
            wanted = expected(tool, mapped, tip[:2], positions, REACH_PX)
            width, height = image.size_px
            if wanted is None or not _inside(wanted.tip_px, width, height):
                continue
            is_shut = bool(tool.gap_axis) and wanted.gap_px < LEAST_GAP_PX
            found[tool.name] = wanted.with_jaws_shut() if is_shut else wanted
        return found

    def _map_by(
        self, image: CameraImage, height_um: float, tool: str, *, any_map: bool
    ) -> PixelMap:
        """Return the map that a tool measured, or else that of any."""
        try:
            return self.map_of(image, height_um, tool)
        except NotAvailable:
            if not any_map:
                raise
        return self.map_of(image, height_um)

    def positions(self) -> dict[str, float]:
        """Return where the axes are that are known, in gate coordinates."""
        return positions_of(self._mico.states())

    # Measuring

    @override
    def calibrate_stage(self, tool: str, camera: str) -> Task:
        settings = self._tool(tool)
        procedure = StageProcedure(self._vico, self._mico, self.calibrations, settings, camera)
        return self._begin(f"Calibrating {camera} by {settings.shown}", procedure.run)

    def check_stage(self, tool: str, camera: str) -> tuple[Task, Operation[StageReport]]:
        """Begin to measure how well the two axes of a tool repeat, by the camera.

        Raises
        ------
        NotAvailable
            There is no such tool.
        """
        settings = self._tool(tool)
        procedure = StageProcedure(self._vico, self._mico, self.calibrations, settings, camera)
        check = StageCheck(procedure, tool, (settings.x_axis, settings.y_axis))
        title = f"Checking the axes of {settings.shown}"
        report: Operation[StageReport] = Operation(title)
        return self._begin(title, lambda task: check.run(task, report)), report

    @override
    def find_rotation_centre(self, camera: str) -> Task:
        axis = self._vico.settings.table_axis
        if not axis:
            raise NotAvailable(NO_TABLE)
        procedure = RotationProcedure(
            self._vico, self._mico, self.calibrations, self._plate_map, camera, axis
        )
        return self._begin(f"Rotation centre of {axis}", procedure.run)

    def _begin(self, title: str, measure: Callable[[Task], None]) -> Task:
        def job(task: Task) -> None:
            try:
                measure(task)
            finally:
                self._vico.status_changed.emit()

        return self._vico.begin(title, job)

    @property
    @override
    def calibrated(self) -> Sequence[CalibrationShown]:
        return tuple(
            CalibrationShown(
                camera,
                tool,
                plane.zoom_counts,
                plane.height_um,
                plane.fit.map.scale_um_px,
                plane.fit.rms_px,
                plane.measured,
            )
            for camera in self._vico.units
            for tool in self._tools
            for plane in self.calibrations.get(camera, tool).planes
        )

    @override
    def rotation_centre(self, camera: str) -> RotationShown | None:
        found = self.calibrations.get(camera, "").rotation
        if found is None:
            return None
        fit = found.fit
        return RotationShown(found.axis, fit.centre_um, fit.std_um, fit.rms_um, found.measured)

    def _tool(self, name: str) -> ToolSettings:
        if name not in self._tools:
            known = ", ".join(self._tools) or "none"
            raise ConfigError(f"there is no tool {name!r}; the platform has: {known}")
        return self._tools[name]


def _inside(point_px: Pixel, width: int, height: int) -> bool:
    return 0.0 <= point_px[0] <= width - 1.0 and 0.0 <= point_px[1] <= height - 1.0


def join_transform(
    vico: VicoApplication, mico: MicoApplicationBase, folder: Path | None, version: str = ""
) -> None:
    """Have the pixels of ViCo's cameras mean positions on the platform; raises `ConfigError`."""
    transform = PlatformTransform(vico, mico, folder, version)
    if folder is not None:
        vico.focus_models.keep_in(folder)
    for unit in vico.units.values():
        for link in map(unit.chain.algorithm, unit.chain.names):
            if isinstance(link, FindFibres):
                link.expect = transform.expected_bodies
            elif isinstance(link, FindTools | FindTips | TrackHeldFibres):
                link.expect = transform.expected_tools
    vico.transform = transform
