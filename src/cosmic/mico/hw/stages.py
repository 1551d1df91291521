"""Stages behind a library whose calls wait for their answers: one `Controller` for all of them.

Such a library tells nothing by itself, so that the end of a movement is asked for. What is asked is
asked by the thread that receives. One call is made at a time, for these libraries do not say that
they can do with more; a stop never waits for that: it is made by whoever has the library, right
after the call that is under way.
"""

import logging
import math
import threading
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, Final, Literal, Protocol, TypeVar

from pydantic import Field
from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.config import StrictModel
from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.frame.units import AxisUnit
from cosmic.mico.hw.addresses import device_of, error_at, open_device, refused, where
from cosmic.mico.hw.interface import (
    Activity,
    ActivityRead,
    Capabilities,
    Channel,
    Completed,
    Controller,
    DeviceIdentity,
    Direction,
    Event,
    Failed,
    PositionerKind,
    PositionerType,
    PositionKnownRead,
    PositionRead,
    ReferenceKind,
    SensorPresentRead,
    Serial,
    TypeRead,
)

logger = logging.getLogger(__name__)

T = TypeVar("T")

LOOK_S: Final = 0.02
"""How often it is asked whether a movement has ended."""
MOST_STEPS: Final = 29_999
FREQUENCY_HZ: Final = (1, 18_500)
AMPLITUDE_V: Final = (15.0, 100.0)
LONGEST_HOLD_S: Final = 59.999
FARTHEST: Final = 1e8
"""No stage goes so far, in um or degrees."""
_LONGEST_WAIT_S: Final = 1e6
_CLOSE_S: Final = 5.0
"""How long closing waits for a call that does not return."""

LibraryUnit = Literal["m", "mm", "um", "nm", "deg", "mdeg", "step"]
_PER_UNIT: Final[dict[str, float]] = {
    "m": 1e-6,
    "mm": 1e-3,
    "um": 1.0,
    "nm": 1e3,
    "deg": 1.0,
    "mdeg": 1e3,
    "step": 1.0,
}


class AxisOptions(StrictModel):
    """One axis of a stage: what its library calls it, and what it counts in.

    `scale` is how many of those a real `unit` is, for libraries that count in something of their
    own.
    """

    axis: str | int
    kind: Literal["linear", "rotary", "open-loop"] = "linear"
    unit: LibraryUnit = "mm"
    scale: Annotated[float, Field(gt=0.0)] = 1.0

    @property
    def positioner_kind(self) -> PositionerKind:
        """Kind as the rest of MiCo names it."""
        return PositionerKind(self.kind)

    @property
    def axis_unit(self) -> AxisUnit:
        """Unit of its positions in MiCo."""
        return "deg" if self.kind == "rotary" else "um"

    @property
    def counts(self) -> float:
        """How many of what the library counts in are 1 um, or 1 degree."""
        return _PER_UNIT[self.unit] * self.scale


class StageUnit(Protocol):
    """One device of a library, open; one thread at a time. `axis` counts from zero.

    Each call may raise one of `errors`.
    """

    serial: Serial
    firmware: str
    axes: tuple[AxisOptions, ...]
    errors: tuple[type[Exception], ...]

    @abstractmethod
    def position(self, axis: int) -> float:
        """Return where it is, in the library's unit."""

    @abstractmethod
    def moving(self, axis: int) -> bool:
        """Return whether it moves: from the command on, also where it has not begun yet.

        Where its movement has failed, raise one of `errors`.
        """

    @abstractmethod
    def move_to(self, axis: int, target: float) -> None:
        """Begin to move to `target`, in the library's unit."""

    @abstractmethod
    def move_by(self, axis: int, distance: float) -> None:
        """Begin to move by `distance`, in the library's unit."""

    @abstractmethod
    def step(self, axis: int, steps: int, frequency_hz: int) -> None:
        """Begin to make steps without looking at a sensor."""

    @abstractmethod
    def reference(self, axis: int) -> None:
        """Begin to look for the reference."""

    @abstractmethod
    def has_reference(self, axis: int) -> bool:
        """Return whether a reference can be looked for."""

    @abstractmethod
    def referenced(self, axis: int) -> bool | None:
        """Return whether the position is referenced; None where the library cannot say."""

    @abstractmethod
    def stop(self, axis: int) -> None:
        """Stop."""

    @abstractmethod
    def close(self) -> None:
        """Give the device back."""

    @abstractmethod
    def fault(self, error: Exception) -> DeviceFault:
        """Return what one of `errors` means."""


