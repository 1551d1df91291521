"""Deprecated: use `cosmic.app.commands.scene`."""

import warnings

from cosmic.app.commands.scene import check_scene, decompose

__all__ = ["check_scene", "decompose"]

warnings.warn(
    "cosmic.app.scene_command is now cosmic.app.commands.scene", DeprecationWarning, stacklevel=2
)
