"""The test stand: a platform with its window, and traffic that keeps its axes moving."""

import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
os.environ.setdefault("QT_LOGGING_RULES", "qt.qpa.*=false;default.warning=false")

from PySide6.QtCore import QCoreApplication, QEvent, QSettings, QTimer
from PySide6.QtWidgets import QApplication

from benchmarks.traced import TracedLibrary
from cosmic.app.configuration.platform_file import PlatformFile, load_platform, load_twin
from cosmic.app.platform import Platform
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.frame.clock import RatedClock
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.log import RingBufferHandler, set_up_logging
from cosmic.frame.threads import declare_gui_thread
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.axis import Axis
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.motion.manager import DeviceManager
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.positioner import Status
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.gui.mico_widget import make_mico_gui
from cosmic.mico.hw.scu3d import Scu3dController
from cosmic.mico.hw.sim_scu3d import load_simulated_library
from cosmic.twin.scene import Scene
from cosmic.twin.settings import DeviceWiring, StageSettings, TwinSettings

R = TypeVar("R")

REPAINT_MS = 33
STEPS, STEP_HZ = 380, 40  # of jaws, to and fro inside their end stops; nearly 10 s a way


@dataclass
class Stand:
    """A running platform.

    Attributes
    ----------
    mico : Mico
        Commands as a script does.
    library : object
        The library, traced where that was asked.
    """

    app: QApplication
    window: OperatorWindow
    mico: Mico
    library: Any

    @property
    def manager(self) -> DeviceManager:
        """Owner of the devices."""
        return self.mico.application.manager

    def beside(self, work: Callable[[], R]) -> R:
        """Run `work` in a thread of its own while this one runs the window; return its result."""
        results: list[R] = []
        failures: list[BaseException] = []

        def body() -> None:
            try:
                self.wait_until_ready()
                results.append(work())
            except BaseException as exc:  # noqa: BLE001 - raised again below, in the main thread
                failures.append(exc)
            finally:
                self.app.exit()  # `quit` asks the window first, and that asks a person

        thread = threading.Thread(target=body, name="benchmark")
        QTimer.singleShot(0, thread.start)
        self.app.exec()
        thread.join()
        if failures:
            raise failures[0]
        return results[0]

    def wait_until_ready(self) -> None:
        """Wait until every axis is there and stands; in a thread of its own."""
        wait_until(
            lambda: (
                (task := self.mico.application.running_task) is not None
                and task.done
                and all(axis.state is Status.OK for axis in self.mico)
            ),
            timeout_s=20.0,
        )


def wait_until(condition: Callable[[], object], timeout_s: float = 5.0) -> None:
    """Wait for `condition`; raises `TimeoutError`."""
    end_s = time.perf_counter() + timeout_s
    while not condition():
        if time.perf_counter() > end_s:
            raise TimeoutError("what the benchmark waits for did not happen")
        time.sleep(0.002)


def application() -> QApplication:
    """Return the application of this process."""
    existing = QCoreApplication.instance()
    return existing if isinstance(existing, QApplication) else QApplication(["benchmark"])


@contextmanager
def stand(
    *,
    devices: int = 0,
    repaint: bool = True,
    traced: bool = True,
    count_cpu: bool = False,
    seed: int = 1,
) -> Iterator[Stand]:
    """Set up the shipped platform, or one of `devices` devices with three linear axes each.

    Parameters
    ----------
    repaint : bool
        Paint the MiCo panel anew thirty times a second, whether anything changed or not.
    traced : bool
        Have the library tell when it is called.
    """
    app = application()
    file, path = load_platform(None)
    twin = load_twin(file, path)
    if devices:
        file, twin = _enlarged(file, twin, devices)
    clock = RatedClock(1.0)
    library: Any = load_simulated_library(scene=Scene.from_settings(twin, clock, seed=seed))
    if traced or count_cpu:
        library = TracedLibrary(library, count_cpu=count_cpu)
    policy = FailurePolicy()
    mico = MicoApplication(
        Scu3dController(library, simulated=True),
        file.mico,
        clock=clock,
        policy=policy,
        gui_factory=make_mico_gui,
    )
    platform = Platform(file=file, path=path, clock=clock, policy=policy, mico=mico)
    with ExitStack() as at_end:
        folder = Path(at_end.enter_context(tempfile.TemporaryDirectory()))
        ring = RingBufferHandler()
        at_end.callback(set_up_logging(ring, file=folder / "cosmic.log"))
        at_end.callback(declare_gui_thread())
        at_end.callback(platform.shut_down)
        settings = QSettings(str(folder / "window.ini"), QSettings.Format.IniFormat)
        window = OperatorWindow(platform, settings, ring)
        at_end.callback(app.sendPostedEvents, None, QEvent.Type.DeferredDelete.value)
        at_end.callback(window.deleteLater)
        at_end.callback(window.close_now)
        window.show()
        window.resize(1600, 1000)
        api = Mico(mico, "benchmark")
        window.open_hardware()
        if repaint and window.mico_gui is not None:
            timer = QTimer(window, interval=REPAINT_MS)
            timer.timeout.connect(window.mico_gui.update)
            timer.start()
        yield Stand(app, window, api, library)