def unsupported(what: str, at: Channel) -> DeviceError:
    """Return the exception for what a stage cannot do."""
    return error_at(DeviceFault.UNSUPPORTED, f"the stage knows no {what}", at)


def _within(value: float, low: float, high: float, what: str, at: Channel) -> float:
    if not low <= value <= high:
        raise refused(f"{what} must be {low:g} to {high:g}, got {value!r}", at)
    return value


def _whole(value: float, low: int, high: int, what: str, at: Channel) -> int:
    if _within(value, low, high, what, at) != int(value):
        raise refused(f"{what} must be a whole number, got {value!r}", at)
    return int(value)


def _check_hold(hold_s: float, at: Channel) -> None:
    if hold_s != math.inf:
        _within(hold_s, 0.0, LONGEST_HOLD_S, "hold time in s", at)


@dataclass(eq=False, slots=True)
class _Open:
    """One open device, and what it is at."""

    unit: StageUnit
    index: int
    questions: deque[Callable[[], Event]] = field(default_factory=deque)
    events: deque[Event] = field(default_factory=deque)
    changed: threading.Condition = field(default_factory=threading.Condition)
    busy: threading.Lock = field(default_factory=threading.Lock)
    stops: deque[int] = field(default_factory=deque)
    doing: dict[int, Activity] = field(default_factory=dict)
    held: set[int] = field(default_factory=set)
    reports: set[int] = field(default_factory=set)
    looked_s: float = 0.0

    def call(self, asked: str, axis: int, work: Callable[[], T]) -> T:
        """Have the library do something, alone; raises `DeviceError`."""
        try:
            with self.busy:
                return work()
        except Exception as exc:  # the code of somebody else, which raises what it likes
            fault, text = self._meant(exc)
            said = f"{where(self.index, axis)}: {asked}: {text}"
            raise DeviceError(said, fault=fault, device=self.index, channel=axis) from exc
        finally:
            self.make_stops()

    def _meant(self, exc: Exception) -> tuple[DeviceFault, str]:
        """Return what an exception of the library means, and what is said of it."""
        if isinstance(exc, self.unit.errors):
            return self.unit.fault(exc), str(exc) or type(exc).__name__
        return DeviceFault.OTHER, f"{type(exc).__name__}: {exc}"

    def make_stops(self) -> DeviceError | None:
        """Make the stops that are wanted, unless somebody else has the library and will.

        Returns what went wrong with one of them.
        """
        failed: DeviceError | None = None
        while self.stops and self.busy.acquire(blocking=False):
            try:
                while self.stops:
                    failed = self._stop(self.stops.popleft()) or failed
            finally:
                self.busy.release()
        return failed

    def _stop(self, axis: int) -> DeviceError | None:
        try:
            self.unit.stop(axis)
        except Exception as exc:
            fault, text = self._meant(exc)
            said = f"{where(self.index, axis)}: a stop failed: {text}"
            logger.exception("%s", said)
            failed = DeviceError(said, fault=fault, device=self.index, channel=axis)
            self.events.append(Failed(Channel(self.index, axis), failed))
            return failed
        return None

    def wake(self) -> None:
        """Have the thread that receives look again."""
        with self.changed:
            self.changed.notify_all()

    def look(self, axis: int) -> Activity:
        """Ask what an axis does, and take note where a movement has ended."""
        moving = self.call("asking whether it moves", axis, lambda: self.unit.moving(axis))
        if moving:
            return self.doing.get(axis, Activity.TARGETING)
        ended = self.doing.pop(axis, None)
        if ended is not None and axis in self.reports:
            self.events.append(Completed(Channel(self.index, axis)))
        return Activity.HOLDING if axis in self.held else Activity.STOPPED


