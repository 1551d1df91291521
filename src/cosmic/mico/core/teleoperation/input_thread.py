"""`InputThread`: reads an input device and has positioners follow it (M9, thesis 6.3)."""

import logging
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from threading import Event
from typing import ClassVar, Final

from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread
from cosmic.mico.core.motion.stop_latch import StopState
from cosmic.mico.core.teleoperation.driver import AxisDriver
from cosmic.mico.core.teleoperation.mapping import Converter, ProfileMapping
from cosmic.mico.core.teleoperation.settings import TeleoperationSettings
from cosmic.mico.core.teleoperation.state import (
    RateMeter,
    TeleoperationPhase,
    TeleoperationState,
)
from cosmic.mico.hw.input_device import InputDevice, InputState

logger = logging.getLogger(__name__)

NO_FOCUS: Final = "the window is out of focus"


@dataclass
class Steering:
    """What one run of teleoperation consists of; made by `Teleoperation.start`.

    Attributes
    ----------
    mapping : ProfileMapping
        May be exchanged while it runs.
    converter : Converter
        Between inputs and movements; the mapping, or what a station puts in front of it.
    stop_state : callable
        Returns whether motion is stopped.
    stop : callable
        Stops everything, with the reason; for the device's own stop button.
    slowed : callable
        Part of the speed that the force leaves now; for showing.
    """

    device: InputDevice
    mapping: ProfileMapping
    converter: Converter
    drivers: Mapping[str, AxisDriver]
    settings: TeleoperationSettings
    stop_state: Callable[[], StopState]
    stop: Callable[[str], None]
    commands: RateMeter
    slowed: Callable[[], float] = lambda: 1.0


