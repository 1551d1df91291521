"""`Teleoperation`: one input device steers positioners by one profile (M9, thesis MiCo4)."""

import logging
from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from threading import RLock
from typing import Protocol

from cosmic.frame.arguments import checked_class
from cosmic.frame.config import user_file
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.core.motion.stop_latch import StopState
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.core.teleoperation.coupling import ForceCoupling
from cosmic.mico.core.teleoperation.driver import AxisDriver, SteeredAxis
from cosmic.mico.core.teleoperation.input_thread import InputThread, Steering
from cosmic.mico.core.teleoperation.mapping import Converter, ProfileMapping
from cosmic.mico.core.teleoperation.profile_book import ProfileBook
from cosmic.mico.core.teleoperation.settings import TeleoperationProfileSettings
from cosmic.mico.core.teleoperation.state import (
    RateMeter,
    TeleoperationPhase,
    TeleoperationState,
)
from cosmic.mico.hw.input_device import InputDevice, InputInfo
from cosmic.mico.hw.input_sources import InputSources, make_sources

logger = logging.getLogger(__name__)

SOURCE = "teleoperation"


class SteeredPlatform(Protocol):
    """The axes that an input device may steer; `Mico` of the scripted API, wherever they are."""

    @property
    @abstractmethod
    def settings(self) -> MicoSettings:
        """What the platform file says."""

    @property
    @abstractmethod
    def simulated(self) -> bool:
        """True when no hardware moves."""

    @property
    @abstractmethod
    def ready(self) -> bool:
        """True while axes can be moved."""

    @property
    @abstractmethod
    def stop_state(self) -> StopState:
        """Whether motion is stopped, and why."""

    @abstractmethod
    def __getitem__(self, name: str) -> SteeredAxis:
        """Return an axis; raises `UnknownAxisError`."""

    @abstractmethod
    def stop(self, reason: str = "stop") -> None:
        """Stop every axis now, past every queue."""

    @abstractmethod
    def follow_stop(self, listener: Callable[[StopState], object]) -> Callable[[], None]:
        """Call `listener` when motion is stopped or allowed again; returns what ends it."""


