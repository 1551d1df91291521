"""An application that is not there: does what its widgets ask and remembers it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from cosmic.frame.clock import WALL
from cosmic.frame.errors import ConfigError, CosmicError
from cosmic.frame.operation import Operation, Task
from cosmic.vico.api.coordinate_transform import CalibrationShown, RotationShown
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.core.measuring.corrections import Corrections
from cosmic.vico.core.vision.tool_tips import HeldSeen
from cosmic.vico.hw.interface import (
    CameraCounters,
    CameraInfo,
    CameraRanges,
    CameraSettings,
    Frame,
    FrameStatus,
    PixelFormat,
    Range,
    Roi,
    Trigger,
)
from cosmic.vico.hw.peripherals import LensAxis, LensState

WIDTH, HEIGHT = 1600, 1200
INFO = CameraInfo("sim-1", "CoSMic", "Twin", "0001", simulated=True, sensor_px=(WIDTH, HEIGHT))
SETTINGS = CameraSettings(exposure_s=0.01, gain_db=0.0, rate_hz=30.0, roi=Roi(0, 0, WIDTH, HEIGHT))
RANGES = CameraRanges(
    exposure_s=Range(1e-5, 1.0),
    gain_db=Range(0.0, 24.0),
    rate_hz=Range(1.0, 60.0),
    width_px=Range(16, WIDTH, 8),
    height_px=Range(16, HEIGHT, 8),
    binnings=(1, 2, 4),
    pixel_formats=(PixelFormat.MONO8, PixelFormat.MONO12, PixelFormat.RGB8),
    triggers=tuple(Trigger),
)


def centre_line(width: int = WIDTH, height: int = HEIGHT) -> np.ndarray:
    """Return a curved line across the image."""
    along = np.linspace(0.0, 1.0, 300)
    x = width * (0.2 + 0.6 * along)
    y = height * (0.5 + 0.18 * np.sin(5.0 * along) - 0.1 * along)
    return np.column_stack([x, y])


def fibre_image(width: int = WIDTH, height: int = HEIGHT, seed: int = 0) -> np.ndarray:
    """Return a bright ground with a dark fibre, a saturated spot and a black one."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[0:height, 0:width]
    ground = 165.0 - 40.0 * ((x / width - 0.45) ** 2 + (y / height - 0.5) ** 2)
    line = centre_line(width, height)
    middle = np.interp(x[0], line[:, 0], line[:, 1])
    off = np.abs(y - middle[None, :])
    inside = (x > line[0, 0]) & (x < line[-1, 0])
    ground -= 75.0 * np.exp(-((off / 7.0) ** 4)) * inside
    ground += rng.normal(0.0, 2.5, ground.shape)
    ground[height // 10 : height // 10 + height // 20, : width // 16] = 300.0
    ground[-height // 20 :, : width // 16] = 0.0
    return np.clip(ground, 0, 255).astype(np.uint8)


@dataclass(frozen=True)
class Seen:
    centre_line_px: np.ndarray = field(default_factory=centre_line)
    ends_px: np.ndarray = field(default_factory=lambda: centre_line()[[0, -1]])
    length_px: float = 1034.2
    width_px: float = 13.1
    curl: float = 0.074
    certain: bool = True
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True)
class SeenTip:
    name: str = "left"
    point_px: tuple[float, float] = (300.0, 250.0)
    certain: bool = True


@dataclass(frozen=True)
class Found:
    image: CameraImage
    fibres: tuple[Seen, ...] = ()
    tips: tuple[SeenTip, ...] = ()
    held: tuple[HeldSeen, ...] = ()


@dataclass(frozen=True)
class Link:
    name: str = "find fibres"
    description: str = "Centre lines, ends and measures of the fibres in the image"
    on: bool = False
    problem: str = ""
    failing: bool = False


@dataclass(frozen=True)
class Format:
    name: str = "FFV1 (lossless)"
    suffix: str = ".mkv"
    description: str = "Bit-exact, half the size"
    problem: str = ""


FORMATS = (
    Format(),
    Format("HuffYUV (fast, lossless)", ".avi", "Bit-exact, above 30 frames/s"),
    Format("H.264 (small)", ".mp4", "Not bit-exact", "the codec is missing"),
    Format("TIFF images", "", "A folder with one file a frame"),
)


@dataclass(frozen=True)
class Recorded:
    active: bool = False
    path: Path | None = None
    written: int = 0
    dropped: int = 0
    waiting: int = 0
    size_bytes: int = 0
    left_s: float | None = None
    failure: str = ""


class FakeCamera:
    """Has what a `CameraHandle` has; tests push images and set what it is to answer."""

    def __init__(self, port: "FakeVico", name: str, directory: Path) -> None:
        self._port, self.name, self.directory = port, name, directory
        self.remote = self.refused = ""
        self.clock = WALL
        self.info: CameraInfo | None = INFO
        self.ranges: CameraRanges | None = RANGES
        self.settings: CameraSettings | None = SETTINGS
        self.counters = CameraCounters()
        self.running = True
        self.problem = ""
        self.focus: float | None = None
        self.has_background = False
        self.algorithms: tuple[Link, ...] = (Link(), Link("track tips", "Where the grippers are"))
        self.analysis: Found | None = None
        self.formats: Sequence[Format] = FORMATS
        self.recording = Recorded()
        self.calibration_problem = "not calibrated at this zoom: run the calibration"
        self.scale_um_px: float | None = 1.25
        self.calibrated: tuple[CalibrationShown, ...] = ()
        self.rotation: RotationShown | None = None
        self.targets: tuple[str, ...] = ("left gripper", "right gripper")
        self.refuse = ""
        self.refuse_later = ""
        self.task: Task | None = None
        self.calls: list[tuple[object, ...]] = []
        self._latest: CameraImage | None = None
        self._next_id = 0

    # images

    def push(
        self,
        data: np.ndarray | None = None,
        *,
        status: FrameStatus = FrameStatus.COMPLETE,
        pixel_format: PixelFormat = PixelFormat.MONO8,
    ) -> CameraImage:
        """Take an image."""
        if data is None:
            data = np.full((HEIGHT, WIDTH), 100, np.uint8)
        now_s = self._next_id / 30.0
        shot = Frame(data, self._next_id, now_s, now_s, status=status, pixel_format=pixel_format)
        self._next_id += 1
        return self.show_frame(shot)

    def show_frame(self, shot: Frame) -> CameraImage:
        """Have a frame as the newest."""
        self._latest = CameraImage(self.name, shot, Circumstances(scale_um_px=self.scale_um_px))
        self.counters = replace(self.counters, completed=self.counters.completed + 1)
        return self._latest

    def latest(self) -> CameraImage | None:
        return self._latest

    def change(self, **changes: object) -> None:
        for name, value in changes.items():
            setattr(self, name, value)
        self._port.publish()

    def _do(self, *call: object) -> None:
        if self.refuse:
            raise CosmicError(self.refuse)
        self.calls.append(call)

    def _began(self, title: str, *call: object) -> Task:
        self._do(*call)
        self.task = Task(title)
        return self.task

    def corrections(self, image: CameraImage) -> Operation[Corrections]:
        """Fail, or end at once with one fibre."""
        operation: Operation[Corrections] = Operation("fibres")
        if self.refuse:
            operation.fail(CosmicError(self.refuse))
        else:
            corrections = Corrections(image.data)
            corrections.add([(100.0, 100.0), (400.0, 100.0)], 10.0)
            operation.finish(corrections)
        return operation

    # commands

    def configure(self, settings: CameraSettings) -> Task:
        task = self._began("Settings", "configure", settings)
        if self.refuse_later:
            task.fail(ConfigError(self.refuse_later))
        else:
            self.settings = settings
            task.finish()
            self._port.publish()
        return task

    def start(self) -> None:
        self._do("start")
        self.change(running=True)

    def stop(self) -> None:
        self._do("stop")
        self.change(running=False)

    def software_trigger(self) -> None:
        self._do("trigger")

    def set_background(self) -> None:
        self._do("set background")
        self.change(has_background=True)

    def clear_background(self) -> None:
        self._do("clear background")
        self.change(has_background=False)

    def switch(self, algorithm: str, *, on: bool) -> None:
        self._do("switch", algorithm, on)
        chain = [replace(x, on=on) if x.name == algorithm else x for x in self.algorithms]
        self.change(algorithms=tuple(chain))

    # files

    def room_s(self, directory: Path, format_name: str) -> float | None:
        if not directory.is_dir():
            raise ConfigError(f"{directory}: there is no such directory")
        return 7200.0

    def snap(self, path: Path, *, overwrite: bool = False) -> Task:
        return self._began(f"Snap {path.name}", "snap", path, overwrite)

    def record(self, path: Path, format_name: str, *, overwrite: bool = False) -> None:
        self._do("record", path, format_name, overwrite)
        self.change(recording=Recorded(active=True, path=path))

    def stop_recording(self) -> None:
        self._do("stop recording")
        self.change(recording=replace(self.recording, active=False))

    def time_lapse(
        self,
        path: Path,
        format_name: str,
        *,
        interval_s: float,
        count: int,
        overwrite: bool = False,
    ) -> Task:
        return self._began("Time-lapse", "lapse", path, format_name, interval_s, count, overwrite)

    # places

    def platform_um(self, point_px: tuple[float, float]) -> tuple[float, ...] | None:
        if self.calibration_problem:
            return None
        return (point_px[0] * 1.25 - 1000.0, point_px[1] * 1.25 - 750.0)

    def calibrate_stage(self, tool: str) -> Task:
        return self._began("Calibrating", "calibrate_stage", tool)

    def find_rotation_centre(self) -> Task:
        return self._began("Rotation centre", "find_rotation_centre")

    def click_to_move(self, point_px: tuple[float, float], what: str) -> str:
        self._do("move", point_px, what)
        return f"{what} goes there"


@dataclass(frozen=True)
class Step:
    name: str
    zoom: float


class FakeLens:
    """Follows `LensPort`."""

    name = "Navitar, generation 1"
    steps = tuple(Step(f"{zoom:g}x", zoom) for zoom in (0.7, 1.0, 2.0, 4.5))
    zoom_range = (0.7, 4.5)

    def __init__(self) -> None:
        self.problem = ""
        self.zoom: float | None = 2.0
        self.states: dict[LensAxis, LensState | None] = {
            axis: LensState(500, 2000, moving=False, homed=True) for axis in LensAxis
        }
        self.calls: list[tuple[object, ...]] = []
        self.task: Task | None = None
        self.refuse = ""

    def state(self, axis: LensAxis) -> LensState | None:
        return self.states[axis]

    def _began(self, title: str, *call: object) -> Task:
        if self.refuse:
            raise CosmicError(self.refuse)
        self.calls.append(call)
        self.task = Task(title)
        return self.task

    def home(self) -> Task:
        return self._began("Home the lens", "home")

    def zoom_to(self, zoom: float) -> Task:
        return self._began("Zoom", "zoom", zoom)

    def seek_focus(self, target_counts: int) -> Task:
        return self._began("Focus", "focus", target_counts)

    def autofocus(self, camera: str) -> Task:
        return self._began("Autofocus", "autofocus", camera)

    def abort(self) -> None:
        self.calls.append(("abort",))


class FakeLight:
    """Follows `LightPort`."""

    name = "BrightLight"

    def __init__(self) -> None:
        self.problem = ""
        self.percent: float | None = 40.0
        self.calls: list[float] = []

    def set_percent(self, percent: float) -> None:
        self.calls.append(percent)
        self.percent = percent


class FakeVico:
    """Follows `VicoPort`."""

    def __init__(self, directory: Path = Path(), cameras: Sequence[str] = ("top",)) -> None:
        self._listeners: list[Callable[[], object]] = []
        self._cameras = {name: FakeCamera(self, name, directory) for name in cameras}
        self.found: tuple[CameraInfo, ...] = (INFO, replace(INFO, key="gev-2", model="Manta"))
        self.lens: FakeLens | None = FakeLens()
        self.light: FakeLight | None = FakeLight()
        self.calls: list[tuple[object, ...]] = []
        self.task: Task | None = None

    @property
    def cameras(self) -> tuple[str, ...]:
        return tuple(self._cameras)

    def camera(self, name: str) -> FakeCamera:
        return self._cameras[name]

    def rescan(self) -> Task:
        self.calls.append(("rescan",))
        self.task = Task("Look for cameras")
        return self.task

    def use(self, camera: str, key: str) -> Task:
        self.calls.append(("use", camera, key))
        self.task = Task(f"Open {key}")
        return self.task

    def on_change(self, listener: Callable[[], object]) -> Callable[[], None]:
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    @property
    def listened(self) -> int:
        return len(self._listeners)

    def publish(self) -> None:
        for listener in list(self._listeners):
            listener()
