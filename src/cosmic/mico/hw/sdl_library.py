"""SDL 2 as far as it concerns gamepads: loaded late, without window, signals and environment."""

import warnings
from importlib import import_module
from threading import RLock
from typing import Any, Final

from cosmic.frame.errors import NotConnectedError, needs_extra

_HINTS: Final = {
    # A device is read whether or not a window of SDL has the focus: there is none.
    b"SDL_JOYSTICK_ALLOW_BACKGROUND_EVENTS": b"1",
    b"SDL_VIDEODRIVER": b"dummy",
    b"SDL_NO_SIGNAL_HANDLERS": b"1",
    b"SDL_JOYSTICK_THREAD": b"1",
}
_loading = RLock()
_users = 0


def load_sdl() -> Any:
    """Return the module `sdl2`; raises `NotConnectedError` where it cannot be loaded."""
    try:
        with warnings.catch_warnings():
            # It tells on standard error which of the libraries it found.
            warnings.simplefilter("ignore", UserWarning)
            sdl: Any = import_module("sdl2")  # here: megabytes, for gamepads only
    except (ImportError, OSError) as exc:
        raise NotConnectedError(
            f"SDL 2 cannot be loaded ({exc}). {needs_extra('A gamepad', 'gamepad')}"
        ) from exc
    return sdl


def acquire_sdl() -> Any:
    """Start SDL's joysticks, or count one more user of them; returns the module.

    Raises
    ------
    NotConnectedError
        SDL cannot be loaded or started.
    """
    global _users  # noqa: PLW0603 - the library is one for the process, too
    with _loading:
        sdl = load_sdl()
        if _users == 0:
            for name, value in _HINTS.items():
                sdl.SDL_SetHint(name, value)
            if sdl.SDL_InitSubSystem(sdl.SDL_INIT_JOYSTICK | sdl.SDL_INIT_GAMECONTROLLER) != 0:
                why = sdl.SDL_GetError().decode("utf-8", "replace")
                raise NotConnectedError(f"SDL cannot look for gamepads: {why}")
            # Polled, so that no queue of events fills up that nobody empties.
            sdl.SDL_JoystickEventState(sdl.SDL_IGNORE)
            sdl.SDL_GameControllerEventState(sdl.SDL_IGNORE)
        _users += 1
        return sdl


def release_sdl() -> None:
    """Count one user less; the last one ends SDL's joysticks."""
    global _users  # noqa: PLW0603
    with _loading:
        if _users > 0:
            _users -= 1
            if _users == 0:
                sdl = load_sdl()
                sdl.SDL_QuitSubSystem(sdl.SDL_INIT_JOYSTICK | sdl.SDL_INIT_GAMECONTROLLER)
