"""Pixels and places on the platform, where the platform is another station's."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from typing_extensions import override

from cosmic.frame.errors import NotAvailable
from cosmic.frame.operation import Task
from cosmic.frame.threads import may_wait_here
from cosmic.vico.api.places import CalibrationShown, Pixel, Places, RotationShown
from cosmic.vico.api.sent_image import NOT_HOSTED, ReceivedImage
from cosmic.vico.core.image import CameraImage

if TYPE_CHECKING:
    from cosmic.vico.api.vico import Vico


class PlacesOnImages(Places):
    """What each image brings along of its place; movements are begun there. Any thread."""

    def __init__(self, vico: "Vico") -> None:
        self._vico = vico

    @override
    def scale_um_px(self, camera: str, zoom_counts: float | None) -> float | None:
        return None  # it stands on every image

    @override
    def problem(self, image: CameraImage) -> str:
        return image.plate_problem if isinstance(image, ReceivedImage) else NOT_HOSTED

    @override
    def platform_um(self, image: CameraImage, place_px: Pixel) -> tuple[float, float]:
        if not isinstance(image, ReceivedImage) or image.plate is None:
            raise NotAvailable(self.problem(image))
        x, y = place_px
        return image.plate.to_um((float(x), float(y)))

    @property
    @override
    def targets(self) -> Sequence[str]:
        return self._vico.tools

    @override
    def move_to(self, image: CameraImage, place_px: Pixel, what: str) -> str:
        there_um = self.platform_um(image, place_px)
        clicked_px = (float(place_px[0]), float(place_px[1]))
        camera = self._vico.camera(image.camera)
        if may_wait_here():
            return camera.click(clicked_px, there_um, what)
        camera.click_aside(clicked_px, there_um, what)
        x_um, y_um = there_um
        return f"{what}: asked to move to x {x_um:.1f}, y {y_um:.1f} µm"

    @override
    def calibrate_stage(self, tool: str, camera: str) -> Task:
        return self._vico.camera(camera).calibrate_stage(tool)

    @override
    def find_rotation_centre(self, camera: str) -> Task:
        return self._vico.camera(camera).find_rotation_centre()

    @property
    @override
    def calibrated(self) -> Sequence[CalibrationShown]:
        return self._vico.calibrated

    @override
    def rotation_centre(self, camera: str) -> RotationShown | None:
        return self._vico.rotation_centre(camera)
