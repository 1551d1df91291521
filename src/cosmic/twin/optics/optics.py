"""The cameras' side of the scene: what each view shows at a moment, and the truth about it."""

import random
from abc import abstractmethod
from collections.abc import Callable, Mapping
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Final, Protocol

import numpy as np

from cosmic.frame.arrays import Floats, Pixels
from cosmic.twin.force_side import ForceSide
from cosmic.twin.kinematics import Point
from cosmic.twin.lens import LensAxisName, TwinLens
from cosmic.twin.light import TwinLight
from cosmic.twin.optics.drawing import (
    Drawer,
    Drawing,
    LocalDrawer,
    RemoteDrawer,
    drawing_process,
)
from cosmic.twin.optics.projection import STEADY, Area, Projection, Wobble, project
from cosmic.twin.settings import TwinSettings
from cosmic.twin.stage import Stage

if TYPE_CHECKING:
    from cosmic.twin.optics.subjects import Subjects

MICROSCOPE: Final = "microscope"


class RoiLike(Protocol):
    """A part of the sensor, in binned pixels; ViCo's `Roi` is one."""

    @property
    @abstractmethod
    def x_px(self) -> int:
        """Left edge."""

    @property
    @abstractmethod
    def y_px(self) -> int:
        """Upper edge."""

    @property
    @abstractmethod
    def width_px(self) -> int:
        """Columns."""

    @property
    @abstractmethod
    def height_px(self) -> int:
        """Rows."""