def _enlarged(
    file: PlatformFile, twin: TwinSettings, devices: int
) -> tuple[PlatformFile, TwinSettings]:
    names = [[f"d{device}.c{channel}" for channel in range(3)] for device in range(devices)]
    positioners = [
        {
            "name": name,
            "device": device,
            "channel": channel,
            "kind": "linear",
            "limits_um": (-5500.0, 5500.0),
        }
        for device, row in enumerate(names)
        for channel, name in enumerate(row)
    ]
    mico = MicoSettings.model_validate({"positioner": positioners})
    wiring = tuple(DeviceWiring(channels=(row[0], row[1], row[2])) for row in names)
    places = {name: StageSettings(kind="linear", start=0.0) for row in names for name in row}
    stages = {**twin.stages, **places}  # the tools of the twin stand on its own ones
    return (
        file.model_copy(update={"mico": mico}),
        twin.model_copy(update={"devices": wiring, "stages": stages}),
    )


class Traffic:
    """Keeps every axis moving to and fro between its limits, until it is ended.

    Parameters
    ----------
    speed_hz : int
        Closed-loop frequency: 5000 Hz is 7.5 mm/s, 400 Hz is 0.6 mm/s.
    """

    def __init__(self, mico: Mico, speed_hz: int = 5000) -> None:
        self._axes = list(mico)
        self._speed_hz = speed_hz
        self._current: dict[str, Movement] = {}
        self._sign: dict[str, int] = {}
        self._running = False
        self._lock = threading.RLock()
        self.failures: list[str] = []

    def start(self) -> None:
        """Start all axes and wait until they move."""
        self._running = True
        for axis in self._axes:
            if axis.limits is not None:
                axis.set_closed_loop_frequency(self._speed_hz)
            self._next(axis)
        wait_until(lambda: self.failures or all(axis.details.in_motion for axis in self._axes))
        if self.failures:
            raise RuntimeError(f"the load does not start: {self.failures[0]}")

    def end(self) -> None:
        """Begin no further movement."""
        self._running = False

    def hand_over(self, axis: Axis) -> None:
        """Leave `axis` to somebody else, until `adopt`."""
        with self._lock:
            self._current.pop(axis.key, None)

    def adopt(self, axis: Axis, movement: Movement) -> None:
        """Go on with `axis` once `movement`, issued by somebody else, has ended."""
        self._current[axis.key] = movement
        movement.add_callback(lambda ended: self._on_ended(axis, ended))

    def _next(self, axis: Axis) -> None:
        sign = self._sign[axis.key] = -self._sign.get(axis.key, -1)
        if axis.limits is None:
            movement = axis.steps(sign * STEPS, frequency_hz=STEP_HZ, wait=False)
        else:
            movement = axis.move_to(0.95 * axis.limits[(sign + 1) // 2], wait=False)
        if not isinstance(movement, Movement):
            raise TypeError("a move that is not waited for returns its movement")
        self.adopt(axis, movement)

    def _on_ended(self, axis: Axis, movement: Movement) -> None:
        with self._lock:
            if not self._running or self._current.get(axis.key) is not movement:
                return
            error = movement.exception()
            if error is not None:  # never again and again, which would be another load
                self.failures.append(f"{axis.key}: {error}")
                return
            self._next(axis)
