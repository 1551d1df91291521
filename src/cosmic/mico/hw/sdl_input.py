"""Gamepads and joysticks through SDL 2."""

from collections.abc import Mapping
from threading import RLock
from typing import Any, Final

from typing_extensions import override

from cosmic.frame.clock import WALL
from cosmic.frame.errors import NotConnectedError
from cosmic.frame.plugins import NoOptions
from cosmic.mico.hw.input_device import (
    Feedback,
    InputBackend,
    InputDevice,
    InputInfo,
    InputKind,
    InputSource,
    InputState,
)
from cosmic.mico.hw.sdl_library import acquire_sdl, release_sdl

# SDL's names by its numbers, in words that a configuration can use.
PAD_AXES: Final = ("left_x", "left_y", "right_x", "right_y", "left_trigger", "right_trigger")
PAD_BUTTONS: Final = (
    "a",
    "b",
    "x",
    "y",
    "back",
    "guide",
    "start",
    "left_stick",
    "right_stick",
    "left_shoulder",
    "right_shoulder",
    "up",
    "down",
    "left",
    "right",
)
UPWARDS: Final = frozenset({"left_y", "right_y"})
"""Sticks that SDL counts downwards; here up is positive."""
_FULL: Final = 32767.0
RUMBLE_PERIOD_S: Final = 0.05
_RUMBLE_MS: Final = 250
"""Rumble ends by itself after this long, whatever becomes of the program."""
_lock: Final = RLock()


class SdlInput(InputDevice):
    """One gamepad, or a joystick of any shape; made by `SdlSource`."""

    def __init__(self, sdl: Any, index: int, info: InputInfo) -> None:
        self._sdl = sdl
        self._pad: Any = None
        if info.kind is InputKind.GAMEPAD:
            self._pad = sdl.SDL_GameControllerOpen(index)
            self._stick = sdl.SDL_GameControllerGetJoystick(self._pad) if self._pad else None
        else:
            self._stick = sdl.SDL_JoystickOpen(index)
        if not self._stick:
            why = sdl.SDL_GetError().decode("utf-8", "replace")
            raise NotConnectedError(f"{info.title} cannot be opened: {why}")
        rumbles = bool(sdl.SDL_JoystickHasRumble(self._stick))
        self._info = InputInfo(
            key=info.key,
            title=info.title,
            kind=info.kind,
            axes=info.axes or _numbered("axis", sdl.SDL_JoystickNumAxes(self._stick)),
            buttons=info.buttons or _numbered("button", sdl.SDL_JoystickNumButtons(self._stick)),
            feedback=Feedback.RUMBLE if rumbles else Feedback.NONE,
        )
        self._last: tuple[object, object] = ({}, {})
        self._time_s = WALL.now_s()
        self._rumbled_s = 0.0
        self._strength = 0.0
        acquire_sdl()

    @property
    @override
    def info(self) -> InputInfo:
        return self._info

    @override
    def poll(self) -> InputState:
        with _lock:
            if self._stick is None:
                return InputState({}, {}, connected=False, time_s=self._time_s)
            self._sdl.SDL_JoystickUpdate()
            connected = bool(self._sdl.SDL_JoystickGetAttached(self._stick))
            axes, buttons = self._axes(), self._buttons()
        if (axes, buttons) != self._last:
            self._last, self._time_s = (axes, buttons), WALL.now_s()
        return InputState(axes, buttons, connected=connected, time_s=self._time_s)

    def _axes(self) -> dict[str, float]:
        sdl, pad = self._sdl, self._pad
        axes = {}
        for number, name in enumerate(self._info.axes):
            if pad is not None:
                raw = sdl.SDL_GameControllerGetAxis(pad, number)
            else:
                raw = sdl.SDL_JoystickGetAxis(self._stick, number)
            value = max(-1.0, raw / _FULL)
            axes[name] = -value if name in UPWARDS else value
        return axes

    def _buttons(self) -> dict[str, bool]:
        sdl, pad = self._sdl, self._pad
        names = enumerate(self._info.buttons)
        if pad is not None:
            return {name: bool(sdl.SDL_GameControllerGetButton(pad, n)) for n, name in names}
        return {name: bool(sdl.SDL_JoystickGetButton(self._stick, n)) for n, name in names}

    @override
    def feel(self, force: Mapping[str, float]) -> None:
        """Rumble as strongly as the largest force; renewed no more often than motors follow."""
        strength = min(1.0, max((abs(each) for each in force.values()), default=0.0))
        now_s = WALL.now_s()
        idle = strength == 0.0 and self._strength == 0.0
        if idle or now_s - self._rumbled_s < RUMBLE_PERIOD_S:
            return
        self._strength, self._rumbled_s = strength, now_s
        level = round(0xFFFF * strength)
        with _lock:
            if self._stick is not None and self._info.feedback is Feedback.RUMBLE:
                self._sdl.SDL_JoystickRumble(self._stick, level, level, _RUMBLE_MS)

    @override
    def close(self) -> None:
        with _lock:
            stick, self._stick = self._stick, None
            if stick is None:
                return
            if self._pad is not None:
                self._sdl.SDL_GameControllerClose(self._pad)
                self._pad = None
            else:
                self._sdl.SDL_JoystickClose(stick)
        release_sdl()


class SdlSource(InputSource):
    """The gamepads and joysticks that are plugged in; SDL is loaded when first asked."""

    def __init__(self) -> None:
        self._sdl: Any = None

    def _library(self) -> Any:
        if self._sdl is None:
            self._sdl = acquire_sdl()
        return self._sdl

    @override
    def devices(self) -> tuple[InputInfo, ...]:
        with _lock:
            sdl = self._library()
            sdl.SDL_JoystickUpdate()
            return tuple(_describe(sdl, index) for index in range(sdl.SDL_NumJoysticks()))

    @override
    def open(self, key: str) -> InputDevice:
        with _lock:
            sdl = self._library()
            sdl.SDL_JoystickUpdate()
            for index in range(sdl.SDL_NumJoysticks()):
                info = _describe(sdl, index)
                if info.key == key:
                    return SdlInput(sdl, index, info)
        raise NotConnectedError(f"there is no input device {key!r}; plug it in, or choose another")

    @override
    def close(self) -> None:
        with _lock:
            if self._sdl is not None:
                self._sdl = None
                release_sdl()


def _describe(sdl: Any, index: int) -> InputInfo:
    name = (sdl.SDL_JoystickNameForIndex(index) or b"").decode("utf-8", "replace")
    key = f"sdl:{sdl.SDL_JoystickGetDeviceInstanceID(index)}"
    if sdl.SDL_IsGameController(index):
        title = name or "Gamepad"
        return InputInfo(key, title, InputKind.GAMEPAD, axes=PAD_AXES, buttons=PAD_BUTTONS)
    return InputInfo(key, name or "Joystick", InputKind.JOYSTICK)


def _numbered(word: str, count: int) -> tuple[str, ...]:
    return tuple(f"{word}_{number}" for number in range(max(0, count)))


def _make(_options: NoOptions, _context: None) -> InputSource:
    return SdlSource()


BACKEND: Final = InputBackend(_make)
