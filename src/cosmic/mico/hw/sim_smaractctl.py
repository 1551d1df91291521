"""A simulated SmarActCTL library: the C interface of the MCS2's real one over the twin.

`load_simulated_library` returns an object whose `SA_CTL_...` attributes are C function pointers
with the library's own prototypes. The ctypes layer, or any C client, can be pointed at it.
"""

import ctypes
import logging
from collections.abc import Callable
from typing import Any, Final

from cosmic.frame.clock import Clock, RatedClock
from cosmic.mico.hw import smaractctl_ctypes as sa
from cosmic.mico.hw.sim_device import LibraryLock
from cosmic.mico.hw.sim_faults import Faults
from cosmic.mico.hw.sim_smaractctl_calls import device_functions, text_out
from cosmic.mico.hw.sim_smaractctl_device import Device
from cosmic.mico.hw.sim_smaractctl_types import Refused
from cosmic.mico.hw.smaractctl_errors import RESULTS
from cosmic.twin.scene import Scene
from cosmic.twin.settings import TwinSettings, shipped_settings

logger = logging.getLogger(__name__)

DEFAULT_LAYOUT: Final = "LLL,LLL,LLN,RNN"
MOST_CHANNELS: Final = 18
VERSION: Final = "1.4.3.134888"
MAKE: Final = "smaractctl"
_FIRST_SERIAL: Final = 412
# What an SCU calls a linear and a rotary stage with one mark: SL...S1SS and SR...S1S5S here.
_MARKED: Final = {"linear": 21, "rotary": 19}
_EVENTS: Final = {
    value: name.removeprefix("SA_CTL_EVENT_")
    for name, value in vars(sa).items()
    if name.startswith("SA_CTL_EVENT_")
}


def load_simulated_library(
    layout: str = DEFAULT_LAYOUT,
    rate: float = 1.0,
    seed: int = 0,
    clock: Clock | None = None,
    scene: Scene | None = None,
) -> "SimulatedLibrary":
    """Return a library that drives simulated stages.

    Parameters
    ----------
    layout : str
        One group of up to 18 letters a device: L linear with sensor, R rotary with sensor, N no
        sensor. Without a scene only; the devices are then just switched on for the first time.
    rate : float
        Simulated seconds a second, when neither clock nor scene is given.
    seed : int
        Of all randomness, when no scene is given.
    clock : Clock, optional
        The time, when no scene is given.
    scene : Scene, optional
        What the library drives: the devices of this make, or all of a scene that has none.

    Raises
    ------
    ValueError
        The layout or the rate cannot be.
    """
    if scene is None:
        time = RatedClock(rate) if clock is None else clock
        scene = Scene.from_layout(
            layout, _with_marks(shipped_settings()), time, seed, channels=(1, MOST_CHANNELS)
        )
    return SimulatedLibrary(scene)


def _with_marks(settings: TwinSettings) -> TwinSettings:
    """Return settings whose stages are referenced at a mark instead of an end stop."""
    kinds = {
        name: kind.model_copy(update={"positioner_type": _MARKED[name]} if name in _MARKED else {})
        for name, kind in settings.kinds.items()
    }
    return settings.model_copy(update={"kinds": kinds})


