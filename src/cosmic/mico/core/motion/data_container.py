"""What is known of one device: `DeviceDataContainer` keeps it, `DeviceListener` receives it.

Thesis 5.4 and 6.1.1.
"""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from threading import RLock
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.errors import ConfigError, DeviceError, DeviceFault, NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.heartbeat import STALL_S, Heartbeat
from cosmic.frame.threads import WorkerThread
from cosmic.mico.core.motion.orders import COMMON
from cosmic.mico.core.motion.positioner import (
    Confidence,
    CountedTravel,
    PositionerBase,
    PositionerState,
    check_estimate,
    class_for,
    positioner_driver,
)
from cosmic.mico.core.motion.settings import PositionerSettings
from cosmic.mico.hw.interface import (
    ActivityRead,
    Capabilities,
    Channel,
    Controller,
    Event,
    Failed,
    PositionerKind,
    PositionerType,
    PositionKnownRead,
    PositionRead,
    ReferenceKind,
    SafeDirectionRead,
    SensorPresentRead,
    TypeRead,
)

logger = logging.getLogger(__name__)

Observer = Callable[[Event, PositionerState | None], None]

NO_DEVICE: Final = "no device"
RECEIVE_S: Final = 0.1
"""How long one receive waits: no call can cancel it, so it bounds how long closing takes."""
_LOST_POSITION: Final = (DeviceFault.NO_SENSOR,)


@dataclass(frozen=True, slots=True)
class Memory:
    """What was set or counted on an axis, and must not be lost when devices are searched again."""

    zero: float
    frequency_hz: int | None
    counted: float | None
    std: float = 0.0


class DeviceDataContainer:
    """Keeps what is known of the positioners of one device; any thread.

    `DeviceListener` writes through `apply`, `Device` reads and observes; neither knows the
    other. Observers are called in the thread that wrote, after the state has changed, and must
    return at once.

    Parameters
    ----------
    device : int
        Number of the device in the configuration.
    configured : mapping of PositionerSettings
        The positioners that the configuration expects here, by channel.
    hold_s : float
        How long closed-loop positions are held; inf for ever.
    library_index : int
        Index under which the library knows the device, which depends on what else is connected.
    capabilities : Capabilities
        What the device can do.
    """

    def __init__(
        self,
        device: int,
        configured: Mapping[int, PositionerSettings],
        hold_s: float,
        library_index: int,
        capabilities: Capabilities = COMMON,
    ) -> None:
        self.device = device
        self.capabilities = capabilities
        self.library_index = library_index
        self._configured = dict(configured)
        self._hold_s = hold_s
        self._lock = RLock()
        self._positioners: dict[int, PositionerBase] = {}
        self._unclear: set[int] = set()
        self._observers: tuple[Observer, ...] = ()
        self._memories: dict[str, Memory] = {}

    def observe(self, observer: Observer) -> None:
        """Call `observer(event, state)` after each event."""
        self._observers = (*self._observers, observer)

    def remember(self, memories: Mapping[str, Memory]) -> None:
        """Take over what was set on axes of an earlier search, by name."""
        self._memories = dict(memories)

    def memories(self) -> dict[str, Memory]:
        """Return what is to be taken over to a later search, by name."""
        kept = dict(self._memories)
        for each in self._positioners.values():
            counted = None if each.has_sensor else each.state.position
            kept[each.state.name] = Memory(
                each.state.zero, each.frequency_hz, counted, each.state.std
            )
        return kept

    # What is there

    def expect(self, channel: int) -> None:
        """Say that an answer about `channel` is awaited."""
        with self._lock:
            self._unclear.add(channel)

    def settle(self, channel: int, kind: PositionerKind | None, reason: str = "") -> None:
        """Say what `channel` has: a kind, or nothing (None)."""
        with self._lock:
            self._settle(channel, kind, None, reason)

    @property
    def clear(self) -> bool:
        """True when every expected channel has answered."""
        return not self._unclear

    def _settle(
        self, channel: int, kind: PositionerKind | None, found: PositionerType | None, reason: str
    ) -> None:
        self._unclear.discard(channel)
        settings = self._configured.get(channel) or self._unconfigured(channel, kind)
        if settings is None:
            return
        wanted = settings.positioner_kind
        found, trouble = _with_driver(found, settings)
        positioner = class_for(wanted, found)(settings, self.address(channel), found, self._hold_s)
        positioner.update(
            most_steps=self.capabilities.most_steps,
            frequency_range_hz=self.capabilities.frequency_hz,
            amplitude_range_v=self.capabilities.amplitude_v,
        )
        memory = self._memories.get(settings.name)
        if memory is not None:
            positioner.frequency_hz = memory.frequency_hz
            positioner.update(zero=memory.zero)
            if memory.counted is not None and not positioner.has_sensor:
                positioner.update(position=memory.counted, std=memory.std)
        if channel not in self._configured:
            text = "not in the configuration; add it there, then start again"
            positioner.update(present=False, error=text)
        elif kind is not wanted:
            seen = kind.value if kind else reason or "nothing"
            text = f"configured as {wanted}, but the controller finds {seen}; correct one of them"
            if reason == NO_DEVICE:
                text = f"device {self.device} was not found; connect it, then rescan"
            positioner.update(present=False, error=text)
            log = logger.debug if reason == NO_DEVICE else logger.error
            log("%s: %s", settings.name, text)
        elif trouble:
            positioner.update(present=False, error=trouble)
            logger.error("%s: %s", settings.name, trouble)
        self._positioners[channel] = positioner

    def _unconfigured(self, channel: int, kind: PositionerKind | None) -> PositionerSettings | None:
        """Make up settings for a sensor nobody configured; a channel without one is empty."""
        if kind is None or kind is PositionerKind.OPEN_LOOP:
            return None
        name = f"device{self.device}.channel{channel}"
        unit = "deg" if kind is PositionerKind.ROTARY else "um"
        return PositionerSettings.model_validate(
            {
                "name": name,
                "device": self.device,
                "channel": channel,
                "kind": kind.value,
                f"limits_{unit}": (-1e-6, 1e-6),
            }
        )

    # Reading

    def positioner(self, channel: int) -> PositionerBase | None:
        """Return the positioner on `channel`, or None where there is none."""
        return self._positioners.get(channel)

    def state(self, channel: int) -> PositionerState | None:
        """Return the state of the positioner on `channel`, or None where there is none."""
        positioner = self._positioners.get(channel)
        return positioner.state if positioner else None

    def possible_channels(self) -> list[int]:
        """Return the channels that the device can have, and those that are configured."""
        return sorted({*range(self.capabilities.channels), *self._configured})

    def channels(self) -> list[int]:
        """Return the channels that have a positioner."""
        return sorted(self._positioners)

    def states(self) -> list[PositionerState]:
        """Return the state of every positioner, by channel."""
        return [self._positioners[channel].state for channel in self.channels()]

    # Writing

    def update(self, channel: int, **changes: object) -> PositionerState | None:
        """Change fields of one positioner's state and return it."""
        with self._lock:
            positioner = self._positioners.get(channel)
            return positioner.update(**changes) if positioner else None

    def set_estimate(
        self, channel: int, travel: CountedTravel | None, position: float, std: float
    ) -> None:
        """Say where an axis without sensor stands; raises as `check_estimate`."""
        with self._lock:
            positioner = self._positioners.get(channel)
            if positioner is None:
                raise NotAvailable(f"device {self.device} channel {channel} has no axis")
            check_estimate(positioner.state, travel, position, std)
            positioner.update(position=position, std=std)

    def lose(self, reason: str) -> list[PositionerState]:
        """Say that the whole device is gone; positions are worth nothing from now on."""
        with self._lock:
            return [
                each.update(
                    present=False,
                    error=reason,
                    confidence=Confidence.UNKNOWN if each.has_sensor else each.state.confidence,
                    in_motion=False,
                )
                for each in self._positioners.values()
            ]

    def apply(self, event: Event) -> None:
        """Take in one event of the controller; listener thread."""
        with self._lock:
            state = self._apply(event)
        for observer in self._observers:
            observer(event, state)

    def _apply(self, event: Event) -> PositionerState | None:
        match event:
            case SensorPresentRead():
                if not event.present:
                    self._settle(event.channel.channel, PositionerKind.OPEN_LOOP, None, "")
            case TypeRead():
                reason = f"the unknown type {event.positioner.name}"
                self._settle(event.channel.channel, event.positioner.kind, event.positioner, reason)
        if event.channel is None:
            return None
        positioner = self._positioners.get(event.channel.channel)
        return None if positioner is None else _reflect(event, positioner)

    def address(self, channel: int) -> Channel:
        """Return the address of `channel` for calls to the controller."""
        return Channel(self.library_index, channel)


