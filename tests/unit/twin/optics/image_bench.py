"""The shipped scene as a camera sees it, with its lens, lamp and stages moved by hand."""

import math

import numpy as np
import numpy.typing as npt

from cosmic.frame.clock import ManualClock
from cosmic.twin.optics.optics import Optics
from cosmic.twin.scene import Scene
from cosmic.twin.settings import TwinSettings, shipped_settings

Grey = npt.NDArray[np.float64]


def clean_settings(**image: float) -> TwinSettings:
    """Return the shipped constants without dirt, noise and uneven light, unless told otherwise."""
    shipped = shipped_settings()
    clean = {
        "dust_per_mm2": 0.0,
        "scratches": 0,
        "sensor_specks": 0,
        "uneven": 0.0,
        "slanted": 0.0,
        **image,
    }
    optics = shipped.optics.model_copy(
        update={
            "picture": shipped.optics.picture.model_copy(update=clean),
            "camera": shipped.optics.camera.model_copy(
                update={"noise_grey": 0.0, "shot_grey": 0.0}
            ),
        }
    )
    return shipped.model_copy(update={"optics": optics})


class ImageBench:
    """A scene whose time goes on with each movement."""

    def __init__(self, twin: TwinSettings | None = None, seed: int = 0) -> None:
        self.scene = Scene.from_settings(twin or clean_settings(), ManualClock(), seed)
        assert self.scene.optics is not None
        assert self.scene.lens is not None
        assert self.scene.light is not None
        self.optics: Optics = self.scene.optics
        self.lens = self.scene.lens
        self.light = self.scene.light
        self.now_s = 1.0

    def zoom(self, magnification: float) -> "ImageBench":
        view = self.optics.settings.views["microscope"]
        low, high = view.magnification_low, view.magnification_high
        self._turn("zoom", math.log(magnification / low) / math.log(high / low))
        return self

    def focus(self, height_um: float) -> "ImageBench":
        view = self.optics.settings.views["microscope"]
        way = view.focus_high_um - view.focus_low_um
        self._turn("focus", (height_um - view.focus_low_um) / way)
        return self

    def _turn(self, axis: str, part: float) -> None:
        assert axis in ("zoom", "focus")
        high = self.lens.zoom_range_counts[1] if axis == "zoom" else self.lens.focus_range_counts[1]
        there = self.lens.position_counts(axis, self.now_s)
        self.lens.turn_by_hand(axis, part * high - there, self.now_s)

    def go(self, **target: float) -> "ImageBench":
        """Move stages one after another and wait for each; left_x is left.x."""
        for name, place in target.items():
            stage = self.scene.stages[name.replace("_", ".", 1)]
            route = stage.route(self.now_s)
            route.go(place, 2000.0)
            stage.follow(route, held_until_s=1e9)
            self.now_s = route.end_s + 0.002
        return self

    def image(self, **how: float) -> Grey:
        """Return what the microscope sees now."""
        return self.optics.render(self.now_s, **how).astype(np.float64)

    def px(self, *point_um: float) -> npt.NDArray[np.float64]:
        """Return where a point truly lies in the image."""
        return self.optics.world_to_image_px(point_um, self.now_s)  # type: ignore[arg-type]


def along(image: Grey, start_px: Grey, end_px: Grey, samples: int = 400) -> tuple[Grey, Grey]:
    """Return distances from `start_px` towards `end_px` and the image there, between pixels."""
    parts = np.linspace(0.0, 1.0, samples)
    x = start_px[0] + parts * (end_px[0] - start_px[0])
    y = start_px[1] + parts * (end_px[1] - start_px[1])
    i, j = np.floor(y).astype(int), np.floor(x).astype(int)
    v, u = y - i, x - j
    value = (1 - v) * ((1 - u) * image[i, j] + u * image[i, j + 1]) + v * (
        (1 - u) * image[i + 1, j] + u * image[i + 1, j + 1]
    )
    return parts * math.hypot(*(end_px - start_px)), value


def crossing(distances: Grey, values: Grey) -> float:
    """Return where values cross the middle between their ends for the first time."""
    middle = 0.5 * (values[:8].mean() + values[-8:].mean())
    above = values > middle
    first = int(np.argmax(above != above[0]))
    part = (middle - values[first - 1]) / (values[first] - values[first - 1])
    return float(distances[first - 1] + part * (distances[first] - distances[first - 1]))