class SimulatedLibrary:
    """The library: its function pointers, the devices behind them, and their faults.

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

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.clock = scene.clock
        self.faults = Faults(scene.clock)
        self._lock = LibraryLock()
        self._wired = [
            Device(number, f"MCS2-{_FIRST_SERIAL + number:08d}", scene, self.faults, self._lock)
            for number in scene.devices_of(MAKE)
        ]
        for device in self._wired:
            self.faults.wire(device, self._lock)
        self._handles: dict[int, Device] = {}
        self._next_handle = 1
        self._texts: dict[str, ctypes.Array[ctypes.c_char]] = {}
        bodies = self._own_functions() | device_functions(self)
        # The attributes keep the pointers, and with them everything behind, alive.
        self._functions = {name: self._c_function(name, bodies[name]) for name in sa.PROTOTYPES}
        self.__dict__.update(self._functions)

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"the simulated SmarActCTL has no function {name!r}")

    def __getitem__(self, name: str) -> Any:
        return getattr(self, name)

    def device(self, handle: int) -> Device:
        """Return the device with that handle; raises `Refused`."""
        device = self._handles.get(handle)
        if device is None:
            raise Refused(sa.SA_CTL_ERROR_INVALID_DEVICE_HANDLE)
        return device

    @staticmethod
    def _c_function(name: str, body: Callable[..., int]) -> Any:
        """Return `body` as the C function `name`; no exception ever gets into C."""

        def call(*args: Any) -> int:
            try:
                return body(*args)
            except Refused as refused:
                return refused.code
            except Exception:
                logger.exception("the simulated %s failed", name)
                return sa.SA_CTL_ERROR_INTERNAL_COMMUNICATION

        pointer = sa.function_type(name)(call)
        pointer.__name__ = name  # as the functions of a loaded library have; clients read it
        return pointer

    def _own_functions(self) -> dict[str, Callable[..., int]]:
        return {
            "SA_CTL_GetFullVersionString": lambda: self._text(VERSION),
            "SA_CTL_GetResultInfo": lambda code: self._text(_result_info(code)),
            "SA_CTL_GetEventInfo": self._event_info,
            "SA_CTL_FindDevices": self._find_devices,
            "SA_CTL_Open": self._open,
            "SA_CTL_Close": self._close,
            "SA_CTL_Cancel": self._cancel,
        }

    def _text(self, text: str) -> int:
        """Return the address of a text that stays where it is."""
        kept = self._texts.setdefault(text, ctypes.create_string_buffer(text.encode()))
        return ctypes.addressof(kept)

    def _event_info(self, event: Any) -> int:
        if not event:
            return self._text("")
        said = event[0]
        name = _EVENTS.get(said.type, f"event {said.type:#06x}")
        return self._text(f"{name}, index {said.idx}, value {said.value.i32}")

    def _find_devices(self, _options: Any, out: Any, size: Any) -> int:
        if not size:
            return sa.SA_CTL_ERROR_INVALID_PARAMETER
        found = (f"usb:sn:{each.serial}" for each in self._wired if not each.unplugged)
        return text_out("\n".join(found), out, size)

    def _open(self, handle: Any, locator: bytes | None, _config: Any) -> int:
        if not handle:
            return sa.SA_CTL_ERROR_INVALID_PARAMETER
        with self._lock:
            device = self._located((locator or b"").decode("ascii", "replace"))
            if device.handle:
                return sa.SA_CTL_ERROR_INITIALIZATION_FAILED
            handle[0] = given = self._next_handle
            self._next_handle += 1
            device.open(given)
            self._handles[given] = device
        logger.info("simulated SmarActCTL: %s opened", device.serial)
        return sa.SA_CTL_ERROR_NONE

    def _located(self, locator: str) -> Device:
        """Return the device that a locator names; raises `Refused`."""
        interface, _, rest = locator.partition(":")
        how, _, which = rest.partition(":")
        if interface not in ("usb", "network") or not rest:
            raise Refused(sa.SA_CTL_ERROR_INVALID_LOCATOR)
        plugged = [each for each in self._wired if not each.unplugged]
        if how == "ix" and which.isdecimal():
            found = plugged[int(which) : int(which) + 1]
        elif how == "sn":
            found = [each for each in plugged if each.serial == which]
        elif interface == "network":
            found = []  # nothing answers at an address
        else:
            raise Refused(sa.SA_CTL_ERROR_INVALID_LOCATOR)
        if not found:
            raise Refused(sa.SA_CTL_ERROR_DEVICE_NOT_FOUND)
        return found[0]

    def _close(self, handle: int) -> int:
        with self._lock:
            device = self.device(handle)
            del self._handles[handle]
            device.close()
        return sa.SA_CTL_ERROR_NONE

    def _cancel(self, handle: int) -> int:
        device = self.device(handle)
        with device.changed:
            device.cancelled = True
            device.changed.notify_all()
        return sa.SA_CTL_ERROR_NONE


def _result_info(code: int) -> str:
    known = RESULTS.get(code)
    return f"unknown result {code:#06x}" if known is None else f"{known.name}: {known.text}"
