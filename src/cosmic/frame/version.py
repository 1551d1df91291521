"""The version of CoSMic, for what records it; `cosmic.__version__` is the same."""

from typing import Final

__version__: Final = "0.1.0"
