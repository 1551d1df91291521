"""``cosmic``, ``cosmic mico`` and the like: the window of a platform or of one application."""

import argparse
import os
import sys
from typing import Final

from cosmic.app.stations.address import stations_of
from cosmic.app.windows.run_window import WindowOptions, run_window
from cosmic.frame.errors import NotAvailable

_WINDOW_SIZE: Final = (1600, 1000)


def run(chosen: argparse.Namespace) -> int:
    """Run a window until it is closed; raises `NotAvailable` where there is no display."""
    if chosen.offscreen is None and not _display_available():
        raise NotAvailable("there is no display; --offscreen SECONDS runs without one")
    return run_window(_options(chosen))


def _options(chosen: argparse.Namespace) -> WindowOptions:
    size = chosen.size or (_WINDOW_SIZE if chosen.offscreen is not None else None)
    return WindowOptions(
        config=chosen.config,
        only=chosen.command or "",
        rate=1.0 if chosen.rate is None else chosen.rate,
        cold=chosen.cold,
        sample=chosen.sample,
        truth=chosen.truth,
        world=chosen.world,
        offscreen_s=chosen.offscreen,
        screenshot=chosen.screenshot,
        size=size,
        theme=chosen.theme,
        serve=chosen.serve,
        listen=chosen.listen,
        name=chosen.name,
        certificates=chosen.certificates,
        stations=stations_of(chosen),
    )


def _display_available() -> bool:
    """Tell whether a window can be shown; Qt aborts the process where it cannot."""
    if sys.platform != "linux" or os.environ.get("QT_QPA_PLATFORM"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
