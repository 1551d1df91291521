"""`DeviceManager`: finds the devices, owns their threads, and stops them all (thesis 6.1)."""

import logging
from collections.abc import (
    Collection,
    Generator,
    Iterable,
    Mapping,
    Sequence,
    Set,
)
from contextlib import contextmanager
from enum import StrEnum
from threading import RLock
from typing import Final

from PySide6.QtCore import QObject, Qt, Signal

from cosmic.frame.arguments import reason_of
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    NotAvailable,
    NotConnectedError,
    UnknownAxisError,
    refusal,
)
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.heartbeat import OPEN_S, Heartbeat, HeartbeatWatch
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.threads import JOIN_TIMEOUT_S, WorkerThread, urgent
from cosmic.frame.verdict import Reason, refuse
from cosmic.mico.core.collision.checker import CollisionChecker, NoCollisionModel
from cosmic.mico.core.collision.collision_manager import CollisionManager
from cosmic.mico.core.collision.exemptions import Exemptions
from cosmic.mico.core.collision.model import BodyPair
from cosmic.mico.core.motion.checks import Limits
from cosmic.mico.core.motion.data_container import (
    DeviceDataContainer,
    DeviceListener,
    Memory,
)
from cosmic.mico.core.motion.device import Device
from cosmic.mico.core.motion.device_commander import CommanderType, DeviceCommander
from cosmic.mico.core.motion.gate import Gate
from cosmic.mico.core.motion.group import GroupOrders
from cosmic.mico.core.motion.inventory import open_devices, take_inventory
from cosmic.mico.core.motion.lease import Lease
from cosmic.mico.core.motion.links import LinkTable
from cosmic.mico.core.motion.messages import DeviceLost
from cosmic.mico.core.motion.orders import Interval
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.core.motion.settings import WatchSettings
from cosmic.mico.core.motion.stop_latch import StopLatch
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.interface import Channel, Controller

logger = logging.getLogger(__name__)


