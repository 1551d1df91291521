"""Keys as an input device: a window says which are held, and that it is alive."""

from collections.abc import Mapping
from threading import Lock
from typing import Final

from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.errors import NotConnectedError
from cosmic.frame.plugins import NoOptions
from cosmic.mico.hw.input_device import (
    InputBackend,
    InputDevice,
    InputInfo,
    InputKind,
    InputSource,
    InputState,
)

KEYS: Final[dict[str, tuple[str, str]]] = {
    "left_x": ("4", "6"),
    "left_y": ("2", "8"),
    "right_x": ("1", "7"),
    "right_y": ("3", "9"),
}
"""The key backwards and the key forwards of each axis; named as a gamepad's, for its profiles."""
FINE_KEY: Final = "5"
FINE_BUTTON: Final = "right_shoulder"
KEY: Final = "keyboard:window"
QUIET_S: Final = 0.09


class KeyboardInput(InputDevice):
    """Axes that are -1, 0 or 1. `hold`, `beat` and `plug` are the window's side; any thread."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._held: frozenset[str] = frozenset()
        self._time_s = WALL.now_s()
        self._plugged = False
        self._info = InputInfo(
            key=KEY,
            title="Number keys",
            kind=InputKind.KEYBOARD,
            axes=tuple(KEYS),
            buttons=(FINE_BUTTON,),
            quiet_s=QUIET_S,
        )

    @property
    @override
    def info(self) -> InputInfo:
        return self._info

    @property
    def plugged(self) -> bool:
        """Whether there is a window whose keys are meant."""
        return self._plugged

    def plug(self, *, plugged: bool) -> None:
        """Say that a window listens to keys, or no longer does."""
        self._plugged = plugged
        self.hold(())

    def hold(self, keys: tuple[str, ...]) -> None:
        """Say which keys are held now."""
        with self._lock:
            self._held, self._time_s = frozenset(keys), WALL.now_s()

    def beat(self) -> None:
        """Say that the window is alive; while keys are held, several times in 90 ms."""
        with self._lock:
            self._time_s = WALL.now_s()

    @override
    def poll(self) -> InputState:
        with self._lock:
            held, time_s = self._held, self._time_s
        axes = {
            axis: float(forward in held) - float(backward in held)
            for axis, (backward, forward) in KEYS.items()
        }
        return InputState(
            axes, {FINE_BUTTON: FINE_KEY in held}, connected=self._plugged, time_s=time_s
        )

    @override
    def feel(self, force: Mapping[str, float]) -> None:
        """Do nothing: keys cannot push."""

    @override
    def close(self) -> None:
        self.hold(())


class KeyboardSource(InputSource):
    """Has the keys, once a window has plugged them in."""

    def __init__(self) -> None:
        self.keyboard = KeyboardInput()

    @override
    def devices(self) -> tuple[InputInfo, ...]:
        return (self.keyboard.info,) if self.keyboard.plugged else ()

    @override
    def open(self, key: str) -> InputDevice:
        if key != KEY or not self.keyboard.plugged:
            raise NotConnectedError("the keys of a window can be used while it is open")
        return self.keyboard

    @override
    def close(self) -> None:
        """Do nothing: the window has the keys."""


def _make(_options: NoOptions, _context: None) -> InputSource:
    return KeyboardSource()


BACKEND: Final = InputBackend(_make)
