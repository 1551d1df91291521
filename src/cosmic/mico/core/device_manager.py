"""`DeviceManager`: finds the devices, owns their threads, and stops them all (thesis 6.1)."""

import logging
from collections.abc import Collection, Mapping, Set
from threading import RLock
from typing import Final

from PySide6.QtCore import QObject, Signal

from cosmic.frame.clock import Clock
from cosmic.frame.errors import (
    CosmicError,
    DeviceError,
    NotAvailable,
    NotConnectedError,
    refusal,
)
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import urgent
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.collision.checker import CollisionChecker, NoCollisionModel
from cosmic.mico.core.collision.collision_manager import CollisionManager
from cosmic.mico.core.collision.exemptions import Exemptions
from cosmic.mico.core.collision.model import BodyPair
from cosmic.mico.core.device import Device
from cosmic.mico.core.device_inventory import DeviceMaker
from cosmic.mico.core.device_table import DeviceTable
from cosmic.mico.core.device_threads import DeviceThreads
from cosmic.mico.core.gate import Gate
from cosmic.mico.core.lease import Lease
from cosmic.mico.core.links import LinkTable
from cosmic.mico.core.messages import DeviceLost
from cosmic.mico.core.mode import Mode
from cosmic.mico.core.movement import Movement
from cosmic.mico.core.numbering import open_devices
from cosmic.mico.core.orders import Interval, Motion, Order
from cosmic.mico.core.rules import Limits
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.core.stop_latch import StopLatch
from cosmic.mico.core.together import GroupOrders
from cosmic.mico.hw.interface import Controller

logger = logging.getLogger(__name__)

CLOSED: Final = "MiCo is closed"
WATCHED_AGAIN: Final = (
    "stopped: it is checked for collisions again, and this movement began without; give it anew"
)


class DeviceManager(DeviceTable):
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
        super().__init__(settings, parent)
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
        self._maker = DeviceMaker(
            controller,
            gate=self.gate,
            clock=clock,
            settings=settings,
            policy=policy,
            on_lost=self._on_device_lost,
        )
        self._groups = self._make_groups()
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
                library_index = open_devices(self.controller, self.settings.serials)
            except DeviceError:
                self.controller.close()
                self._arrange({})
                self._set_mode(Mode.FAILED)
                raise
            self._arrange(library_index)
            self.changed.emit()  # commanders join the new devices before anybody may use them
            self._start(library_index)
            self._set_mode(Mode.RUN_TIME)

    def _arrange(self, library_index: Mapping[int, int]) -> None:
        """Take what is present, and what is only configured, in place of what was there."""
        searched = self._mode is not Mode.CLOSED
        self._exchange(self._maker.inventory(library_index, self._memories(), searched=searched))

    def _start(self, numbers: Collection[int]) -> None:
        devices = [self._devices[number] for number in numbers]
        self._threads.start(devices)
        for device in devices:
            self._await_introduction(device)
        for device in devices:
            for state in device.container.states():
                if state.present and state.position is not None:
                    self.gate.release_axis(state.name)  # it stands, and was read just now

    def _await_introduction(self, device: Device) -> None:
        if not device.wait_until_introduced(self.settings.watch.answer_s):
            reason = f"device {device.index} did not tell what is connected to it"
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

    def check(self, motions: Mapping[str, Motion], *, consent: bool = False) -> MoveVerdict:
        """Return what the gate says to all of `motions` together, without moving anything."""
        return self._groups.check(motions, consent=consent)

    def order_together(
        self,
        motions: Mapping[str, Motion],
        *,
        source: str,
        consent: bool = False,
        linked: bool = True,
        match_arrival: bool = False,
        follows: Mapping[str, Movement] | None = None,
        slow_hz: Mapping[str, int] | None = None,
    ) -> dict[str, Order]:
        """Decide `motions` together and start them back to back, or none; see `ManagerPort`.

        `slow_hz` limits the steps per second of single axes for this movement.
        """
        return self._groups.order(
            motions,
            source=source,
            consent=consent,
            linked=linked,
            match_arrival=match_arrival,
            follows=follows or {},
            slow_hz=slow_hz,
        )

    def _check_ready(self) -> None:
        if self._mode is not Mode.RUN_TIME:
            raise refusal(
                refuse(Reason.DEVICE, f"MiCo is not ready ({self._mode}); wait, or rescan")
            )

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
        with urgent():
            for device in devices:
                if device.isRunning():
                    self._threads.stop_channels(device)
        logger.warning("stop: %s", reason)
        self.latch.announce()

    def reset_stop(self) -> None:
        """Allow motion again."""
        self.latch.reset()
        logger.info("stop reset")

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

    def _on_device_lost(self, lost: DeviceLost) -> None:
        self._note_missing(lost.reason)
        if lost.in_motion:
            self.stop(f"{lost.reason}; it was moving")
        self._policy.report(_LostError(lost.reason), f"device {lost.index}")
        self.device_lost.emit(lost)
        self.changed.emit()


class _LostError(CosmicError):
    """Carries the loss of a device to the failure policy."""