class DeviceThreads:
    """Owns the `DeviceListener` of each device, and remembers threads that did not end.

    `stop_channels` may be called from any thread, the rest by the one that starts and ends.
    """

    def __init__(self, controller: Controller, watch: WatchSettings, policy: FailurePolicy) -> None:
        self._controller = controller
        self._watch = watch
        self._policy = policy
        self._listeners: dict[Device, DeviceListener] = {}
        self._stuck: list[WorkerThread] = []
        self._opening = Heartbeat(self._on_opening)
        self._driver_watch: HeartbeatWatch | None = None
        self._opens = False

    def check_none_hangs(self) -> None:
        """Raise `NotConnectedError` while a thread of an earlier run still uses the library."""
        stuck = [thread.name for thread in self._stuck if thread.isRunning()]
        if stuck:
            raise NotConnectedError(
                f"{', '.join(stuck)} still hangs in the library; start the program again"
            )

    @contextmanager
    def opening(self) -> Generator[None]:
        """Say so when the library does not come back from what is done meanwhile."""
        self._end_watch()
        self._driver_watch = HeartbeatWatch("controller watch", [self._opening], self._policy)
        self._driver_watch.start()
        self._opening.beat(OPEN_S)
        self._opens = True
        try:
            yield
        except BaseException:
            self._end_watch()  # there is nothing to be watched
            raise
        finally:
            self._opens = False
            self._opening.end()

    @property
    def opens(self) -> bool:
        """Whether the library is at opening the devices."""
        return self._opens

    def _on_opening(self, stalled_s: float) -> None:
        """Say that looking for the devices hangs; thread of the watch."""
        name = self._controller.name
        if not stalled_s:
            logger.warning("%s: looking for the devices has returned", name)
            return
        text = (
            f"{name}: looking for the devices has not returned for {stalled_s:g} s. Check power "
            "and cables, or unplug and plug in again; if that does not help, restart the program"
        )
        self._policy.report(NotConnectedError(text), "MiCo")

    def start(self, devices: Collection[Device]) -> None:
        """Start a listener and the thread of each of `devices`."""
        channels = sum(device.container.capabilities.channels for device in devices)
        for device in devices:
            device.set_poll_period(
                max(1 / self._watch.poll_hz, channels / self._watch.poll_total_hz)
            )
            listener = DeviceListener(
                self._controller,
                device.container,
                self._policy,
                on_lost=device.lose,
                heartbeat=device.calls.listener,
            )
            self._listeners[device] = listener
            listener.start()
            device.begin()
            if self._driver_watch is not None:
                calls = device.calls
                self._driver_watch.add([calls.device, calls.listener, calls.stops])

    def stop_channels(self, devices: Iterable[Device]) -> None:
        """Stop every channel of devices, past their threads: first those known to move.

        Each call into a library in C may have to wait for the interpreter, and what stands can.
        """
        channels = [
            (device, channel) for device in devices for channel in device.container.channels()
        ]
        for device, channel in sorted(channels, key=_stands):
            device.stop_channel(channel)

    def end(self, devices: Iterable[Device]) -> None:
        """Stop every channel, end the threads that run, and stop every channel once more."""
        running = [device for device in devices if device.isRunning()]
        self.stop_channels(running)  # past the threads, one of which may hang in the library
        for device in running:
            device.request_end()
        hang: list[WorkerThread] = [
            device for device in running if not device.join(device.calls.join_s)
        ]
        self.stop_channels(running)
        for listener in self._listeners.values():
            listener.request_end()
        for device, listener in self._listeners.items():
            hang += device.calls.end()
            if not listener.join(device.calls.join_s):
                hang.append(listener)
        self._listeners.clear()
        self._end_watch()
        self._leave(hang)

    def _end_watch(self) -> None:
        watch, self._driver_watch = self._driver_watch, None
        if watch is not None:
            watch.request_end()
            watch.join()

    def close_library(self) -> None:
        """Close the library; in another thread where one hangs in it, as this call may then."""
        if not any(each.isRunning() for each in self._stuck):
            self._controller.close()
            return
        closing = JobQueue("closing the controllers", self._policy)
        closing.submit(self._controller.close, "closing").when_failed(
            lambda error: logger.error("closing the controllers failed: %s", error)
        )
        closing.submit(closing.request_end, "the end")
        if not closing.join():
            self._leave([closing])

    def _leave(self, hang: Sequence[WorkerThread]) -> None:
        # Kept, for Qt aborts the process over a thread that is destroyed while it runs.
        self._stuck = [*(each for each in self._stuck if each.isRunning()), *hang]
        for thread in hang:
            logger.error("%s hangs in the library and was left behind", thread.name)


def _stands(channel: tuple[Device, int]) -> bool:
    device, number = channel
    state = device.container.state(number)
    return state is None or not state.in_motion


CLOSED: Final = "MiCo is closed"
_LOOK_S: Final = 0.2
WATCHED_AGAIN: Final = (
    "stopped: it is checked for collisions again, and this movement began without; give it anew"
)


class Mode(StrEnum):
    """What `DeviceManager` is at."""

    CLOSED = "closed"
    INITIALISATION = "initialisation"
    RUN_TIME = "run-time"
    FAILED = "failed"


