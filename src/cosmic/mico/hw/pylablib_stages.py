"""Stages that pylablib drives: those of Thorlabs, Newport, Standa, Trinamic, Arcus, Attocube.

Its classes agree on names (`move_to`, `get_position`, `is_moving` ...) and not on the order of the
arguments, nor on what a stage without several axes takes: that is read off each class.
"""

import importlib
import inspect
import re
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, Final, Protocol

from pydantic import Field
from typing_extensions import override

from cosmic.frame.config import StrictModel
from cosmic.frame.errors import DeviceFault, NotConnectedError
from cosmic.mico.hw.interface import Controller, ControllerBackend, ControllerContext, Serial
from cosmic.mico.hw.stages import AxisOptions, StageController, StageUnit

_AXIS_NAMES: Final = ("axis", "channel")
_NO_WAIT: Final = ("sync", "wait")
_NEEDED: Final = ("move_by", "is_moving", "stop", "close")
_NEEDED_WITH_SENSOR: Final = ("get_position", "move_to")
_LOST: Final = re.compile("backend|timeout|serial|connection", re.IGNORECASE)


class PylablibStage(StrictModel):
    """One device: its class in `pylablib.devices`, and what that is made with."""

    serial: Serial
    device: Annotated[str, Field(pattern=r"^\w+\.\w+$")]
    arguments: Annotated[tuple[str | int | float, ...], Field(strict=False)] = ()
    keywords: dict[str, str | int | float | bool] = Field(default_factory=dict)
    axes: Annotated[tuple[AxisOptions, ...], Field(strict=False, min_length=1)]


class PylablibOptions(StrictModel):
    """What platform.toml says of stages through pylablib."""

    stages: Annotated[tuple[PylablibStage, ...], Field(strict=False, min_length=1)]


class Package(Protocol):
    """What is used of pylablib."""

    version: str
    errors: tuple[type[Exception], ...]

    def device_class(self, name: str) -> Callable[..., Any]:
        """Return a class of `pylablib.devices`, such as "Thorlabs.KinesisMotor"."""


class InstalledPackage(Package):
    """pylablib as it is installed.

    Raises
    ------
    NotConnectedError
        It is not.
    """

    def __init__(self) -> None:
        try:
            pylablib = importlib.import_module("pylablib")
            base = importlib.import_module("pylablib.core.devio.base")
        except ImportError as exc:
            raise NotConnectedError(
                f"the package pylablib is missing ({exc}): pip install 'cosmic[pylablib]'",
                fault=DeviceFault.COMMUNICATION,
            ) from exc
        self.version = str(getattr(pylablib, "__version__", "0.0.0"))
        self.errors = (base.DeviceError, OSError, ValueError, RuntimeError)

    @override
    def device_class(self, name: str) -> Callable[..., Any]:
        module, _, kind = name.partition(".")
        try:
            found: Callable[..., Any] = getattr(
                importlib.import_module(f"pylablib.devices.{module}"), kind
            )
        except ModuleNotFoundError as exc:
            if str(exc.name).startswith("pylablib"):
                raise self._no_device(name, exc) from exc
            raise NotConnectedError(
                f"{name} of pylablib needs the package {exc.name}: pip install {exc.name}",
                fault=DeviceFault.COMMUNICATION,
            ) from exc
        except (ImportError, AttributeError) as exc:
            raise self._no_device(name, exc) from exc
        return found

    @staticmethod
    def _no_device(name: str, reason: Exception) -> NotConnectedError:
        return NotConnectedError(
            f"pylablib has no device {name!r} ({reason}); it is written as in its documentation, "
            'such as "Thorlabs.KinesisMotor"',
            fault=DeviceFault.UNSUPPORTED,
        )


