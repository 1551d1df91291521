"""A simulated haptic device: a stylus that a virtual hand pushes, and that pushes back."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from threading import RLock
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import NotConnectedError
from cosmic.frame.plugins import NoOptions
from cosmic.mico.hw.input_device import (
    ALWAYS_REPORTS_S,
    Feedback,
    InputBackend,
    InputDevice,
    InputInfo,
    InputKind,
    InputSource,
    InputState,
)

AXES: Final = ("x", "y", "z")
BUTTONS: Final = ("grip", "select")
FORCE_N: Final = 3.3
"""What the motors can do at most; the figure of a common desktop device."""
_STEP_S: Final = 0.001
_LONGEST_S: Final = 0.05


@dataclass(slots=True)
class _Stylus:
    """One axis: a mass between the spring of the hand and the motor; in parts of the reach."""

    place: float = 0.0
    speed: float = 0.0
    hand: float = 0.0
    motor_n: float = 0.0

    REACH_M = 0.08
    MASS_KG = 0.05
    HAND_N_M = 150.0
    DAMPING_NS_M = 6.0

    def go_on(self, duration_s: float) -> None:
        for _ in range(max(1, math.ceil(duration_s / _STEP_S))):
            step_s = min(_STEP_S, duration_s)
            pull_n = self.HAND_N_M * self.REACH_M * (self.hand - self.place) + self.motor_n
            drag_n = self.DAMPING_NS_M * self.REACH_M * self.speed
            self.speed += step_s * (pull_n - drag_n) / (self.MASS_KG * self.REACH_M)
            self.place += step_s * self.speed
            if not -1.0 < self.place < 1.0:
                self.place, self.speed = math.copysign(1.0, self.place), 0.0


class SimHaptic(InputDevice):
    """Position in, force out; `move_hand`, `press`, `freeze` and `unplug` are the test's side.

    Any thread.
    """

    def __init__(self, key: str = "haptic:sim", clock: Clock = WALL) -> None:
        self._clock = clock
        self._lock = RLock()
        self._styli = {axis: _Stylus() for axis in AXES}
        self._pressed = dict.fromkeys(BUTTONS, False)
        self._connected = True
        self._frozen = False
        self._open = False
        self._felt_n = dict.fromkeys(AXES, 0.0)
        self._changes = 0
        self._before_s = clock.now_s()
        self._report = InputState(dict.fromkeys(AXES, 0.0), self._pressed, True, WALL.now_s())
        self._info = InputInfo(
            key=key,
            title="Simulated haptic device",
            kind=InputKind.HAPTIC,
            axes=AXES,
            buttons=BUTTONS,
            feedback=Feedback.FORCE,
            quiet_s=ALWAYS_REPORTS_S,
        )

    @property
    @override
    def info(self) -> InputInfo:
        return self._info

    @property
    def felt_n(self) -> dict[str, float]:
        """The force on the hand by axis, now."""
        return dict(self._felt_n)

    @property
    def changes(self) -> int:
        """How often the force was set so far."""
        return self._changes

    def claim(self) -> None:
        """Give it to one user, plugged in again and at rest.

        Raises
        ------
        NotConnectedError
            Somebody has it.
        """
        with self._lock:
            if self._open:
                raise NotConnectedError(f"{self._info.title} is in use")
            self._open = self._connected = True
            self._frozen = False
            self.move_hand(x=0.0, y=0.0, z=0.0)
            for stylus in self._styli.values():
                stylus.place = stylus.speed = 0.0
            self._before_s = self._clock.now_s()

    def move_hand(self, **places: float) -> None:
        """Take the hand somewhere, -1 to 1 by axis; the stylus follows as a spring would."""
        with self._lock:
            for axis, place in places.items():
                if not -1.0 <= place <= 1.0:
                    raise ValueError(f"{axis}: a hand reaches -1 to 1, not {place!r}")
                self._styli[axis].hand = place

    def press(self, button: str, *, down: bool = True) -> None:
        """Press a button, or let go of it."""
        with self._lock:
            self._pressed[button] = down

    def freeze(self) -> None:
        """Report nothing more."""
        self._frozen = True

    def unplug(self) -> None:
        """Be gone."""
        self._connected = False

    @override
    def poll(self) -> InputState:
        with self._lock:
            if self._frozen:
                return self._report
            now_s = self._clock.now_s()
            duration_s = min(max(0.0, now_s - self._before_s), _LONGEST_S)
            self._before_s = now_s
            for stylus in self._styli.values():
                if duration_s > 0.0:
                    stylus.go_on(duration_s)
            self._report = InputState(
                {axis: stylus.place for axis, stylus in self._styli.items()},
                dict(self._pressed),
                connected=self._connected,
                time_s=WALL.now_s(),
            )
            return self._report

    @override
    def feel(self, force: Mapping[str, float]) -> None:
        with self._lock:
            self._changes += 1
            for axis, stylus in self._styli.items():
                share = force.get(axis, 0.0)
                if not -1.0 <= share <= 1.0:  # a motor gets no force that nobody meant
                    share = 0.0
                stylus.motor_n = self._felt_n[axis] = share * FORCE_N

    @override
    def close(self) -> None:
        with self._lock:
            self.feel({})
            self._open = False


class SimHapticSource(InputSource):
    """Has the one simulated haptic device."""

    def __init__(self, clock: Clock = WALL) -> None:
        self.haptic = SimHaptic(clock=clock)

    @override
    def devices(self) -> tuple[InputInfo, ...]:
        return (self.haptic.info,)

    @override
    def open(self, key: str) -> InputDevice:
        if key != self.haptic.info.key:
            raise NotConnectedError(f"there is no input device {key!r}")
        self.haptic.claim()
        return self.haptic

    @override
    def close(self) -> None:
        """Do nothing: it needs no library."""


def _make(_options: NoOptions, _context: None) -> InputSource:
    return SimHapticSource()


BACKEND: Final = InputBackend(_make, simulated=True)
