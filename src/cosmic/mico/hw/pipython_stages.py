"""Stages of Physik Instrumente, through PI's own package pipython and the commands of GCS."""

import importlib
import re
from abc import abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Annotated, Any, Final, Literal, Protocol

from pydantic import Field
from typing_extensions import override

from cosmic.frame.config import StrictModel
from cosmic.frame.errors import DeviceFault, NotConnectedError
from cosmic.mico.hw.interface import Controller, ControllerBackend, ControllerContext, Serial
from cosmic.mico.hw.stages import AxisOptions, StageController, StageUnit

_FAULTS: Final[dict[int, DeviceFault]] = {
    5: DeviceFault.STATE,
    7: DeviceFault.PARAMETER,
    15: DeviceFault.NO_CHANNEL,
    17: DeviceFault.PARAMETER,
    23: DeviceFault.NO_CHANNEL,
}
"""What error codes of GCS mean; those below 0 and above -1000 come from the line."""
_LINE_ERRORS: Final = range(-999, 0)


class PiStage(StrictModel):
    """One controller of PI: how it is reached, and its axes.

    `reference` is the command that looks for the reference: FRF at the reference switch, FNL and
    FPL at the negative and the positive limit.
    """

    serial: Serial
    controller: Annotated[str, Field(min_length=1)]
    connect: Literal["usb", "tcpip", "rs232"] = "usb"
    at: Annotated[str, Field(min_length=1)]
    baud: int = 115_200
    reference: Literal["FRF", "FNL", "FPL"] = "FRF"
    axes: Annotated[tuple[AxisOptions, ...], Field(strict=False, min_length=1)]


class PiOptions(StrictModel):
    """What platform.toml says of controllers of PI."""

    stages: Annotated[tuple[PiStage, ...], Field(strict=False, min_length=1)]


class Package(Protocol):
    """What is used of pipython."""

    version: str
    errors: tuple[type[Exception], ...]

    @abstractmethod
    def connect(self, options: PiStage) -> tuple[Any, Callable[[], object]]:
        """Return a `GCSDevice`, connected, and what closes the connection."""


class InstalledPackage(Package):
    """pipython as it is installed.

    Raises
    ------
    NotConnectedError
        It is not.
    """

    def __init__(self) -> None:
        try:
            self._package = importlib.import_module("pipython")
        except ImportError as exc:
            raise NotConnectedError(
                f"PI's package pipython is missing ({exc}): pip install 'cosmic[pi]'. Controllers "
                "on USB need PI's library GCS from its software package as well",
                fault=DeviceFault.COMMUNICATION,
            ) from exc
        self.version = str(self._package.__version__)
        self.errors = (self._package.GCSError, OSError, ValueError, KeyError)

    @override
    def connect(self, options: PiStage) -> tuple[Any, Callable[[], object]]:
        make = self._package.GCSDevice
        if options.connect == "usb":
            device = make(options.controller)
            device.ConnectUSB(serialnum=options.at)
            return device, device.CloseConnection
        # pipython's own line: PI's library is not needed for it.
        if options.connect == "tcpip":
            host, _, port = options.at.partition(":")
            lines = importlib.import_module("pipython.pidevice.interfaces.pisocket")
            line = lines.PISocket(host, int(port or 50_000))
        else:
            lines = importlib.import_module("pipython.pidevice.interfaces.piserial")
            line = lines.PISerial(options.at, options.baud)
        try:
            return make(options.controller, gateway=line), line.close
        except Exception:
            line.close()
            raise


class PiUnit(StageUnit):
    """One controller of PI, connected; a move switches the servo on that holds the axis then."""

    def __init__(self, options: PiStage, package: Package) -> None:
        self.serial = options.serial
        self.axes = options.axes
        self.errors = package.errors
        self._reference = options.reference
        try:
            self._device, self._disconnect = package.connect(options)
        except self.errors as exc:
            raise _silent(options, exc) from exc
        try:
            said = str(self._device.qIDN())
        except self.errors as exc:
            self._disconnect()  # else nobody could connect to it again
            raise _silent(options, exc) from exc
        found = re.search(r"\d+\.\d+\.\d+", said.rpartition(",")[2])
        self.firmware = found.group() if found else "0.0.0"

    def _name(self, axis: int) -> str:
        return str(self.axes[axis].axis)

    def _servo(self, axis: int, *, on: bool) -> None:
        name = self._name(axis)
        if bool(self._device.qSVO(name)[name]) is not on:
            self._device.SVO(name, on)

    @override
    def position(self, axis: int) -> float:
        name = self._name(axis)
        return float(self._device.qPOS(name)[name])

    @override
    def moving(self, axis: int) -> bool:
        name = self._name(axis)
        return bool(self._device.IsMoving(name)[name])

    @override
    def move_to(self, axis: int, target: float) -> None:
        self._servo(axis, on=True)
        self._device.MOV(self._name(axis), target)

    @override
    def move_by(self, axis: int, distance: float) -> None:
        self._servo(axis, on=True)
        self._device.MVR(self._name(axis), distance)

    @override
    def step(self, axis: int, steps: int, frequency_hz: int) -> None:
        self._servo(axis, on=False)
        self._device.OSM(self._name(axis), steps)

    @override
    def reference(self, axis: int) -> None:
        self._servo(axis, on=True)
        getattr(self._device, self._reference)(self._name(axis))

    @override
    def has_reference(self, axis: int) -> bool:
        return True

    @override
    def referenced(self, axis: int) -> bool | None:
        name = self._name(axis)
        return bool(self._device.qFRF(name)[name])

    @override
    def stop(self, axis: int) -> None:
        # A halt sets error 10, which says that it was obeyed.
        self._device.HLT(self._name(axis), noraise=True)

    @override
    def close(self) -> None:
        self._disconnect()

    @override
    def fault(self, error: Exception) -> DeviceFault:
        if isinstance(error, OSError):
            return DeviceFault.COMMUNICATION
        code = getattr(error, "val", None)
        if not isinstance(code, int):
            return DeviceFault.OTHER
        line = DeviceFault.COMMUNICATION if code in _LINE_ERRORS else DeviceFault.OTHER
        return _FAULTS.get(code, line)


def _silent(options: PiStage, exc: Exception) -> NotConnectedError:
    return NotConnectedError(
        f"PI {options.controller} at {options.at!r} ({options.connect}) does not answer: "
        f"{exc}; check power, cable and that no other program uses it",
        fault=DeviceFault.COMMUNICATION,
    )


def make_controller(options: PiOptions, package: Package) -> StageController:
    """Return the controller of the stages, not yet open."""
    return StageController(
        f"pipython {package.version}",
        [partial(PiUnit, each, package) for each in options.stages],
    )


def _make(options: PiOptions, context: ControllerContext) -> Controller:
    del context  # what is to be opened stands in the options
    return make_controller(options, InstalledPackage())


BACKEND: Final = ControllerBackend(_make, PiOptions)
