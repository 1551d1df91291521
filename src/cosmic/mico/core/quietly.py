"""Calls of the library whose failure concerns one axis only."""

import logging
from collections.abc import Callable

from cosmic.frame.errors import DeviceError, DeviceFault

logger = logging.getLogger(__name__)


def quietly(name: str, call: Callable[[], None]) -> bool:
    """Make a call and say whether it was taken; a device out of reach is another's matter."""
    try:
        call()
    except DeviceError as exc:
        if exc.fault in (DeviceFault.COMMUNICATION, DeviceFault.TIMEOUT):
            raise
        logger.warning("%s: %s", name, exc)
        return False
    return True
