"""CoSMic: control software for a microrobotic platform.

``cosmic.connect()`` starts the platform for a script; see docs/reference/api.md. Names are
loaded when first used, so that ``import cosmic`` opens nothing and stays quick.
"""

import logging
from importlib import import_module
from typing import TYPE_CHECKING, Any

from cosmic.frame.version import __version__ as __version__

if TYPE_CHECKING:
    from cosmic.app.connect import connect
    from cosmic.app.rig import Rig
    from cosmic.daqco.api.recording import Recording, open_recording
    from cosmic.frame.errors import (
        CollisionError,
        ConfigError,
        CosmicError,
        DeviceError,
        DeviceTimeout,
        LimitError,
        MoveCancelled,
        MoveRefused,
        NotAvailable,
        NotConnectedError,
        RecordingError,
        StoppedError,
        UnknownAxisError,
        UnknownToolError,
    )
    from cosmic.frame.operation import Progress, Task
    from cosmic.frame.verdict import MoveVerdict, Reason
    from cosmic.mico.api.axis import Axis
    from cosmic.mico.api.group_movement import GroupMovement
    from cosmic.mico.api.jogging import Jogging
    from cosmic.mico.api.mico import Mico
    from cosmic.mico.core.motion.movement import Movement
    from cosmic.vico.api.measure import Measurement, measure


# A script decides itself whether it wants to see the log.
logging.getLogger(__name__).addHandler(logging.NullHandler())

_HOMES = {
    "cosmic.app.connect": ("connect",),
    "cosmic.app.rig": ("Rig",),
    "cosmic.daqco.api.recording": ("Recording", "open_recording"),
    "cosmic.frame.errors": (
        "CollisionError",
        "ConfigError",
        "CosmicError",
        "DeviceError",
        "DeviceTimeout",
        "LimitError",
        "MoveCancelled",
        "MoveRefused",
        "NotAvailable",
        "NotConnectedError",
        "RecordingError",
        "StoppedError",
        "UnknownAxisError",
        "UnknownToolError",
    ),
    "cosmic.frame.operation": ("Progress", "Task"),
    "cosmic.frame.verdict": ("MoveVerdict", "Reason"),
    "cosmic.mico.api.axis": ("Axis",),
    "cosmic.mico.api.jogging": ("Jogging",),
    "cosmic.mico.api.group_movement": ("GroupMovement",),
    "cosmic.mico.api.mico": ("Mico",),
    "cosmic.mico.core.motion.movement": ("Movement",),
    "cosmic.vico.api.measure": ("Measurement", "measure"),
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names}

__all__ = [
    "Axis",
    "CollisionError",
    "ConfigError",
    "CosmicError",
    "DeviceError",
    "DeviceTimeout",
    "GroupMovement",
    "Jogging",
    "LimitError",
    "Measurement",
    "Mico",
    "MoveCancelled",
    "MoveRefused",
    "MoveVerdict",
    "Movement",
    "NotAvailable",
    "NotConnectedError",
    "Progress",
    "Reason",
    "Recording",
    "RecordingError",
    "Rig",
    "StoppedError",
    "Task",
    "UnknownAxisError",
    "UnknownToolError",
    "connect",
    "measure",
    "open_recording",
]


def __getattr__(name: str) -> Any:
    if name not in _HOME_OF:
        raise AttributeError(f"module 'cosmic' has no attribute {name!r}")
    return getattr(import_module(_HOME_OF[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
