"""The simulated cameras of a platform: one for each view of the twin."""

from dataclasses import replace
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import Clock
from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.twin.optics.optics import Optics
from cosmic.twin.scene import Scene
from cosmic.vico.hw.interface import CameraInfo, CameraLibrary
from cosmic.vico.hw.sim_camera import SimulatedCamera
from cosmic.vico.hw.sim_camera_faults import CameraFaults

XCD_U100: Final = CameraInfo(
    key="Sim", vendor="Sony", model="XCD-U100", serial="1806000", simulated=True
)


class SimulatedCameraLibrary(CameraLibrary):
    """Simulated cameras `Sim1` (the microscope), `Sim2` (the overview), ...; any thread.

    Parameters
    ----------
    scene : Scene or Optics
        What they see.
    clock : Clock
        Paces the frames: the platform's.
    seed : int
        Of the faults.

    Attributes
    ----------
    faults : CameraFaults
        Trouble to inject by name.

    Raises
    ------
    ValueError
        The scene is one of bare stages, without optics.
    """

    def __init__(self, scene: Scene | Optics, clock: Clock, seed: int = 0) -> None:
        optics = scene.optics if isinstance(scene, Scene) else scene
        if optics is None:
            raise ValueError("a scene of bare stages has nothing for cameras to see")
        self._optics = optics
        self._clock = clock
        self.faults = CameraFaults(seed)
        self._opened: dict[str, SimulatedCamera] = {}
        self._closed = False
        self._views = {f"Sim{number}": view for number, view in enumerate(optics.views, start=1)}

    @property
    @override
    def name(self) -> str:
        return "Simulated cameras"

    @override
    def cameras(self) -> tuple[CameraInfo, ...]:
        if self._closed:
            raise DeviceError("simulated cameras: closed", fault=DeviceFault.STATE)
        return tuple(
            self._info(key) for key in self._views if not self.faults.hit("unplugged", key)
        )

    @override
    def open(self, key: str) -> SimulatedCamera:
        there = [info.key for info in self.cameras()]
        if key not in there:
            raise NotConnectedError(
                f"there is no simulated camera {key!r}; there are: {', '.join(there) or 'none'}",
                fault=DeviceFault.COMMUNICATION,
            )
        with self.faults.changed:
            if key in self._opened or self.faults.hit("taken", key):
                raise NotConnectedError(
                    f"{key}: another program has the camera; close it there, then try again "
                    f"(there are: {', '.join(there)})",
                    fault=DeviceFault.BUSY,
                )
            camera = SimulatedCamera(
                self._info(key),
                self._optics,
                self._views[key],
                self._clock,
                self.faults,
                released=lambda: self._release(key),
            )
            self._opened[key] = camera
        return camera

    @override
    def close(self) -> None:
        for camera in tuple(self._opened.values()):
            camera.close()
        self._closed = True

    def _release(self, key: str) -> None:
        with self.faults.changed:
            self._opened.pop(key, None)

    def _info(self, key: str) -> CameraInfo:
        return replace(
            XCD_U100,
            key=key,
            serial=f"{XCD_U100.serial}{key.removeprefix('Sim')}",
            sensor_px=self._optics.sensor_px,
        )
