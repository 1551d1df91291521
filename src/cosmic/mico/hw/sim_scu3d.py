"""A simulated SmarAct SCU3DControl library: the C interface of the real one over the twin.

`load_simulated_library` returns an object whose `SA_...` attributes are C function pointers with
the library's own prototypes. The ctypes layer, or any C client, can be pointed at it.
"""

import logging
from typing import Any, Final

from cosmic.frame.clock import Clock, RatedClock
from cosmic.mico.hw.scu3d_ctypes import (
    FUNCTIONS_V12,
    PROTOTYPES,
    SA_ASYNCHRONOUS_COMMUNICATION,
    SA_COMMAND_OVERRIDDEN_ERROR,
    SA_DEVICE_ALREADY_ADDED_ERROR,
    SA_DEVICE_NOT_FOUND_ERROR,
    SA_HARDWARE_RESET,
    SA_ID_LIST_TOO_SMALL_ERROR,
    SA_INVALID_DEVICE_INDEX_ERROR,
    SA_INVALID_PARAMETER_ERROR,
    SA_NO_DEVICES_FOUND_ERROR,
    SA_NOT_INITIALIZED_ERROR,
    SA_OK,
    SA_OTHER_ERROR,
    SA_WRONG_MODE_ERROR,
)
from cosmic.mico.hw.sim_device import LibraryLock
from cosmic.mico.hw.sim_faults import Faults
from cosmic.mico.hw.sim_scu3d_calls import Body, c_function, section_two
from cosmic.mico.hw.sim_scu3d_device import Device
from cosmic.mico.hw.sim_scu3d_types import Refusal
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings

logger = logging.getLogger(__name__)

DEFAULT_LAYOUT: Final = "LLL,LLL,LLN,RNN"


def load_simulated_library(
    layout: str = DEFAULT_LAYOUT,
    rate: float = 1.0,
    seed: int = 0,
    clock: Clock | None = None,
    scene: Scene | None = None,
    *,
    version: str | None = None,
) -> "SimulatedLibrary":
    """Return a library that drives simulated stages.

    Parameters
    ----------
    layout : str
        One group of three channels a device: L linear with sensor, R rotary with sensor, N no
        sensor. Without a scene only; the devices are then just switched on for the first time.
    rate : float
        Simulated seconds a second, when neither clock nor scene is given.
    seed : int
        Of all randomness, when no scene is given.
    clock : Clock, optional
        The time, when no scene is given.
    scene : Scene, optional
        What the library drives; its wiring is the layout and its clock the time.
    version : str, optional
        "1.2.0" hides what the library of 2010 lacks; the rest as the settings say.

    Raises
    ------
    ValueError
        The layout, the rate or the version cannot be.
    """
    if scene is None:
        time = RatedClock(rate) if clock is None else clock
        scene = Scene.from_layout(layout, shipped_settings(), time, seed)
    return SimulatedLibrary(scene, version or scene.settings.controller.library_version)


def _packed(version: str) -> int:
    """Return a version as the library tells it: major 8 bit, minor 8, update 16."""
    major, minor, update = (int(part) for part in version.split("."))
    return major << 24 | minor << 16 | update


