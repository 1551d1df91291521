"""A gamepad that exists in SDL only: for tests, demonstrations and measurements."""

from types import TracebackType
from typing import Any, Self

from cosmic.frame.errors import NotConnectedError
from cosmic.mico.hw.sdl_input import PAD_AXES, PAD_BUTTONS, UPWARDS
from cosmic.mico.hw.sdl_library import acquire_sdl, release_sdl


class VirtualGamepad:
    """Plugged in while the block lasts; any thread.

    Parameters
    ----------
    gamepad : bool
        False makes a joystick without names for its axes.
    """

    def __init__(self, *, gamepad: bool = True) -> None:
        self._gamepad = gamepad
        self._sdl: Any = None
        self._stick: Any = None
        self.key = ""

    def __enter__(self) -> Self:
        sdl = self._sdl = acquire_sdl()
        pad, plain = sdl.SDL_JOYSTICK_TYPE_GAMECONTROLLER, sdl.SDL_JOYSTICK_TYPE_THROTTLE
        kind = pad if self._gamepad else plain
        index = sdl.SDL_JoystickAttachVirtual(kind, len(PAD_AXES), len(PAD_BUTTONS), 0)
        if index < 0:
            release_sdl()
            raise NotConnectedError("this SDL has no virtual joysticks")
        self._stick = sdl.SDL_JoystickOpen(index)
        self.key = f"sdl:{sdl.SDL_JoystickInstanceID(self._stick)}"
        return self

    def push(self, axis: str, value: float) -> None:
        """Deflect an axis, -1 to 1."""
        value = -value if axis in UPWARDS else value
        self._sdl.SDL_JoystickSetVirtualAxis(
            self._stick, PAD_AXES.index(axis), round(32767 * value)
        )

    def press(self, button: str, *, down: bool = True) -> None:
        """Press a button, or let go of it."""
        self._sdl.SDL_JoystickSetVirtualButton(self._stick, PAD_BUTTONS.index(button), int(down))

    def unplug(self) -> None:
        """Take it away; harmless the second time."""
        if self._stick is None:
            return
        sdl, stick, self._stick = self._sdl, self._stick, None
        number = sdl.SDL_JoystickInstanceID(stick)
        for index in range(sdl.SDL_NumJoysticks()):
            if sdl.SDL_JoystickGetDeviceInstanceID(index) == number:
                sdl.SDL_JoystickDetachVirtual(index)
                break
        sdl.SDL_JoystickClose(stick)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.unplug()
        release_sdl()
