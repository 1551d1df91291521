"""`DeviceManager`: finds the devices, owns their threads, and stops them all (thesis 6.1)."""

import logging
from collections.abc import Collection, Mapping
from enum import StrEnum
from threading import RLock
from typing import Final

from PySide6.QtCore import QObject, Qt, Signal

from cosmic.frame.clock import Clock
from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    NotAvailable,
    NotConnectedError,
    UnknownAxisError,
    refusal,
)
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.collision.checker import CollisionChecker, NoCollisionModel
from cosmic.mico.core.collision.exemptions import Exemptions
from cosmic.mico.core.data_container import NO_DEVICE, DeviceDataContainer, Memory
from cosmic.mico.core.device import Device
from cosmic.mico.core.device_commander import CommanderType, DeviceCommander, join
from cosmic.mico.core.device_listener import DeviceListener
from cosmic.mico.core.gate import Gate, Request
from cosmic.mico.core.group_start import GroupStart
from cosmic.mico.core.introduction import CHANNELS
from cosmic.mico.core.lease import Lease
from cosmic.mico.core.links import LinkTable
from cosmic.mico.core.messages import DeviceLost
from cosmic.mico.core.movement import Movement
from cosmic.mico.core.numbering import library_indices, serials_to_open
from cosmic.mico.core.orders import Interval, Motion, Order
from cosmic.mico.core.positioner import Confidence, PositionerState
from cosmic.mico.core.rules import Limits
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.core.stop_latch import StopLatch
from cosmic.mico.core.together import frequencies, give_up_together, with_linked
from cosmic.mico.hw.interface import Channel, Controller

logger = logging.getLogger(__name__)

CLOSED: Final = "MiCo is closed"


