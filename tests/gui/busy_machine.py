"""The robot that tests of windows press buttons with."""

from collections.abc import Callable

from pytestqt.qtbot import QtBot
from typing_extensions import override

PATIENCE_MS = 20_000


class PatientQtBot(QtBot):
    """Waits for a condition as long as a computer may need that does much else."""

    @override
    def waitUntil(self, callback: Callable[[], bool | None], *, timeout: int = PATIENCE_MS) -> None:
        super().waitUntil(callback, timeout=timeout)