class DeviceManager(QObject):
    """Initialises the controller, makes a `Device` and a `DeviceListener` for each device.

    Calls block for as long as the hardware takes and are made by the application's thread or by
    tests; `stop` and `order` may be called from any thread and return at once.

    Signals
    -------
    changed()
        Mode, devices or the list of what is missing changed.
    device_lost(DeviceLost)
        A device cannot be reached any more.
    group_refused(MoveVerdict)
        Movements that were to begin together were refused; in the thread of who asked.
    group_started(GroupStarted)
        Several axes were started back to back; in the thread of a device.
    links_changed()
        Axes were linked, or are linked no more.
    position_changed, state_changed, movement_begun, movement_ended, movement_refused
        Those of every `Device` there is or comes to be, in its thread.
    """

    changed = Signal()
    device_lost = Signal(object)
    group_refused = Signal(object)
    group_started = Signal(object)
    links_changed = Signal()
    position_changed = Signal(object)
    state_changed = Signal(object)
    movement_begun = Signal(object)
    movement_ended = Signal(object)
    movement_refused = Signal(object)

    def __init__(
        self,
        controller: Controller,
        settings: MicoSettings,
        *,
        clock: Clock,
        policy: FailurePolicy,
        checker: CollisionChecker | None = None,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self.settings = settings
        self._devices: dict[int, Device] = {}
        self._addresses: dict[str, Channel] = {}
        self._missing: tuple[str, ...] = ()
        self.controller = controller
        self.clock = clock
        self.latch = StopLatch()
        self.lease = Lease()
        self.links = LinkTable(settings.link)
        self.links.subscribe(self.links_changed.emit)
        self._policy = policy
        self._busy = RLock()
        self._mode = Mode.CLOSED
        self._closed = False
        self._threads = DeviceThreads(controller, settings.watch, policy)
        self.gate = self._make_gate(checker or NoCollisionModel())
        self.groups = self._make_groups()
        if self.exemptions is not None:
            self.exemptions.on_watched_again = self._on_watched_again
        self._arrange({})

    def _make_gate(self, checker: CollisionChecker) -> Gate:
        return Gate(
            latch=self.latch,
            lease=self.lease,
            checker=checker,
            rules=Limits.of(self.settings),
            states=self.states,
            regions={name: Interval(*at) for name, at in self.settings.start_regions.items()},
            links=self.links.partners,
        )

    def _make_groups(self) -> GroupOrders:
        return GroupOrders(
            self,
            gate=self.gate,
            links=self.links,
            lease=self.lease,
            check_ready=self._check_ready,
            on_refused=self.group_refused.emit,
            on_started=self.group_started.emit,
        )

    # What there is

    @property
    def mode(self) -> Mode:
        """What the manager is at."""
        return self._mode

    @property
    def ready(self) -> bool:
        """True while axes can be moved."""
        return self._mode is Mode.RUN_TIME

    @property
    def exemptions(self) -> Exemptions | None:
        """What is left out of the collision check; None without a collision model."""
        checker = self.gate.checker
        return checker if isinstance(checker, Exemptions) else None

    @property
    def missing(self) -> tuple[str, ...]:
        """What was configured and not found, or was lost, a line each."""
        return self._missing

    @property
    def devices(self) -> Mapping[int, Device]:
        """The devices by index, also those configured and not found."""
        return dict(self._devices)

    def names(self) -> list[str]:
        """Return the names of all axes: those configured, in their order, then any others."""
        configured = [each.name for each in self.settings.positioner]
        return [*configured, *(name for name in self._addresses if name not in configured)]

    def address(self, name: str) -> Channel:
        """Return where an axis is connected.

        Raises
        ------
        UnknownAxisError
            There is none of that name.
        """
        try:
            return self._addresses[name]
        except (KeyError, TypeError):
            raise UnknownAxisError(name, self.names()) from None

    def state(self, name: str) -> PositionerState:
        """Return the state of an axis; raises `UnknownAxisError`."""
        address = self.address(name)
        state = self._devices[address.device].container.state(address.channel)
        return state if state is not None else self._looked_for(name)

    def _looked_for(self, name: str) -> PositionerState:
        """Return the state of a configured axis that has not answered yet."""
        for settings in self.settings.positioner:
            if settings.name == name:
                return PositionerState(
                    name=name,
                    address=settings.address,
                    kind=settings.positioner_kind,
                    unit=settings.unit,
                    limits=settings.limits,
                    error="it is being looked for",
                    present=False,
                )
        raise UnknownAxisError(name, self.names())

    def states(self) -> dict[str, PositionerState]:
        """Return the state of every axis by name."""
        return {
            state.name: state
            for device in list(self._devices.values())
            for state in device.container.states()
        }

    def positions(self) -> dict[str, float] | None:
        """Return the position of every axis in gate coordinates; None while one is unknown."""
        positions: dict[str, float] = {}
        for state in self.states().values():
            if state.position is None or state.confidence is Confidence.UNKNOWN:
                return None
            positions[state.name] = state.position
        return positions

    def device(self, name: str) -> Device:
        """Return the device that drives an axis; raises `UnknownAxisError`."""
        return self._devices[self.address(name).device]

    def connect_device_commander(
        self,
        index: int,
        commander: DeviceCommander,
        kind: CommanderType = CommanderType.INPUT_OUTPUT,
    ) -> None:
        """Join a commander to the device `index`, parting it from any other (Fig. 6.4).

        The connections are direct: a command goes into the device's queue in the caller's
        thread, so that no event loop is needed to make a move.

        Raises
        ------
        NotAvailable
            There is no such device.
        """
        device = self._devices.get(index)
        if device is None:
            raise NotAvailable(f"there is no device {index}")
        commander.attach(device, kind, self.latch)

    def usual_frequency_hz(self, name: str) -> int:
        """Return the closed-loop frequency limit that is set on an axis."""
        found = self.device(name).container.positioner(self.address(name).channel)
        own_hz = None if found is None else found.frequency_hz
        return own_hz or self.settings.defaults.closed_loop_frequency_hz

    def _memories(self) -> dict[str, Memory]:
        """Return what the user has set on each axis, which outlives the search for devices."""
        return {
            name: memory
            for device in self._devices.values()
            for name, memory in device.container.memories().items()
        }

    def _note_missing(self, reason: str) -> None:
        self._missing = (*self._missing, reason)

    def _note_channels(self, device: Device) -> None:
        """Take in the axes that were found on a device and are not configured."""
        for channel in device.container.channels():
            state = device.container.state(channel)
            if state is not None:
                self._addresses.setdefault(state.name, Channel(device.index, channel))

    # Starting and ending

    def initialize_devices(self) -> None:
        """Find and open the hardware, start the threads, wait until every channel is known.

        Raises
        ------
        DeviceError
            No device at all, or the library failed; nothing is left open.
        """
        with self._busy:
            if self._closed:
                raise NotConnectedError(CLOSED)
            self._threads.check_none_hangs()
            self._set_mode(Mode.INITIALISATION)
            self.gate.checker.start()
            try:
                with self._threads.opening():
                    library_index = open_devices(self.controller, self.settings.all_serials)
                    if self._closed:  # nobody waited for it any longer
                        raise NotConnectedError(CLOSED)
            except DeviceError:
                self.controller.close()
                self._arrange({})
                self._set_mode(Mode.CLOSED if self._closed else Mode.FAILED)
                raise
            self._arrange(library_index)
            self.changed.emit()  # commanders join the new devices before anybody may use them
            self._start(library_index)
            self._set_mode(Mode.RUN_TIME)

    def _arrange(self, library_index: Mapping[int, int]) -> None:
        """Take what is present, and what is only configured, in place of what was there."""
        found = take_inventory(
            self.controller,
            self.settings,
            library_index,
            self._memories(),
            searched=self._mode is not Mode.CLOSED,
        )
        devices = {number: self._make_device(each) for number, each in found.containers.items()}
        # Exchanged whole, for other threads look things up meanwhile.
        self._devices, self._addresses, self._missing = devices, found.addresses, found.missing

    def _make_device(self, container: DeviceDataContainer) -> Device:
        device = Device(
            self.controller,
            container,
            gate=self.gate,
            clock=self.clock,
            settings=self.settings,
            policy=self._policy,
        )
        direct = Qt.ConnectionType.DirectConnection
        device.lost.connect(self._on_device_lost, direct)
        device.stop_late.connect(self._on_stop_late, direct)
        device.position_changed.connect(self.position_changed, direct)
        device.state_changed.connect(self.state_changed, direct)
        device.movement_begun.connect(self.movement_begun, direct)
        device.movement_ended.connect(self.movement_ended, direct)
        device.movement_refused.connect(self.movement_refused, direct)
        return device

    def _start(self, numbers: Collection[int]) -> None:
        devices = [self._devices[number] for number in numbers]
        self._threads.start(devices)
        for device in devices:
            self._await_discovery(device)
        for device in devices:
            for state in device.container.states():
                if state.present and state.position is not None:
                    self.gate.release_axis(state.name)  # it stands, and was read just now

    def _await_discovery(self, device: Device) -> None:
        if not device.wait_until_discovered(self.settings.watch.answer_s):
            reason = f"device {device.index} did not say what is connected to it"
            logger.error("%s", reason)
            self._note_missing(reason)
        self._note_channels(device)

    def shut_down(self) -> None:
        """Stop everything, release the hold, end the threads, close the library; any mode."""
        with self._busy:
            self.latch.void_grants()
            self._threads.end(self._devices.values())
            for device in self._devices.values():
                device.container.lose(CLOSED)
            self._threads.close_library()
            self._set_mode(Mode.CLOSED)

    def close(self) -> None:
        """Shut down for good: nothing opens the hardware again; any mode.

        A library that does not return from opening is left behind.
        """
        self._closed = True
        until_s = WALL.now_s() + JOIN_TIMEOUT_S
        while not self._busy.acquire(timeout=_LOOK_S):
            if self._threads.opens and WALL.now_s() > until_s:
                logger.error("opening the devices does not return; it was left behind")
                break
        else:
            try:
                self.shut_down()
            finally:
                self._busy.release()
        self.gate.checker.close()

    def rescan(self) -> None:
        """Close everything and look again for the hardware; raises as `initialize_devices`.

        Raises
        ------
        NotAvailable
            An axis is moving.
        NotConnectedError
            The library hangs.
        """
        with self._busy:
            hanging = [each.stall for each in self._devices.values() if each.stall]
            if hanging:
                raise NotConnectedError("; ".join(hanging))
            moving = [state.name for state in self.states().values() if state.in_motion]
            if moving:
                raise NotAvailable(f"{', '.join(moving)} is moving; stop it before a rescan")
            self.shut_down()
            self.initialize_devices()

    def _set_mode(self, mode: Mode) -> None:
        self._mode = mode
        self.changed.emit()

    def _check_ready(self) -> None:
        if self._mode is not Mode.RUN_TIME:
            raise refusal(
                refuse(Reason.DEVICE, f"MiCo is not ready ({self._mode}); wait, or rescan")
            )

    # Stopping

    def stop(self, reason: str = "stop") -> None:
        """Stop every channel now and stay stopped until `reset_stop`; any thread.

        It overtakes every queue and takes no lock that a hardware call can hold. The device
        threads repeat it after the call they may be in; they are woken last, so that they don't
        compete for the interpreter, and look at the latch themselves should a call here hang.
        """
        reason = reason_of(reason)
        self.latch.set(reason)
        error = refusal(refuse(Reason.STOPPED, f"stopped: {reason}"))
        devices = list(self._devices.values())
        with urgent(kept=self.controller.capabilities.keeps_interpreter):
            self._threads.stop_channels(each for each in devices if each.isRunning())
        for device in devices:
            device.stop_later(error)
        logger.warning("stop: %s", reason)
        self.latch.announce()

    def reset_stop(self) -> None:
        """Allow motion again."""
        self.latch.reset()
        logger.info("The stop was reset: movements are allowed again")

    def _on_watched_again(self, axes: Set[str], pairs: Set[BodyPair]) -> None:
        """Stop what moves only by leave of an exemption that has ended; any thread.

        What is under way, or reserved, is judged without it.
        """
        checker = self.gate.checker
        movers = checker.movers(pairs) if isinstance(checker, CollisionManager) and pairs else set()
        affected = self.gate.held().keys() & {*axes, *movers}
        if not affected or checker.check(self.gate.spans(), advice=False).allowed:
            return
        for name in sorted(self.gate.expire(affected)):
            self.device(name).halt(self.address(name).channel, WATCHED_AGAIN)

    def _on_stop_late(self) -> None:
        """Announce a stop whose caller hangs in the library; thread of the watch."""
        if self.latch.state.latched:
            self.latch.announce()

    def _on_device_lost(self, lost: DeviceLost) -> None:
        self._note_missing(lost.reason)
        if lost.in_motion:
            self.stop(f"{lost.reason}; it was moving")
        self._policy.report(_LostError(lost.reason), f"device {lost.index}")
        self.device_lost.emit(lost)
        self.changed.emit()


class _LostError(CosmicError):
    """Carries the loss of a device to the failure policy."""
