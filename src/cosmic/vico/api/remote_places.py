"""Pixels and places on the platform, where the platform is another station's."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from typing_extensions import override

from cosmic.frame.errors import NotAvailable
from cosmic.frame.task import Task
from cosmic.frame.threads import may_wait_here
from cosmic.vico.api.places import CalibrationShown, Pixel, Places, RotationShown
from cosmic.vico.api.station_picture import NOT_HOSTED, ReceivedPicture
from cosmic.vico.core.picture import Picture

if TYPE_CHECKING:
    from cosmic.vico.api.remote_application import RemoteVicoApplication


class RemotePlaces(Places):
    """What each picture brings along of its place; movements are begun there. Any thread."""

    def __init__(self, remote: "RemoteVicoApplication") -> None:
        self._remote = remote

    @override
    def scale_um_px(self, camera: str, zoom_counts: float | None) -> float | None:
        return None  # it stands on every picture

    @override
    def problem(self, picture: Picture) -> str:
        return picture.plate_problem if isinstance(picture, ReceivedPicture) else NOT_HOSTED

    @override
    def platform_um(self, picture: Picture, place_px: Pixel) -> tuple[float, float]:
        if not isinstance(picture, ReceivedPicture) or picture.plate is None:
            raise NotAvailable(self.problem(picture))
        x, y = place_px
        return picture.plate.to_um((float(x), float(y)))

    @property
    @override
    def targets(self) -> Sequence[str]:
        state = self._remote.state
        return state.tools if state is not None else ()

    @override
    def move_to(self, picture: Picture, place_px: Pixel, what: str) -> str:
        x_um, y_um = self.platform_um(picture, place_px)
        arguments = {
            "camera": picture.camera,
            "place_px": (float(place_px[0]), float(place_px[1])),
            "place_um": (x_um, y_um),
            "what": what,
        }
        calls = self._remote.calls
        if may_wait_here():
            return str(calls.call("click_to_move", **arguments))
        camera, remote = picture.camera, self._remote
        remote.note_refusal(camera, "")
        calls.do(
            "click_to_move", refused=lambda exc: remote.note_refusal(camera, str(exc)), **arguments
        )
        return f"{what}: asked to move to x {x_um:.1f}, y {y_um:.1f} µm"

    @override
    def calibrate_stage(self, tool: str, camera: str) -> Task:
        title = f"Calibrating {camera} by {tool}"
        return self._remote.calls.begin(title, "calibrate_stage", camera=camera, tool=tool)

    @override
    def find_rotation_centre(self, camera: str) -> Task:
        return self._remote.calls.begin("Rotation centre", "find_rotation_centre", camera=camera)

    @property
    @override
    def calibrated(self) -> Sequence[CalibrationShown]:
        state = self._remote.state
        return state.calibrated if state is not None else ()

    @override
    def rotation_centre(self, camera: str) -> RotationShown | None:
        state = self._remote.state
        known = state.camera(camera) if state is not None else None
        return known.rotation if known is not None else None
