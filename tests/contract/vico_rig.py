"""ViCo at home, and from another station over either transport, with frames that tests push."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from threading import Condition

import numpy as np
from typing_extensions import override

from contract.peripheral_rig import PeripheralRig
from contract.station_rig import connected, free_port, listening, wait_until
from cosmic.frame.clock import Clock, RatedClock
from cosmic.frame.errors import ConfigError, NotAvailable, NotConnectedError
from cosmic.frame.failure import Failure, FailurePolicy
from cosmic.frame.network.application import RemoteApplication
from cosmic.frame.network.host import Host
from cosmic.frame.network.line_settings import Line
from cosmic.frame.network.station import Station
from cosmic.frame.network.transport import Transport
from cosmic.frame.operation import Task
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.coordinate_transform import (
    CalibrationShown,
    CoordinateTransform,
    Pixel,
    RotationShown,
)
from cosmic.vico.api.vico import Vico
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.settings import (
    CameraConfig,
    LampSettings,
    MotorLensSettings,
    VicoSettings,
    ZoomStepSettings,
)
from cosmic.vico.hw.factory import make_lens, make_light
from cosmic.vico.hw.interface import (
    Camera,
    CameraCounters,
    CameraInfo,
    CameraLibrary,
    CameraRanges,
    CameraSettings,
    Frame,
    PixelFormat,
    Pixels,
    Range,
    Roi,
    Trigger,
)
from cosmic.vico.hw.sim_camera import DrawnFrame
from cosmic.vico.hw.sim_peripherals import SimPeripherals

LIMIT_S = 30.0


def soon(condition: Callable[[], object]) -> bool:
    """Wait until `condition` holds, however busy the computer is; False when it never did."""
    return wait_until(condition, LIMIT_S)


RANGES = CameraRanges(
    exposure_s=Range(1e-4, 0.05),
    gain_db=Range(0.0, 20.0),
    rate_hz=Range(1.0, 100.0),
    width_px=Range(8, 64, 4),
    height_px=Range(8, 48, 4),
    binnings=(1, 2),
    triggers=(Trigger.FREE_RUN, Trigger.SOFTWARE),
)


class PushedCamera(Camera):
    """A camera whose frames come when the test says so; with the software trigger each gives one.

    `given` counts the frames, `drawn` those that were looked at.
    """

    def __init__(self, clock: Clock, size_px: tuple[int, int]) -> None:
        self._clock = clock
        self._there = Condition()
        self._waiting: deque[Frame] = deque()
        self.given = 0
        self._info = CameraInfo("P1", "Test", "Pushed", "7", simulated=True, sensor_px=size_px)
        self._settings = CameraSettings(0.01, 0.0, 30.0, Roi(0, 0, *size_px))
        self.plugged = True
        self.drawn = 0

    def push(self, *images: Pixels) -> None:
        """Give frames, exposed now."""
        with self._there:
            for data in images:
                data.flags.writeable = False
                now_s = self._clock.now_s()
                fmt = PixelFormat.MONO8 if data.dtype == np.uint8 else PixelFormat.MONO16
                frame = DrawnFrame(
                    self._drawing(data),
                    self.given,
                    now_s,
                    now_s,
                    pixel_format=fmt,
                    size_px=data.shape[1::-1],
                )
                self._waiting.append(frame)
                self.given += 1
            self._there.notify_all()

    def keep_coming(self, data: Pixels) -> None:
        """Give a frame where the one before was taken."""
        if not self._waiting:
            self.push(data)

    def _drawing(self, data: Pixels) -> Callable[[], Pixels]:
        def draw() -> Pixels:
            self.drawn += 1
            return data

        return draw

    def grey(self, level: int) -> Pixels:
        """Return an even image of its size."""
        roi = self._settings.roi
        return np.full((roi.height_px, roi.width_px), level, np.uint8)

    @property
    @override
    def info(self) -> CameraInfo:
        return self._info

    @property
    @override
    def ranges(self) -> CameraRanges:
        return RANGES

    @property
    @override
    def settings(self) -> CameraSettings:
        return self._settings

    @property
    @override
    def counters(self) -> CameraCounters:
        return CameraCounters(completed=self.given)

    @override
    def configure(self, settings: CameraSettings) -> CameraSettings:
        if not 1e-4 <= settings.exposure_s <= 0.05:
            raise ConfigError(f"P1: exposure {settings.exposure_s:g} s; from 0.0001 to 0.05 s")
        self._settings = settings
        return settings

    @override
    def start(self) -> None: ...

    @override
    def receive(self, timeout_s: float) -> Frame | None:
        with self._there:
            self._there.wait_for(lambda: self._waiting or not self.plugged, timeout_s)
            if not self.plugged:
                raise NotConnectedError("P1: the camera is gone")
            return self._waiting.popleft() if self._waiting else None

    @override
    def trigger(self) -> None:
        if self._settings.trigger is not Trigger.SOFTWARE:
            raise NotAvailable("P1: trigger: free run is in force")
        self.push(self.grey(77))

    @override
    def stop(self) -> None: ...

    @override
    def close(self) -> None: ...


class PushedLibrary(CameraLibrary):
    """The driver of that one camera."""

    def __init__(self, camera: PushedCamera) -> None:
        self._camera = camera

    @property
    @override
    def name(self) -> str:
        return "pushed"

    @override
    def cameras(self) -> tuple[CameraInfo, ...]:
        return (self._camera.info,)

    @override
    def open(self, key: str) -> Camera:
        if not self._camera.plugged:
            raise NotConnectedError("P1: the camera is gone")
        return self._camera

    @override
    def close(self) -> None: ...


class FlatPlaces(CoordinateTransform):
    """A plate that is seen at 2 um a pixel, turned by a quarter; remembers what was to move."""

    def __init__(self) -> None:
        self.moved: list[tuple[Pixel, str]] = []
        self.shift_um = 100.0

    @override
    def scale_um_px(self, camera: str, zoom_counts: float | None) -> float | None:
        return 2.0

    @override
    def problem(self, image: CameraImage) -> str:
        return ""

    @override
    def platform_um(self, image: CameraImage, point_px: Pixel) -> tuple[float, float]:
        x, y = point_px
        return self.shift_um - 2.0 * y, 50.0 + 2.0 * x

    @property
    @override
    def targets(self) -> Sequence[str]:
        return ("left", "right")

    @override
    def move_to(self, image: CameraImage, point_px: Pixel, what: str) -> str:
        if what not in self.targets:
            raise ConfigError(f"there is no tool {what!r}")
        self.moved.append((point_px, what))
        return f"{what} moves"

    @override
    def calibrate_stage(self, tool: str, camera: str) -> Task:
        task = Task(f"Calibrating {camera} by {tool}")
        task.finish()
        return task

    @override
    def find_rotation_centre(self, camera: str) -> Task:
        raise NotAvailable("no axis turns the plate; name it as vico.table_axis")

    @property
    @override
    def calibrated(self) -> Sequence[CalibrationShown]:
        when = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)
        return (CalibrationShown("top", "left", 100.0, 50.0, 2.0, 0.3, when),)

    @override
    def rotation_centre(self, camera: str) -> RotationShown | None:
        return None


@dataclass
class Home:
    """The application that has the camera."""

    application: VicoApplication
    camera: PushedCamera
    places: FlatPlaces
    policy: FailurePolicy
    failures: list[Failure] = field(default_factory=list)


@dataclass
class VicoRig:
    """`vico` is what is tested; `remote` and `client` are None at home."""

    home: Home
    vico: Vico
    station: Station
    remote: RemoteApplication[Vico] | None = None
    client: Transport | None = None


def settings(folder: Path) -> VicoSettings:
    """Return a camera "top" behind a lens of three steps, and a lamp."""
    steps = tuple(
        ZoomStepSettings(name=f"{zoom:g}x", counts=counts, zoom=zoom, scale_um_px=4.4 / zoom)
        for counts, zoom in ((0, 0.5), (3000, 1.0), (6000, 2.0))
    )
    return VicoSettings(
        directory=str(folder),
        camera=(CameraConfig(name="top", title="From above", behind_lens=True, algorithms=()),),
        lens=MotorLensSettings(backend="simulated", homed=True, step=steps),
        light=LampSettings(backend="simulated"),
    )


@contextmanager
def used_locally(
    folder: Path, size_px: tuple[int, int] = (64, 48), rate: float = 20.0
) -> Iterator[Home]:
    """Run ViCo in this process, its lens `rate` times as fast as a real one."""
    clock, policy, twin = RatedClock(rate), FailurePolicy(), PeripheralRig()
    camera, simulation = PushedCamera(clock, size_px), SimPeripherals(twin.lens, twin.light, clock)
    application = VicoApplication(
        lambda _: PushedLibrary(camera),
        lambda: make_lens("simulated", simulation=simulation),
        lambda: make_light("simulated", simulation=simulation),
        settings(folder),
        clock=clock,
        policy=policy,
    )
    places = FlatPlaces()
    application.transform = places
    home = Home(application, camera, places, policy)
    policy.subscribe(home.failures.append)
    application.initialize()
    try:
        unit, peripherals = application.unit("top"), application.peripherals
        assert soon(lambda: unit.thread.running and peripherals.state.light_percent)
        yield home
    finally:
        application.shut_down()


@contextmanager
def hosted(home: Home, endpoint: str = "") -> Iterator[Station]:
    """Offer it on a station, which listens at `endpoint` if one is given."""
    station, side = Station("fibres", home.policy), Host("vico", Vico(home.application))
    station.host("vico", side)
    with ExitStack() as stack:
        stack.callback(side.close)
        if endpoint:
            stack.enter_context(listening(station, Line(endpoint, listens=True, station="fibres")))
        yield station


@contextmanager
def following(transport: Transport, policy: FailurePolicy) -> Iterator[RemoteApplication[Vico]]:
    """Mirror the ViCo of a station."""
    remote = RemoteApplication("ViCo", Vico, transport, policy, name="vico")
    try:
        remote.initialize()
        assert soon(lambda: remote.api.cameras), remote.api.away
        yield remote
    finally:
        remote.shut_down()


@contextmanager
def vico_rig(
    where: str, folder: Path, size_px: tuple[int, int] = (64, 48), rate: float = 20.0
) -> Iterator[VicoRig]:
    """Yield ViCo as it is used at "home" or over a "station"."""
    with ExitStack() as stack:
        home = stack.enter_context(used_locally(folder, size_px, rate))
        endpoint = f"tcp/127.0.0.1:{free_port()}" if where != "home" else ""
        station = stack.enter_context(hosted(home, endpoint))
        if where == "home":
            yield VicoRig(home, Vico(home.application), station)
            return
        client = stack.enter_context(connected(endpoint))
        remote = stack.enter_context(following(client, home.policy))
        yield VicoRig(home, remote.api, station, remote, client)


def with_exposure(now: CameraSettings | None, exposure_s: float) -> CameraSettings:
    """Return settings with another exposure."""
    assert now is not None
    return replace(now, exposure_s=exposure_s)