class DeviceListener(WorkerThread):
    """Waits for the packets of one device and hands them to its `DeviceDataContainer`.

    Parameters
    ----------
    on_lost : callable
        Told why when the device cannot be reached any more; called in this thread.
    heartbeat : Heartbeat
        Stays away while a call of the library does not return.
    """

    may_wait = False

    def __init__(
        self,
        controller: Controller,
        container: DeviceDataContainer,
        policy: FailurePolicy,
        on_lost: Callable[[DeviceError], None],
        heartbeat: Heartbeat,
    ) -> None:
        super().__init__(f"listener {container.device}", policy)
        self._controller = controller
        self._container = container
        self._on_lost = on_lost
        self._heartbeat = heartbeat

    @override
    def run_body(self) -> None:
        try:
            self._listen()
        except BaseException as exc:
            self._on_lost(DeviceError(f"its listener failed: {exc!r}"))
            raise
        finally:
            self._heartbeat.end()

    def _listen(self) -> None:
        while not self.end_requested:
            self._heartbeat.beat(RECEIVE_S + STALL_S)
            try:
                event = self._controller.receive(self._container.library_index, RECEIVE_S)
            except DeviceError as exc:
                self._on_lost(exc)
                return
            if event is not None:
                logger.debug("%s", event)
                self._container.apply(event)


def _with_driver(
    found: PositionerType | None, settings: PositionerSettings
) -> tuple[PositionerType | None, str]:
    """Return what was found with the type that the configuration names, or why it has none."""
    if not settings.type:
        return found, ""
    kind = settings.positioner_kind
    try:
        driver = positioner_driver(settings.type)
    except ConfigError as exc:
        return found, str(exc)
    if driver.positioner.kind is not kind:
        return found, f"type {settings.type!r} is {driver.positioner.kind}, the axis is {kind}"
    if found is None:
        return PositionerType(-1, settings.type, kind, ReferenceKind.NONE, settings.type), ""
    return replace(found, driver=settings.type), ""


def _reflect(event: Event, positioner: PositionerBase) -> PositionerState:
    """Write `event` into `positioner`."""
    match event:
        case PositionRead() if event.unit == positioner.state.unit:
            return positioner.update(position=event.value, read_wall_s=WALL.now_s())
        case ActivityRead():
            return positioner.update(activity=event.activity)
        case PositionKnownRead():
            known = Confidence.KNOWN if event.known else Confidence.UNKNOWN
            return positioner.update(confidence=known)
        case SafeDirectionRead():
            return positioner.update(safe_direction=event.direction)
        case Failed() if event.error.fault in _LOST_POSITION and positioner.has_sensor:
            return positioner.update(confidence=Confidence.UNKNOWN)
        case _:
            return positioner.state