class PylablibUnit(StageUnit):
    """One device of pylablib, open."""

    def __init__(self, options: PylablibStage, package: Package) -> None:
        self.serial = options.serial
        found = re.match(r"\d+\.\d+\.\d+", package.version)
        self.firmware = found.group() if found else "0.0.0"
        self.axes = options.axes
        self.errors = package.errors
        make = package.device_class(options.device)
        try:
            self._device = make(*options.arguments, **options.keywords)
        except self.errors as exc:
            raise NotConnectedError(
                f"{options.device}{options.arguments} cannot be opened: {exc}; check power, cable "
                "and that no other program uses it",
                fault=DeviceFault.COMMUNICATION,
            ) from exc
        sensor = any(each.kind != "open-loop" for each in self.axes)
        needed = _NEEDED + _NEEDED_WITH_SENSOR * sensor
        missing = [name for name in needed if not self._has(name)]
        if missing:
            if "close" not in missing:
                self._device.close()
            raise NotConnectedError(
                f"{options.device} has no {', '.join(missing)}: what cannot be stopped, or does "
                "not say whether it moves, is not driven",
                fault=DeviceFault.UNSUPPORTED,
            )

    def _call(self, name: str, axis: int, *values: float, **more: object) -> Any:
        """Call a method with the axis under the name that it has there, if any."""
        method = getattr(self._device, name)
        parameters = inspect.signature(method).parameters
        named: dict[str, object] = {key: more[key] for key in more if key in parameters}
        for key in _AXIS_NAMES:
            if key in parameters:
                named[key] = self.axes[axis].axis
        free = [key for key in parameters if key not in named]
        return method(**dict(zip(free, values, strict=False)), **named)

    def _has(self, name: str) -> bool:
        return callable(getattr(self._device, name, None))

    @override
    def position(self, axis: int) -> float:
        return float(self._call("get_position", axis))

    @override
    def moving(self, axis: int) -> bool:
        return bool(self._call("is_moving", axis))

    @override
    def move_to(self, axis: int, target: float) -> None:
        self._call("move_to", axis, self._counted(axis, target))

    @override
    def move_by(self, axis: int, distance: float) -> None:
        self._call("move_by", axis, self._counted(axis, distance))

    def _counted(self, axis: int, value: float) -> float:
        # What counts in steps takes whole numbers only.
        return round(value) if self.axes[axis].unit == "step" else value

    @override
    def step(self, axis: int, steps: int, frequency_hz: int) -> None:
        if self._has("setup_velocity"):
            self._call("setup_velocity", axis, speed=frequency_hz)
        self._call("move_by", axis, steps)

    @override
    def has_reference(self, axis: int) -> bool:
        if not self._has("home"):
            return False
        parameters = inspect.signature(self._device.home).parameters.values()
        needed = [each.name for each in parameters if each.default is inspect.Parameter.empty]
        return set(needed) <= set(_AXIS_NAMES)

    @override
    def reference(self, axis: int) -> None:
        self._call("home", axis, **dict.fromkeys(_NO_WAIT, False), force=True)

    @override
    def referenced(self, axis: int) -> bool | None:
        return bool(self._call("is_homed", axis)) if self._has("is_homed") else None

    @override
    def stop(self, axis: int) -> None:
        self._call("stop", axis, immediate=True, sync=False)

    @override
    def close(self) -> None:
        self._device.close()

    @override
    def fault(self, error: Exception) -> DeviceFault:
        if isinstance(error, OSError) or _LOST.search(type(error).__name__):
            return DeviceFault.COMMUNICATION
        return DeviceFault.PARAMETER if isinstance(error, ValueError) else DeviceFault.OTHER


def make_controller(options: PylablibOptions, package: Package) -> StageController:
    """Return the controller of the stages, not yet open."""
    return StageController(
        f"pylablib {package.version}",
        [partial(PylablibUnit, each, package) for each in options.stages],
    )


def _make(options: PylablibOptions, context: ControllerContext) -> Controller:
    del context  # what is to be opened stands in the options
    return make_controller(options, InstalledPackage())


BACKEND: Final = ControllerBackend(_make, PylablibOptions)