@checked_class
class Teleoperation:
    """Starts and ends the steering by an input device; any thread.

    A stop, a lost device or a failed thread ends it, and it must be started again.

    Attributes
    ----------
    busy : callable
        Returns why nothing is steered now, such as an operation that moves the axes itself; empty
        where nothing speaks against it. Asked in the thread that reads the device.
    """

    def __init__(
        self,
        platform: SteeredPlatform,
        policy: FailurePolicy,
        sources: InputSources | None = None,
        folder: Path | None = None,
    ) -> None:
        self._platform = platform
        self._policy = policy
        self.settings = platform.settings.teleoperation
        self.sources = sources or make_sources(
            self.settings.inputs, self.settings.input, simulated=platform.simulated
        )
        self.coupling: ForceCoupling | None = None
        self.busy: Callable[[], str] = str
        self._book = ProfileBook(self.settings, user_file(self.settings.profiles, folder))
        for text in self._book.misfits(platform.settings.kinds):
            logger.warning("%s: %s", self._book.path, text)
        self._lock = RLock()
        self._thread: InputThread | None = None
        self._device: InputDevice | None = None
        self._stuck: list[InputThread] = []
        self._focus = True
        self._closed = False
        self._over = TeleoperationState(TeleoperationPhase.OFF)
        self._end_stops = platform.follow_stop(self._on_stop)

    # What there is

    def devices(self) -> tuple[InputInfo, ...]:
        """Return what is plugged in now."""
        return self.sources.devices()

    @property
    def device(self) -> InputDevice | None:
        """The device in use."""
        return self._device

    @property
    def state(self) -> TeleoperationState:
        """How it is now."""
        thread = self._thread
        return thread.state if thread is not None else self._over

    @property
    def profiles(self) -> tuple[TeleoperationProfileSettings, ...]:
        """The profiles as they are now, in their order."""
        return self._book.profiles

    def profile(self, name: str) -> TeleoperationProfileSettings:
        """Return a profile; raises `NotAvailable` where there is none of that name."""
        return self._book[name]

    def reset_profile(self, name: str) -> TeleoperationProfileSettings:
        """Use a profile as the platform file has it; returns it.

        Raises
        ------
        NotAvailable
            The platform file has none of that name.
        ConfigError
            As `set_profile`.
        """
        return self._use(self._book.given(name))

    def set_profile(self, profile: TeleoperationProfileSettings) -> None:
        """Use `profile` from now on, in place of the one of its name.

        It is kept in the file of `[mico.teleoperation] profiles`; the platform file stays as it
        is. Steering goes on with it once the sticks were at rest.

        Raises
        ------
        ConfigError
            It does not fit the positioners there are, or moves others while it steers.
        """
        wrong = profile.mistakes(self._platform.settings.kinds)
        if wrong:
            raise ConfigError("\n".join(wrong))
        with self._lock:
            thread = self._thread
            running = thread is not None and self.state.profile == profile.name
            if thread is not None and running and not thread.stopped:
                mapping = self._mapping(profile)
                before = self._mapping(self._book[profile.name])
                if set(mapping.positioners) - set(before.positioners):
                    raise ConfigError(
                        f"profile {profile.name!r}: stop before it moves other positioners"
                    )
                thread.remap(mapping, self._converter(mapping))
            self._book.put(profile)

    def edit_axis(self, name: str, index: int, **changes: object) -> TeleoperationProfileSettings:
        """Change one row of a profile's mapping and use it; returns the profile.

        Raises
        ------
        ConfigError
            As `set_profile`; or a value is none that the key takes.
        """
        return self._use(self._book.edited_axis(name, index, changes))

    def edit_profile(self, name: str, **changes: object) -> TeleoperationProfileSettings:
        """Change keys of a profile and use it; returns the profile.

        Raises
        ------
        ConfigError
            As `set_profile`; or a value is none that the key takes.
        """
        return self._use(self._book.edited(name, changes))

    def _use(self, profile: TeleoperationProfileSettings) -> TeleoperationProfileSettings:
        self.set_profile(profile)
        return profile

    def check_inputs(self, key: str, profile: str) -> None:
        """See that a device can steer something: else it would be armed, and move nothing.

        Raises
        ------
        NotAvailable
            The device has none of the inputs of the profile, or there is no such profile.
        """
        wanted = [each.input for each in self.profile(profile).axis]
        device = next((each for each in self.devices() if each.key == key), None)
        there = () if device is None else device.axes
        if device is not None and there and wanted and not set(wanted) & set(there):
            raise NotAvailable(
                f"{device.title} has none of the inputs of profile {profile!r}, "
                f"{', '.join(wanted)}; it has {', '.join(there)}. Choose another device or profile"
            )

    # Running

    def start(self, device: str | InputDevice, profile: str) -> None:
        """Begin to steer: `device` is a key of `devices`, or an open device.

        Nothing moves before the sticks were at rest. What ran before is ended.

        Raises
        ------
        NotAvailable
            There is no such profile, motion is stopped, or MiCo is not ready.
        NotConnectedError
            The device is not there.
        """
        chosen = self.profile(profile)
        with self._lock:  # of two that start at once, the second ends what the first began
            self.stop()
            self._refuse_if_not_ready()
            opened = self.sources.open(device) if isinstance(device, str) else device
            try:
                steering = self._steering(opened, chosen)
            except BaseException:
                opened.close()
                raise
            self._device = opened
            if self.coupling is not None:
                self.coupling.begin()
            thread = InputThread(steering, self._policy)
            thread.set_focus(self._focus)
            self._thread = thread
            thread.start()
        logger.info("teleoperation: %s steers %r", opened.info.title, profile)

    def _refuse_if_not_ready(self) -> None:
        stop = self._platform.stop_state
        if self._closed or not self._platform.ready:
            raise NotAvailable("MiCo is not ready; wait, or rescan")
        if stop.latched:
            raise NotAvailable(f"motion is stopped ({stop.reason}); reset the stop first")
        problem = self.coupling.problem() if self.coupling is not None else ""
        if problem:
            raise NotAvailable(problem)

    def _steering(self, device: InputDevice, profile: TeleoperationProfileSettings) -> Steering:
        mapping, commands = self._mapping(profile), RateMeter()
        platform, coupling = self._platform, self.coupling
        drivers = {
            name: AxisDriver(
                platform[name],
                self.settings,
                source=SOURCE,
                commands=commands,
                busy=lambda: self.busy(),
            )
            for name in mapping.positioners
        }
        return Steering(
            device=device,
            mapping=mapping,
            converter=self._converter(mapping),
            drivers=drivers,
            settings=self.settings,
            stop_state=lambda: platform.stop_state,
            stop=platform.stop,
            commands=commands,
            slowed=coupling.slowed if coupling is not None else lambda: 1.0,
        )

    def _mapping(self, profile: TeleoperationProfileSettings) -> ProfileMapping:
        settings = self._platform.settings
        jog = settings.jog
        usual = {
            "linear": jog.speed_um_s,
            "rotary": jog.speed_deg_s,
            "open-loop": float(jog.frequency_hz),
        }
        speeds = {name: usual[kind] for name, kind in settings.kinds.items()}
        return ProfileMapping(profile, speeds, lambda name: self._platform[name].details.position)

    def _converter(self, mapping: ProfileMapping) -> Converter:
        return mapping if self.coupling is None else self.coupling.make_converter(mapping)

    def stop(self) -> None:
        """End the steering and give the device back; harmless when nothing runs."""
        with self._lock:
            thread, self._thread = self._thread, None
            if thread is None:
                return
            thread.request_end()
            if not thread.join(1.0):
                logger.error("the input device hangs; what it moved was stopped without it")
                self._stuck.append(thread)  # a thread that runs must not be destroyed
            self._over = replace(
                thread.state,
                phase=TeleoperationPhase.OFF,
                inputs=None,
                velocities={},
                refused={},
            )
            if thread.stopped:
                self._over = replace(self._over, phase=TeleoperationPhase.STOPPED)
            self._device = None
            if self.coupling is not None:
                self.coupling.end()

    def set_focus(self, focus: bool) -> None:
        """Say whether the window has the operator's attention; nothing moves while it has not."""
        self._focus = focus
        thread = self._thread
        if thread is not None:
            thread.set_focus(focus)

    def feel(self, force: Mapping[str, float]) -> None:
        """Have the hand feel a force by axis of the device, -1 to 1; returns at once."""
        thread = self._thread
        if thread is not None:
            thread.feel(force)

    def _on_stop(self, state: StopState) -> None:
        """End at once; the thread sees the latch as well, but may just wait for its next look."""
        thread = self._thread
        if state.latched and thread is not None:
            thread.look_now()

    def close(self) -> None:
        """End the steering for good and give all devices back."""
        self._closed = True
        self._end_stops()
        self.stop()
        self.sources.close()
