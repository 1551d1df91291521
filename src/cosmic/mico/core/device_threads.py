"""`DeviceThreads`: starts the threads of the devices, stops their channels, and ends them."""

import logging
from collections.abc import Collection, Iterable

from cosmic.frame.errors import DeviceError, NotConnectedError
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.core.device import Device
from cosmic.mico.core.device_listener import DeviceListener
from cosmic.mico.core.introduction import CHANNELS
from cosmic.mico.core.settings import WatchSettings
from cosmic.mico.hw.interface import Controller

logger = logging.getLogger(__name__)


class DeviceThreads:
    """Owns the `DeviceListener` of each device, and remembers threads that did not end.

    `stop_channels` may be called from any thread, the rest by the one that starts and ends.
    """

    def __init__(self, controller: Controller, watch: WatchSettings, policy: FailurePolicy) -> None:
        self._controller = controller
        self._watch = watch
        self._policy = policy
        self._listeners: dict[int, DeviceListener] = {}
        self._stuck: list[Device] = []

    def check_none_hangs(self) -> None:
        """Raise `NotConnectedError` while a thread of an earlier run still uses the library."""
        stuck = [device.name for device in self._stuck if device.isRunning()]
        if stuck:
            raise NotConnectedError(
                f"{', '.join(stuck)} still hangs in the library; start the program again"
            )

    def start(self, devices: Collection[Device]) -> None:
        """Start a listener and the thread of each of `devices`."""
        channels = len(devices) * len(CHANNELS)
        for device in devices:
            device.set_poll_period(
                max(1 / self._watch.poll_hz, channels / self._watch.poll_total_hz)
            )
            listener = DeviceListener(
                self._controller, device.container, self._policy, on_lost=device.lose
            )
            self._listeners[device.index] = listener
            listener.start()
            device.begin()

    def stop_channels(self, device: Device) -> None:
        """Stop every channel of a device, past its thread."""
        for channel in device.container.channels():
            try:
                self._controller.stop(device.container.address(channel))
            except DeviceError as exc:
                logger.error("device %d channel %d: stop failed: %s", device.index, channel, exc)

    def end(self, devices: Iterable[Device]) -> None:
        """Stop every channel, end the threads that run, and stop every channel once more."""
        running = [device for device in devices if device.isRunning()]
        for device in running:  # past the threads, one of which may hang in the library
            self.stop_channels(device)
        for device in running:
            device.request_end()
        self._stuck = [device for device in running if not device.join()]
        for device in self._stuck:
            logger.error("%s hangs in the library and was left behind", device.name)
        for device in running:
            self.stop_channels(device)
        for listener in self._listeners.values():
            listener.request_end()
        for listener in self._listeners.values():
            listener.join()
        self._listeners.clear()
