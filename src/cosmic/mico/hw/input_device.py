"""What an input device is: a gamepad, a joystick, keys, a haptic device, a recording (M9)."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from typing import Final, Protocol

from cosmic.frame.plugins import Backend

ALWAYS_REPORTS_S: Final = 0.05
"""Silence after which a device that reports all the time counts as frozen."""


class InputKind(StrEnum):
    """What kind of thing it is."""

    GAMEPAD = "gamepad"
    JOYSTICK = "joystick"
    KEYBOARD = "keyboard"
    HAPTIC = "haptic"
    RECORDING = "recording"


class Feedback(StrEnum):
    """What the hand can feel through it."""

    NONE = "none"
    RUMBLE = "rumble"
    FORCE = "force"


@dataclass(frozen=True, slots=True)
class InputInfo:
    """What there is to steer with.

    Attributes
    ----------
    key : str
        Names it for `InputSource.open`; the same device keeps its key while it is plugged in.
    axes, buttons : tuple of str
        Names of what `InputDevice.poll` reports.
    quiet_s : float or None
        Longest silence of a device that works, while something is deflected; None where it
        reports changes only, so that a hand held still cannot be told from a device that hangs.
    """

    key: str
    title: str
    kind: InputKind
    axes: tuple[str, ...] = ()
    buttons: tuple[str, ...] = ()
    feedback: Feedback = Feedback.NONE
    quiet_s: float | None = None


@dataclass(frozen=True, slots=True)
class InputState:
    """What an input device says now.

    Attributes
    ----------
    axes : mapping of float
        Deflections by name, -1 to 1; 0 at rest.
    buttons : mapping of bool
        True while pressed.
    connected : bool
        False once it was unplugged or its recording is over.
    time_s : float
        When it reported last, on the wall clock.
    """

    axes: Mapping[str, float]
    buttons: Mapping[str, bool]
    connected: bool
    time_s: float


class InputDevice(Protocol):
    """One open device; `poll` and `feel` by one thread, `close` by any, once that has ended."""

    @property
    @abstractmethod
    def info(self) -> InputInfo:
        """What it is."""

    @abstractmethod
    def poll(self) -> InputState:
        """Return what it says now; never waits.

        Raises
        ------
        DeviceError
            It cannot be read any more.
        """

    @abstractmethod
    def feel(self, force: Mapping[str, float]) -> None:
        """Have the hand feel a force by axis, -1 to 1 of what the device can; or as rumble.

        A device without feedback ignores it. What is not named is not felt any more.
        """

    @abstractmethod
    def close(self) -> None:
        """Give it back; harmless the second time."""


class InputSource(Protocol):
    """Knows the devices of one kind of library; any thread."""

    @abstractmethod
    def devices(self) -> tuple[InputInfo, ...]:
        """Return what is plugged in now."""

    @abstractmethod
    def open(self, key: str) -> InputDevice:
        """Open a device.

        Raises
        ------
        NotConnectedError
            It is not there, or somebody else has it.
        """

    @abstractmethod
    def close(self) -> None:
        """Give the library back; harmless the second time."""


InputBackend = Backend[None, InputSource]
"""What an entry point of the group ``cosmic.inputs`` leads to.

Its name stands before the colon in the keys of its devices, such as "spacemouse:0". One that is
`simulated` is offered where motion is simulated only.
"""
