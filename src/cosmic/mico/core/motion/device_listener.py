"""`DeviceListener`: receives what one device sends (thesis 5.4, 6.1.1)."""

import logging
from collections.abc import Callable
from typing import Final

from typing_extensions import override

from cosmic.frame.errors import DeviceError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread
from cosmic.mico.core.motion.data_container import DeviceDataContainer
from cosmic.mico.hw.interface import Controller

logger = logging.getLogger(__name__)

RECEIVE_S: Final = 0.1
"""How long one receive waits: no call can cancel it, so it bounds how long closing takes."""


class DeviceListener(WorkerThread):
    """Waits for the packets of one device and hands them to its `DeviceDataContainer`.

    Parameters
    ----------
    on_lost : callable
        Told why when the device cannot be reached any more; called in this thread.
    """

    may_wait = False

    def __init__(
        self,
        controller: Controller,
        container: DeviceDataContainer,
        policy: FailurePolicy,
        on_lost: Callable[[DeviceError], None],
    ) -> None:
        super().__init__(f"listener {container.device}", policy)
        self._controller = controller
        self._container = container
        self._on_lost = on_lost

    @override
    def run_body(self) -> None:
        try:
            self._listen()
        except BaseException as exc:
            self._on_lost(DeviceError(f"its listener failed: {exc!r}"))
            raise

    def _listen(self) -> None:
        while not self.end_requested:
            try:
                event = self._controller.receive(self._container.library_index, RECEIVE_S)
            except DeviceError as exc:
                self._on_lost(exc)
                return
            if event is not None:
                logger.debug("%s", event)
                self._container.apply(event)