class InputThread(WorkerThread):
    """Polls the device and steers, until the device is lost, something stops it, or it is ended.

    Whatever happens, nothing that it began goes on: it stops what it began before it ends, and
    where it hangs, the dead-man time of each movement runs out in the device threads.
    """

    may_wait: ClassVar[bool] = False

    def __init__(self, steering: Steering, policy: FailurePolicy) -> None:
        super().__init__("input", policy)
        self._steering = steering
        self._wake = Event()
        self._focus = True
        self._phase = TeleoperationPhase.CENTRE
        self._reason = ""
        self._fine = False
        self._pressed: frozenset[str] = frozenset()
        self._inputs: InputState | None = None
        self._velocities: Mapping[str, float] = {}
        self._epoch = steering.stop_state().epoch
        self._force: Mapping[str, float] = {}
        self._force_number = self._felt_number = 0
        self._polls, self._feels = RateMeter(), RateMeter()

    # Any thread

    @property
    def stopped(self) -> bool:
        """True once it ended by itself."""
        return self._phase is TeleoperationPhase.STOPPED

    @property
    def state(self) -> TeleoperationState:
        """How it is now."""
        steering = self._steering
        return TeleoperationState(
            phase=self._phase,
            reason=self._reason,
            device=steering.device.info,
            profile=steering.mapping.profile.name,
            fine=self._fine,
            inputs=self._inputs,
            velocities=self._velocities,
            force=max(self._force.values(), key=abs, default=0.0),
            slowed=steering.slowed(),
            refused={each.name: each.refused for each in steering.drivers.values() if each.refused},
            poll_hz=self._polls.rate_hz,
            command_hz=steering.commands.rate_hz,
            feedback_hz=self._feels.rate_hz,
        )

    def set_focus(self, focus: bool) -> None:
        """Say whether the window that shows it has the operator's attention."""
        self._focus = focus
        self._wake.set()

    def feel(self, force: Mapping[str, float]) -> None:
        """Have the hand feel `force` from the next look on; only the newest counts."""
        self._force = dict(force)
        self._force_number += 1

    def remap(self, mapping: ProfileMapping, converter: Converter) -> None:
        """Go on with another mapping of the same positioners, once the sticks were at rest."""
        self._steering.mapping, self._steering.converter = mapping, converter
        self._phase = TeleoperationPhase.CENTRE

    def look_now(self) -> None:
        """Look again at once."""
        self._wake.set()

    @override
    def request_end(self) -> None:
        super().request_end()
        self._wake.set()

    # The input thread

    @override
    def run_body(self) -> None:
        period_s = 1.0 / self._steering.settings.poll_hz
        try:
            next_s = WALL.now_s()
            while not self.end_requested and not self.stopped:
                self._look()
                now_s = WALL.now_s()
                next_s = max(next_s + period_s, now_s)  # what was missed is not made up for
                self._wake.clear()
                self._wake.wait(max(0.0001, next_s - now_s))
            if not self.stopped:
                self._end("", TeleoperationPhase.OFF)
        except BaseException as exc:
            self._end(f"its thread failed: {exc!r}")
            raise
        finally:
            self._steering.device.close()

    def _look(self) -> None:
        try:
            inputs = self._steering.device.poll()
        except CosmicError as exc:
            self._end(str(exc))
            return
        self._polls.count()
        self._inputs = inputs
        lost = self._loss(inputs)
        if lost:
            self._end(lost)
            return
        pressed = frozenset(name for name, down in inputs.buttons.items() if down)
        newly, self._pressed = pressed - self._pressed, pressed
        self._on_buttons(newly)
        if not self.stopped:
            self._steer(inputs)
            self._give_force()

    def _loss(self, inputs: InputState) -> str:
        """Return why nothing may follow this device any more; empty when it may."""
        stop = self._steering.stop_state()
        if stop.latched or stop.epoch != self._epoch:
            return stop.reason or "everything was stopped"
        if not inputs.connected:
            return "unplugged"
        if not all(-1.0 <= each <= 1.0 for each in inputs.axes.values()):
            return "the device reports invalid values"
        quiet_s = self._steering.device.info.quiet_s
        if quiet_s is not None and self._silent(inputs, quiet_s):
            return f"frozen, no report for {quiet_s:g} s"
        return ""

    def _silent(self, inputs: InputState, quiet_s: float) -> bool:
        """Return True where something is deflected and nothing was reported for too long."""
        moving = any(driver.moving for driver in self._steering.drivers.values())
        deflected = moving or self._steering.mapping.deflected(inputs)
        return deflected and not WALL.now_s() - inputs.time_s <= quiet_s

    def _on_buttons(self, newly: frozenset[str]) -> None:
        profile = self._steering.mapping.profile
        if profile.stop_button in newly:
            self._end("its stop button")
            self._steering.stop(f"button {profile.stop_button} of {self.device_title}")
        if profile.fine_button in newly:
            self._fine = not self._fine
            self._steering.mapping.recentre()
            logger.info("teleoperation: %s", "fine" if self._fine else "coarse")

    @property
    def device_title(self) -> str:
        """What the device calls itself."""
        return self._steering.device.info.title

    def _steer(self, inputs: InputState) -> None:
        steering = self._steering
        if self._may_move(inputs):
            velocities = steering.converter.convert(inputs, fine=self._fine)
        else:
            velocities = dict.fromkeys(steering.drivers, 0.0)
        for name, driver in steering.drivers.items():
            velocity = velocities.get(name, 0.0)
            driver.steer(velocity if math.isfinite(velocity) else 0.0)
        self._velocities = velocities
        if self._phase in (TeleoperationPhase.ARMED, TeleoperationPhase.STEERING):
            moving = any(velocities.values())
            self._phase = TeleoperationPhase.STEERING if moving else TeleoperationPhase.ARMED

    def _may_move(self, inputs: InputState) -> bool:
        """Go through the phases; True where inputs may move something."""
        mapping = self._steering.mapping
        if not self._focus:
            self._phase, self._reason = TeleoperationPhase.PAUSED, NO_FOCUS
            return False
        if self._phase is TeleoperationPhase.PAUSED:
            self._phase, self._reason = TeleoperationPhase.CENTRE, ""
        quiet_s = self._steering.settings.quiet_s
        if self._phase is not TeleoperationPhase.CENTRE and self._silent(inputs, quiet_s):
            # A hand held still, or a device that hangs: only letting go tells them apart.
            self._phase = TeleoperationPhase.CENTRE
            self._reason = f"no change for {quiet_s:g} s"
        if self._phase is TeleoperationPhase.CENTRE:
            if mapping.deflected(inputs):
                return False
            mapping.recentre()
            self._phase, self._reason = TeleoperationPhase.ARMED, ""
        held = mapping.profile.hold_button
        if held and not inputs.buttons.get(held, False):
            mapping.recentre()
            return False
        return True

    def _give_force(self) -> None:
        number = self._force_number
        if number != self._felt_number:
            self._felt_number = number
            self._steering.device.feel(self._force)
            self._feels.count()

    def _end(self, reason: str, phase: TeleoperationPhase = TeleoperationPhase.STOPPED) -> None:
        """Stop what was begun here, then say why."""
        for driver in self._steering.drivers.values():
            driver.release(reason or "teleoperation ended")
        self._phase, self._reason, self._velocities = phase, reason, {}
        if reason:
            logger.warning("teleoperation stopped: %s", reason)
