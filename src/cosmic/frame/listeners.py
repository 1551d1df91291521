"""Telling others, none of whom may harm the one who tells."""

import logging
from collections.abc import Callable, Iterable
from typing import ParamSpec

logger = logging.getLogger(__name__)

P = ParamSpec("P")


def tell(listeners: Iterable[Callable[P, object]], *args: P.args, **kwargs: P.kwargs) -> None:
    """Call each listener; one that raises is logged and keeps nobody else from hearing."""
    for listener in listeners:
        try:
            listener(*args, **kwargs)
        except Exception:
            logger.exception("a listener failed: %r", listener)