class SimulatedLibrary:
    """The library: 77 (or 63) function pointers, the devices behind them, and their faults.

    Any thread may call any function. As with a real library, keep it while somebody holds the
    address of one of its functions.

    Attributes
    ----------
    scene : Scene
        What it drives.
    faults : Faults
        Trouble, by name.
    in_python : bool
        Callers in Python may keep the interpreter during a call.
    """

    in_python: Final = True

    def __init__(self, scene: Scene, version: str) -> None:
        old = version.startswith("1.2.")
        names = FUNCTIONS_V12 if old else PROTOTYPES.keys()
        newest_error = SA_COMMAND_OVERRIDDEN_ERROR if old else SA_OTHER_ERROR
        self._version = _packed(version)
        self.scene = scene
        self.clock = scene.clock
        self.faults = Faults(scene.clock)
        self._lock = LibraryLock()
        self._wired = [
            Device(number, scene, self.faults, self._lock, newest_error=newest_error)
            for number in scene.devices_of("scu3d")
        ]
        for device in self._wired:
            self.faults.wire(device, self._lock)
        self._to_open: list[int] = []
        self._opened: list[Device] = []
        self._asynchronous = False
        self._session = 0
        bodies = self._section_one() | section_two(self)
        # The attributes keep the pointers, and with them everything behind, alive.
        self._functions = {name: c_function(name, bodies[name]) for name in sorted(names)}
        self.__dict__.update(self._functions)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"the simulated SCU3DControl has no function {name!r}")

    def __getitem__(self, name: str) -> Any:
        return getattr(self, name)

    # For section II

    def device(self, index: int, *, asynchronous: bool) -> Device:
        """Return the device at `index`, or refuse as the library does before any command."""
        opened = self._opened
        if not opened:
            raise Refusal(SA_NOT_INITIALIZED_ERROR)
        if asynchronous is not self._asynchronous:
            raise Refusal(SA_WRONG_MODE_ERROR)
        if index >= len(opened):
            raise Refusal(SA_INVALID_DEVICE_INDEX_ERROR)
        return opened[index]

    def serial_number(self) -> int:
        """Return a number that changes with every initialisation and release."""
        return self._session

    # Section I

    def _section_one(self) -> dict[str, Body]:
        return {
            "SA_GetDLLVersion": self._get_dll_version,
            "SA_GetAvailableDevices": self._get_available_devices,
            "SA_AddDeviceToInitDevicesList": self._add_device,
            "SA_ClearInitDevicesList": self._clear_list,
            "SA_InitDevices": self._init_devices,
            "SA_ReleaseDevices": self._release_devices,
            "SA_GetNumberOfDevices": self._get_number_of_devices,
            "SA_GetDeviceID": self._get_device_id,
            "SA_GetDeviceFirmwareVersion": self._get_firmware_version,
        }

    def _get_dll_version(self, version: Any) -> int:
        if not version:
            return SA_INVALID_PARAMETER_ERROR
        version[0] = self._version
        return SA_OK

    def _get_available_devices(self, ids: Any, size: Any) -> int:
        if not size:
            return SA_INVALID_PARAMETER_ERROR
        serials = [device.serial for device in self._wired if not device.unplugged]
        if size[0] < len(serials):
            return SA_ID_LIST_TOO_SMALL_ERROR
        if not ids and serials:
            return SA_INVALID_PARAMETER_ERROR
        for index, serial in enumerate(serials):
            ids[index] = serial
        size[0] = len(serials)
        return SA_OK

    def _add_device(self, serial: int) -> int:
        with self._lock:
            if serial in self._to_open:
                return SA_DEVICE_ALREADY_ADDED_ERROR
            self._to_open.append(serial)
        return SA_OK

    def _clear_list(self) -> int:
        with self._lock:
            self._to_open.clear()
        return SA_OK

    def _init_devices(self, configuration: int) -> int:
        if configuration > (SA_ASYNCHRONOUS_COMMUNICATION | SA_HARDWARE_RESET):
            return SA_INVALID_PARAMETER_ERROR
        asynchronous = bool(configuration & SA_ASYNCHRONOUS_COMMUNICATION)
        reset = bool(configuration & SA_HARDWARE_RESET)
        with self._lock:
            self._release()
            present = {device.serial: device for device in self._wired if not device.unplugged}
            if not present:
                return SA_NO_DEVICES_FOUND_ERROR
            serials = list(self._to_open or present)
            if any(serial not in present for serial in serials):
                return SA_DEVICE_NOT_FOUND_ERROR
            now_s = self.clock.now_s()
            for serial in serials:
                present[serial].open(asynchronous=asynchronous, reset=reset, now_s=now_s)
            self._asynchronous = asynchronous
            self._opened = [present[serial] for serial in serials]
            self._session += 1
        logger.info("simulated SCU3DControl: %d devices opened", len(serials))
        return SA_OK

    def _release_devices(self) -> int:
        with self._lock:
            if not self._opened:
                return SA_NOT_INITIALIZED_ERROR
            self._release()
        return SA_OK

    def _release(self) -> None:
        opened, self._opened = self._opened, []
        self._session += 1
        for device in opened:
            device.close()

    def _get_number_of_devices(self, number: Any) -> int:
        opened = self._opened
        if not opened:
            return SA_NOT_INITIALIZED_ERROR
        if not number:
            return SA_INVALID_PARAMETER_ERROR
        number[0] = len(opened)
        return SA_OK

    def _get_device_id(self, index: int, serial: Any) -> int:
        device = self.device(index, asynchronous=self._asynchronous)
        if not serial:
            return SA_INVALID_PARAMETER_ERROR
        serial[0] = device.serial
        return SA_OK

    def _get_firmware_version(self, index: int, version: Any) -> int:
        device = self.device(index, asynchronous=self._asynchronous)
        if not version:
            return SA_INVALID_PARAMETER_ERROR
        version[0] = _packed(device.settings.firmware_version)
        return SA_OK