class StageController(Controller):
    """Stages of one library; thread-safe, whatever the library is.

    Parameters
    ----------
    title : str
        What drives them, with its version.
    open_units : sequence of callable
        Each opens one device and returns it; raises `DeviceError`.
    """

    def __init__(
        self,
        title: str,
        open_units: Sequence[Callable[[], StageUnit]],
        *,
        simulated: bool = False,
    ) -> None:
        self._title = title
        self._open_units = tuple(open_units)
        self._simulated = simulated
        self._lifecycle = threading.Lock()
        self._devices: tuple[_Open, ...] = ()

    @property
    @override
    def name(self) -> str:
        return f"{self._title}{' (simulated)' if self._simulated else ''}"

    @property
    @override
    def simulated(self) -> bool:
        return self._simulated

    @property
    @override
    def capabilities(self) -> Capabilities:
        return self._able(max((len(each.unit.axes) for each in self._devices), default=3))

    @override
    def device_capabilities(self, device: int) -> Capabilities:
        return self._able(len(self._device(device).unit.axes))

    @staticmethod
    def _able(channels: int) -> Capabilities:
        return Capabilities(
            group_start=False,
            velocity=False,
            position_known=True,
            channels=channels,
            most_steps=MOST_STEPS,
            frequency_hz=FREQUENCY_HZ,
            amplitude_v=AMPLITUDE_V,
        )

    # Opening and closing

    @override
    def find_devices(self) -> tuple[Serial, ...]:
        with self._lifecycle:
            if self._devices:
                return tuple(each.unit.serial for each in self._devices)
            units = self._find()
            for unit in units:
                _close(unit)
        return tuple(unit.serial for unit in units)

    def _find(self) -> list[StageUnit]:
        units: list[StageUnit] = []
        for open_unit in self._open_units:
            try:
                units.append(open_unit())
            except NotConnectedError as exc:
                logger.warning("%s", exc)
            except DeviceError:
                for unit in units:
                    _close(unit)
                raise
            except Exception:  # the code of somebody else: its other devices are opened
                logger.exception("%s: a device cannot be opened", self._title)
        return units

    @override
    def open(self, serials: Sequence[Serial] = ()) -> tuple[DeviceIdentity, ...]:
        with self._lifecycle:
            if self._devices:
                text = f"{self._title} is open already"
                raise DeviceError(text, fault=DeviceFault.STATE)
            units = self._find()
            found = [unit.serial for unit in units]
            missing = [str(each) for each in serials if each not in found]
            if missing or not units:
                for unit in units:
                    _close(unit)
                raise NotConnectedError(
                    f"{self._title}: no device {', '.join(missing)}; connected: "
                    f"{', '.join(map(str, found)) or 'none'}; check power, cable and options",
                    fault=DeviceFault.COMMUNICATION,
                )
            for unit in units:
                if serials and unit.serial not in serials:
                    _close(unit)
            wanted = [unit for unit in units if not serials or unit.serial in serials]
            self._devices = tuple(_Open(unit, index) for index, unit in enumerate(wanted))
        logger.info("%s opened with %s", self.name, [unit.serial for unit in wanted])
        return tuple(
            DeviceIdentity(each.index, each.unit.serial, each.unit.firmware)
            for each in self._devices
        )

    @override
    def close(self) -> None:
        with self._lifecycle:
            devices, self._devices = self._devices, ()
            for device in devices:
                if device.busy.acquire(timeout=_CLOSE_S):
                    try:
                        _close(device.unit)
                    finally:
                        device.busy.release()
                else:
                    logger.error(
                        "%s: a call has not returned for %g s; it is left open",
                        where(device.index),
                        _CLOSE_S,
                    )
                device.wake()

    # What comes back

    @override
    def receive(self, device: int, timeout_s: float) -> Event | None:
        at = self._device(device)
        if not 0.0 <= timeout_s <= _LONGEST_WAIT_S:
            text = f"a wait must be finite and not negative, got {timeout_s!r} s"
            raise DeviceError(text, fault=DeviceFault.PARAMETER, device=device)
        until_s = WALL.now_s() + timeout_s
        while True:
            self._device(device)  # it may have been closed meanwhile
            self._look(at)
            if at.events:
                return at.events.popleft()
            if at.questions:
                return _answered(at.questions.popleft())
            now_s = WALL.now_s()
            if now_s >= until_s:
                return None
            with at.changed:
                if not (at.questions or at.events):
                    WALL.wait(at.changed, min(until_s, now_s + LOOK_S))

    def _look(self, at: _Open) -> None:
        now_s = WALL.now_s()
        if now_s - at.looked_s < LOOK_S:
            return
        at.looked_s = now_s
        for axis in list(at.doing):
            try:
                at.look(axis)
            except DeviceError as exc:
                at.doing.pop(axis, None)  # from here on it is asked for by whoever wants to know
                at.events.append(_failed(exc))

    def _ask(self, channel: Channel, question: Callable[[], Event]) -> None:
        at = self._at(channel)
        at.questions.append(question)
        at.wake()

    @override
    def report_completion(self, channel: Channel) -> None:
        self._at(channel).reports.add(channel.channel)

    @override
    def ask_sensor_present(self, channel: Channel) -> None:
        present = self._axis(channel).kind != "open-loop"
        self._ask(channel, lambda: SensorPresentRead(channel, present=present))

    @override
    def ask_type(self, channel: Channel) -> None:
        at, axis = self._at(channel), self._axis(channel)

        def answer() -> Event:
            kind = ReferenceKind.MARK if self._has_reference(at, channel) else ReferenceKind.NONE
            name = f"{self._title}, axis {axis.axis}"
            return TypeRead(channel, PositionerType(0, name, axis.positioner_kind, kind))

        self._ask(channel, answer)

    @staticmethod
    def _has_reference(at: _Open, channel: Channel) -> bool:
        return at.call(
            "asking whether it has a reference",
            channel.channel,
            lambda: at.unit.has_reference(channel.channel),
        )

    @override
    def ask_position_known(self, channel: Channel) -> None:
        at = self._at(channel)

        def answer() -> Event:
            known = at.call(
                "asking whether it is referenced",
                channel.channel,
                lambda: at.unit.referenced(channel.channel),
            )
            if known is None:
                return Failed(channel, unsupported("reference", channel))
            return PositionKnownRead(channel, known=known)

        self._ask(channel, answer)

    @override
    def ask_safe_direction(self, channel: Channel) -> None:
        self._at(channel)
        raise unsupported("safe direction", channel)

    @override
    def ask_position(self, channel: Channel, unit: AxisUnit) -> None:
        at, axis = self._at(channel), self._axis(channel)

        def answer() -> Event:
            self._check_kind(channel, unit)
            counted = at.call(
                "reading its position", channel.channel, lambda: at.unit.position(channel.channel)
            )
            if not math.isfinite(counted):
                text = f"{where(channel.device, channel.channel)}: its position is {counted!r}"
                raise DeviceError(text, device=channel.device, channel=channel.channel)
            return PositionRead(channel, counted / axis.counts, unit)

        self._ask(channel, answer)

    @override
    def ask_activity(self, channel: Channel) -> None:
        at = self._at(channel)
        self._ask(channel, lambda: ActivityRead(channel, at.look(channel.channel)))

    def _check_kind(self, channel: Channel, unit: AxisUnit) -> None:
        axis = self._axis(channel)
        here = where(channel.device, channel.channel)
        fault, why = DeviceFault.NO_SENSOR, "it has no sensor"
        if axis.kind != "open-loop":
            if axis.axis_unit == unit:
                return
            fault, why = DeviceFault.WRONG_KIND, f"its position is not in {unit}"
        said = f"{here}: {why}"
        raise DeviceError(said, fault=fault, device=channel.device, channel=channel.channel)

    # Movements

    @override
    def set_closed_loop_frequency(self, channel: Channel, frequency_hz: int) -> None:
        self._at(channel)
        # These stages have speeds of their own; the number is checked, and means nothing to them.
        _whole(frequency_hz, *FREQUENCY_HZ, "frequency in Hz", channel)

    @override
    def step(self, channel: Channel, steps: int, *, amplitude_v: float, frequency_hz: int) -> None:
        at, index = self._at(channel), channel.channel
        count = _whole(steps, -MOST_STEPS, MOST_STEPS, "steps", channel)
        _within(amplitude_v, *AMPLITUDE_V, "amplitude in V", channel)
        hertz = _whole(frequency_hz, *FREQUENCY_HZ, "frequency in Hz", channel)
        if self._axis(channel).kind != "open-loop":
            raise unsupported("steps: it has a sensor", channel)
        self._begin(
            at, channel, Activity.STEPPING, lambda: at.unit.step(index, count, hertz), hold_s=0.0
        )

    @override
    def move_to(self, channel: Channel, target: float, unit: AxisUnit, *, hold_s: float) -> None:
        self._move(channel, target, unit, hold_s, relative=False)

    @override
    def move_by(self, channel: Channel, distance: float, unit: AxisUnit, *, hold_s: float) -> None:
        self._move(channel, distance, unit, hold_s, relative=True)

    def _move(
        self, channel: Channel, value: float, unit: AxisUnit, hold_s: float, *, relative: bool
    ) -> None:
        at, index = self._at(channel), channel.channel
        _within(value, -FARTHEST, FARTHEST, f"a target or distance in {unit}", channel)
        _check_hold(hold_s, channel)
        try:
            self._check_kind(channel, unit)
        except DeviceError as exc:
            at.events.append(Failed(channel, exc))
            at.wake()
            return
        counted = value * self._axis(channel).counts
        go = at.unit.move_by if relative else at.unit.move_to
        self._begin(at, channel, Activity.TARGETING, lambda: go(index, counted), hold_s=hold_s)

    def _begin(
        self,
        at: _Open,
        channel: Channel,
        activity: Activity,
        work: Callable[[], None],
        *,
        hold_s: float,
    ) -> None:
        index = channel.channel
        at.call(f"{activity}", index, work)
        at.doing[index] = activity
        (at.held.add if hold_s > 0.0 else at.held.discard)(index)
        at.wake()

    @override
    def calibrate(self, channel: Channel) -> None:
        self._at(channel)
        raise unsupported("calibration", channel)

    @override
    def reference(self, channel: Channel, *, hold_s: float) -> None:
        at, index = self._at(channel), channel.channel
        _check_hold(hold_s, channel)
        if not self._has_reference(at, channel):
            raise unsupported("reference", channel)
        run = partial(at.unit.reference, index)
        self._begin(at, channel, Activity.REFERENCING, run, hold_s=hold_s)

    @override
    def move_to_end_stop(self, channel: Channel, direction: Direction, *, hold_s: float) -> None:
        self._at(channel)
        _check_hold(hold_s, channel)
        raise unsupported(f"run to its end stop {direction}", channel)

    @override
    def stop(self, channel: Channel) -> None:
        at = self._at(channel)
        at.held.discard(channel.channel)
        at.stops.append(channel.channel)
        failed = at.make_stops()
        if failed is not None:
            raise failed

    # Where

    @property
    def _not_open(self) -> str:
        return f"{self._title} is not open"

    def _device(self, device: int) -> _Open:
        return open_device(self._devices, device, self._not_open)

    def _at(self, channel: Channel) -> _Open:
        return device_of(
            self._devices,
            channel,
            lambda device: len(device.unit.axes),
            f"{self._title} is not open",
        )

    def _axis(self, channel: Channel) -> AxisOptions:
        return self._at(channel).unit.axes[channel.channel]


def _answered(question: Callable[[], Event]) -> Event:
    """Return the answer to a question, or that it failed; raises when the device is gone."""
    try:
        return question()
    except DeviceError as exc:
        return _failed(exc)


def _failed(error: DeviceError) -> Event:
    """Return the failure of one axis as an event; raises `error` when the device is gone."""
    if error.fault is DeviceFault.COMMUNICATION or error.device is None or error.channel is None:
        raise error
    return Failed(Channel(error.device, error.channel), error)


def _close(unit: StageUnit) -> None:
    try:
        unit.close()
    except Exception:
        logger.exception("closing %s", unit.serial)