class Mode(StrEnum):
    """What the manager is at."""

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
    """

    changed = Signal()
    device_lost = Signal(object)
    group_refused = Signal(object)
    group_started = Signal(object)
    links_changed = Signal()

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
        self.controller = controller
        self.settings = settings
        self.clock = clock
        self.latch = StopLatch()
        self.lease = Lease()
        self.links = LinkTable()
        for link in settings.link:
            self.links.add(link.first, link.second, link.ratio)
        self.links.subscribe(self.links_changed.emit)
        self._policy = policy
        self._busy = RLock()
        self._devices: dict[int, Device] = {}
        self._listeners: dict[int, DeviceListener] = {}
        self._addresses: dict[str, Channel] = {}
        self._missing: tuple[str, ...] = ()
        self._mode = Mode.CLOSED
        self._closed = False
        self._stuck: list[Device] = []
        steps = {"um": settings.defaults.largest_step_um, "deg": settings.defaults.largest_step_deg}
        self.gate = Gate(
            latch=self.latch,
            lease=self.lease,
            checker=checker or NoCollisionModel(),
            rules=Limits(largest_step=steps, stale_s=settings.watch.stale_s),
            states=self.states,
            regions={
                each.name: Interval(*each.start_region)
                for each in settings.positioner
                if each.start_region is not None
            },
            links=self.links.partners,
        )
        self._arrange({})

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
            stuck = [device.name for device in self._stuck if device.isRunning()]
            if stuck:
                raise NotConnectedError(
                    f"{', '.join(stuck)} still hangs in the library; start the program again"
                )
            self._set_mode(Mode.INITIALISATION)
            self.gate.checker.start()
            try:
                wanted = self.settings.serials
                identities = self.controller.open(serials_to_open(self.controller, wanted))
            except DeviceError:
                self.controller.close()
                self._arrange({})
                self._set_mode(Mode.FAILED)
                raise
            library_index = library_indices(self.controller, wanted, identities)
            self._arrange(library_index)
            self.changed.emit()  # commanders join the new devices before anybody may use them
            self._start(library_index)
            self._set_mode(Mode.RUN_TIME)

    def _arrange(self, library_index: Mapping[int, int]) -> None:
        """Make containers and devices for what is present and for what is only configured."""
        configured = {each.device for each in self.settings.positioner}
        hold_s = self.settings.defaults.hold
        devices: dict[int, Device] = {}
        addresses: dict[str, Channel] = {}
        missing: list[str] = []
        for number in sorted(configured | set(library_index)):
            here = {
                each.channel: each for each in self.settings.positioner if each.device == number
            }
            present = number in library_index
            at = library_index.get(number, number)
            container = DeviceDataContainer(number, here, hold_s, library_index=at)
            container.remember(self._memories())
            if not present:
                for channel in here:
                    container.settle(channel, None, NO_DEVICE)
                if self._mode is not Mode.CLOSED:
                    names = ", ".join(each.name for each in here.values())
                    missing.append(f"device {number} was not found ({names})")
            devices[number] = self._make_device(container)
            for positioner in here.values():
                addresses[positioner.name] = positioner.address
        # Exchanged whole, for other threads look things up meanwhile.
        self._devices, self._addresses, self._missing = devices, addresses, tuple(missing)

    def _memories(self) -> dict[str, Memory]:
        """Return what the user has set on each axis, which outlives the search for devices."""
        return {
            name: memory
            for device in self._devices.values()
            for name, memory in device.container.memories().items()
        }

    def _make_device(self, container: DeviceDataContainer) -> Device:
        device = Device(
            self.controller,
            container,
            gate=self.gate,
            clock=self.clock,
            settings=self.settings,
            policy=self._policy,
        )
        device.lost.connect(self._on_device_lost, Qt.ConnectionType.DirectConnection)
        return device

    def _start(self, numbers: Collection[int]) -> None:
        channels = len(numbers) * len(CHANNELS)
        watch = self.settings.watch
        for number in numbers:
            device = self._devices[number]
            device.set_poll_period(max(1 / watch.poll_hz, channels / watch.poll_total_hz))
            listener = DeviceListener(
                self.controller, device.container, self._policy, on_lost=device.lose
            )
            self._listeners[number] = listener
            listener.start()
            device.begin()
        for number in numbers:
            self._await_introduction(self._devices[number])
        for number in numbers:
            for state in self._devices[number].container.states():
                if state.present and state.position is not None:
                    self.gate.release_axis(state.name)  # it stands, and was read just now

    def _await_introduction(self, device: Device) -> None:
        if not device.wait_until_introduced(self.settings.watch.answer_s):
            reason = f"device {device.index} did not tell what is connected to it"
            logger.error("%s", reason)
            self._missing = (*self._missing, reason)
        for channel in device.container.channels():
            state = device.container.state(channel)
            if state is not None:
                self._addresses.setdefault(state.name, Channel(device.index, channel))

    def shut_down(self) -> None:
        """Stop everything, release the hold, end the threads, close the library; any mode."""
        with self._busy:
            self.latch.void_grants()
            running = [device for device in self._devices.values() if device.isRunning()]
            for device in running:  # past the threads, one of which may hang in the library
                self._stop_channels(device)
            for device in running:
                device.request_end()
            self._stuck = [device for device in running if not device.join()]
            for device in self._stuck:
                logger.error("%s hangs in the library and was left behind", device.name)
            for device in running:
                self._stop_channels(device)
            for listener in self._listeners.values():
                listener.request_end()
            for listener in self._listeners.values():
                listener.join()
            self._listeners.clear()
            for device in self._devices.values():
                device.container.lose(CLOSED)
            self.controller.close()
            self._set_mode(Mode.CLOSED)

    def close(self) -> None:
        """Shut down for good: nothing opens the hardware again; any mode."""
        self._closed = True
        self.shut_down()
        self.gate.checker.close()

    def rescan(self) -> None:
        """Close everything and look again for the hardware; raises as `initialize_devices`.

        Raises
        ------
        NotAvailable
            An axis is moving.
        """
        with self._busy:
            moving = [state.name for state in self.states().values() if state.in_motion]
            if moving:
                raise NotAvailable(f"{', '.join(moving)} is moving; stop it before a rescan")
            self.shut_down()
            self.initialize_devices()

    def _set_mode(self, mode: Mode) -> None:
        self._mode = mode
        self.changed.emit()

    # Run time

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
        join(device, commander, kind)

    def check(self, motions: Mapping[str, Motion], *, consent: bool = False) -> MoveVerdict:
        """Return what the gate says to all of `motions` together, without moving anything."""
        self._addressed(motions)
        together = with_linked(motions, self.links, self)
        return self.gate.check(self._requests(together, consent=consent))

    def order_together(
        self,
        motions: Mapping[str, Motion],
        *,
        source: str,
        consent: bool = False,
        linked: bool = True,
        match_arrival: bool = False,
        follows: Mapping[str, Movement] | None = None,
    ) -> dict[str, Order]:
        """Decide `motions` together and start them back to back, or none of them.

        Parameters
        ----------
        linked : bool
            Axes linked to those named move with them; False moves those named only.
        match_arrival : bool
            Slow the axes down to the one that takes longest, so that all arrive together.
        follows : mapping of Movement
            By axis, what must be the newest movement there; otherwise this one is void.

        Raises
        ------
        MoveRefused
            The gate refused; nothing moved.
        UnknownAxisError
            One axis does not exist; nothing moved.
        """
        self._addressed(motions)
        if linked:
            named = len(motions)
            motions = with_linked(motions, self.links, self)
            match_arrival = match_arrival or len(motions) > named
        requests = self._requests(motions, consent=consent, alone=not linked)
        if self._mode is not Mode.RUN_TIME:
            raise refusal(
                refuse(Reason.DEVICE, f"MiCo is not ready ({self._mode}); wait, or rescan")
            )
        verdict, grants = self.gate.decide(requests)
        if not verdict.allowed:
            logger.warning("refused (%s): %s", source, verdict)
            self.group_refused.emit(verdict)
            raise refusal(verdict)
        self.links.sent(
            {name: each.target for name, each in grants.items() if each.target is not None}
        )
        speeds: Mapping[str, int] = {}
        if match_arrival:
            speeds = frequencies(grants, self.states(), self.settings.defaults, self._usual_hz)
        start = GroupStart(len(motions), self.group_started.emit) if len(motions) > 1 else None
        token, guard = self.lease.local_token, self.lease.guard()
        orders = {
            name: Order(
                self.address(name).channel,
                motion,
                token,
                source,
                consent,
                grant=grants[name],
                follows=None if follows is None else follows.get(name),
                start=start,
                frequency_hz=speeds.get(name),
                guard=guard,
            )
            for name, motion in motions.items()
        }
        give_up_together(orders)
        for name, order in orders.items():
            self.device(name).submit(order)
        return orders

    def _usual_hz(self, name: str) -> int:
        """Return the closed-loop frequency limit that is set on an axis."""
        found = self.device(name).container.positioner(self.address(name).channel)
        own_hz = None if found is None else found.frequency_hz
        return own_hz or self.settings.defaults.closed_loop_frequency_hz

    def _addressed(self, motions: Mapping[str, Motion]) -> None:
        """Raise `UnknownAxisError` where one of the axes does not exist."""
        for name in motions:
            self.address(name)

    def _requests(
        self, motions: Mapping[str, Motion], *, consent: bool, alone: bool = False
    ) -> list[Request]:
        token, guard = self.lease.local_token, self.lease.guard()
        return [
            Request(name, motion, token, consent, alone=alone, guard=guard)
            for name, motion in motions.items()
        ]

    # Stopping

    def stop(self, reason: str = "stop") -> None:
        """Stop every channel now and stay stopped until `reset_stop`; any thread.

        It overtakes every queue and takes no lock that a hardware call can hold. The device
        threads repeat it after the call they may be in.
        """
        self.latch.set(reason)
        error = refusal(refuse(Reason.STOPPED, f"stopped: {reason}"))
        devices = list(self._devices.values())
        for device in devices:
            device.stop_later(error)
        for device in devices:
            if device.isRunning():
                self._stop_channels(device)
        logger.warning("stop: %s", reason)
        self.latch.announce()

    def _stop_channels(self, device: Device) -> None:
        for channel in device.container.channels():
            try:
                self.controller.stop(device.container.address(channel))
            except DeviceError as exc:
                logger.error("device %d channel %d: stop failed: %s", device.index, channel, exc)

    def reset_stop(self) -> None:
        """Allow motion again."""
        self.latch.reset()
        logger.info("stop reset")

    def _on_device_lost(self, lost: DeviceLost) -> None:
        self._missing = (*self._missing, lost.reason)
        if lost.in_motion:
            self.stop(f"{lost.reason}; it was moving")
        self._policy.report(_LostError(lost.reason), f"device {lost.index}")
        self.device_lost.emit(lost)
        self.changed.emit()


class _LostError(CosmicError):
    """Carries the loss of a device to the failure policy."""
