"""What is said of the pixel below the mouse."""

from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.api.coordinate_transform import Pixel
from cosmic.vico.core.image import CameraImage


def pointer_text(camera: CameraHandle, image: CameraImage | None, point_px: Pixel | None) -> str:
    """Return point and brightness of a pixel, and where that is on the platform."""
    if image is None or point_px is None:
        return ""
    height, width = image.data.shape[:2]
    x, y = round(point_px[0]), round(point_px[1])
    if not (0 <= x < width and 0 <= y < height):
        return ""
    value = image.data[y, x]
    shown = f"{int(value)}" if value.ndim == 0 else ", ".join(f"{int(each)}" for each in value)
    there_um = camera.platform_um(point_px)
    where = "" if there_um is None else f"  at {', '.join(f'{v:.1f}' for v in there_um)} µm"
    return f"{x}, {y} px = {shown}{where}"