class Optics:
    """What the twin's cameras see; any thread. Nothing is computed before somebody looks.

    Parameters
    ----------
    settings : TwinSettings
        Constants.
    folder : Path
        Of twin.toml.
    stages : mapping of str to Stage
        All stages by name.
    force_side : ForceSide
        Fibres and tools.
    seed : int
        Of dirt and noise.
    apart : bool
        Images are drawn in a process of their own, which all scenes of a program share.
    """

    def __init__(
        self,
        settings: TwinSettings,
        folder: Path,
        stages: Mapping[str, Stage],
        force_side: ForceSide,
        lens: TwinLens,
        light: TwinLight,
        seed: int,
        *,
        apart: bool = False,
    ) -> None:
        self.settings = settings.optics
        self._twin = settings
        self._folder = folder
        self._stages = stages
        self._force_side = force_side
        self._lens = lens
        self._seed = seed
        self._light = light
        self._drawer: Drawer
        if apart:
            self._drawer = RemoteDrawer(drawing_process(), settings.optics, seed)
        else:
            self._drawer = LocalDrawer(settings.optics, seed)
        self._lock = Lock()
        self._made: Subjects | None = None

    def close(self) -> None:
        """Let go of what images are drawn with; harmless the second time."""
        self._drawer.close()

    @property
    def views(self) -> tuple[str, ...]:
        """Names of the views; the microscope's is the first."""
        return tuple(self.settings.views)

    @property
    def sensor_px(self) -> tuple[int, int]:
        """Width and height of each camera's sensor."""
        return self.settings.camera.width_px, self.settings.camera.height_px

    def render(
        self,
        at_s: float,
        exposure_s: float = 0.02,
        gain_db: float = 0.0,
        roi: RoiLike | None = None,
        binning: int = 1,
        bits: int = 8,
        view: str = MICROSCOPE,
    ) -> Pixels:
        """Return what a camera sees at `at_s`: a fresh array, shape (height, width).

        Parameters
        ----------
        at_s : float
            Platform time, not later than now and some seconds ago at most.
        roi : RoiLike or None
            In binned pixels; None: the whole sensor.
        binning : int
            So many pixels across and down are averaged into one.
        bits : int
            8: uint8; 16: uint16.
        """
        return self.expose(at_s, exposure_s, gain_db, roi, binning, bits, view).pixels()

    def expose(
        self,
        at_s: float,
        exposure_s: float = 0.02,
        gain_db: float = 0.0,
        roi: RoiLike | None = None,
        binning: int = 1,
        bits: int = 8,
        view: str = MICROSCOPE,
    ) -> Drawing:
        """Begin to draw what a camera sees at `at_s`; the parameters are those of `render`."""
        from cosmic.twin.optics.view import Shot

        shot = Shot(
            subject=self._subjects.at(at_s),
            at_s=at_s,
            zoom=self._zoom(view)(at_s),
            focus=self._focus(view)(at_s),
            percent=self._light.given_percent(at_s),
            exposure_s=exposure_s,
            gain_db=gain_db,
            area=self._area(roi, binning),
            binning=binning,
            bits=bits,
            wobble=self._wobble(view, at_s),
        )
        return self._drawer.begin(view, shot)

    # ------------------------------------------------------------------ truth, for tests only

    def world_to_image_px(
        self,
        point_um: Point | Floats,
        at_s: float,
        roi: RoiLike | None = None,
        binning: int = 1,
        view: str = MICROSCOPE,
    ) -> Floats:
        """Return where points of the world truly lie in the image: shape (2,) or (n, 2), x and y.

        For tests that need to know; code that controls the platform must find out for itself.

        Parameters
        ----------
        point_um : (float, float, float) or ndarray, shape (n, 3)
            A pixel's centre has whole numbers.
        """
        points = np.asarray(point_um, dtype=np.float64)
        projection = self.projection(at_s, roi, binning, view)
        found = projection.image_px(points.reshape(-1, 3))
        return found[0] if points.ndim == 1 else found

    def projection(
        self, at_s: float, roi: RoiLike | None = None, binning: int = 1, view: str = MICROSCOPE
    ) -> Projection:
        """Return how the world is truly seen: scale, sharpness, focus; for tests only."""
        return project(
            self.settings.views[view],
            self.settings.camera,
            zoom=self._zoom(view)(at_s),
            focus=self._focus(view)(at_s),
            area=self._area(roi, binning),
            binning=binning,
            wavelength_um=self.settings.picture.wavelength_um,
            wobble=self._wobble(view, at_s),
        )

    def centre_lines_um(self, at_s: float) -> tuple[Floats, ...]:
        """Return the true middle of each fibre as it is drawn, shape (n, 3); for tests only.

        Those that lie come first.
        """
        subject = self._subjects.at(at_s)
        lying = (each.in_world(subject.plate) for each in subject.lying)
        return tuple(strand.line_um for strand in (*lying, *subject.held))

    # ------------------------------------------------------------------ inside

    def _area(self, roi: RoiLike | None, binning: int) -> Area:
        if roi is None:
            width, height = self.sensor_px
            return Area(0, 0, width // binning, height // binning)
        return Area(roi.x_px, roi.y_px, roi.width_px, roi.height_px)

    def _wobble(self, view: str, at_s: float) -> Wobble:
        each = self.settings.views[view]
        if not (each.lens and (each.zoom_scale or each.zoom_shift_um or each.zoom_focus_um)):
            return STEADY
        # Not by time, which differs each time a program is run: a seed gives the same again.
        chance = random.Random(f"zoom {self._lens.run_number('zoom', at_s)} {self._seed}")
        return Wobble(
            1.0 + each.zoom_scale * chance.gauss(0.0, 1.0),
            each.zoom_shift_um * chance.gauss(0.0, 1.0),
            each.zoom_shift_um * chance.gauss(0.0, 1.0),
            each.zoom_focus_um * chance.gauss(0.0, 1.0),
        )

    def _zoom(self, view: str) -> Callable[[float], float]:
        return self._part("zoom", self._lens.zoom_range_counts, view)

    def _focus(self, view: str) -> Callable[[float], float]:
        return self._part("focus", self._lens.focus_range_counts, view)

    def _part(
        self, axis: LensAxisName, ends: tuple[float, float], view: str
    ) -> Callable[[float], float]:
        if not self.settings.views[view].lens:
            return _at_low_end
        low, high = ends

        def part(at_s: float) -> float:
            return (self._lens.position_counts(axis, at_s) - low) / (high - low)

        return part

    @property
    def _subjects(self) -> "Subjects":
        """What is to be seen, made at the first image."""
        from cosmic.twin.optics.subjects import Subjects

        with self._lock:
            if self._made is None:
                self._made = Subjects(self._twin, self._folder, self._stages, self._force_side)
            return self._made


def _at_low_end(at_s: float) -> float:  # noqa: ARG001
    return 0.0
