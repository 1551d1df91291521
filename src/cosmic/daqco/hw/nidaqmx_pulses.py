"""A counter of a board of National Instruments that counts its sample clock."""

import logging
from typing import Any

from nidaqmx.constants import AcquisitionType, Level
from nidaqmx.errors import Error

from cosmic.daqco.hw.nidaqmx_errors import board_error
from cosmic.daqco.hw.pulses import PulseTrain

logger = logging.getLogger(__name__)


class CounterTask:
    """Gives a pulse at every so many samples; start it before the inputs.

    The pulse comes out at the counter's own terminal, PFI 12 for ctr0 and PFI 13 for ctr1 on boards
    of the M series.

    Raises
    ------
    CosmicError
        The driver refused; nothing is reserved then.
    """

    def __init__(self, api: Any, train: PulseTrain) -> None:
        self._board = train.board
        high = train.every_samples // 2
        try:
            self._task = api.Task()
        except Error as exc:
            raise board_error(exc, "create a task", train.board) from exc
        try:
            self._task.co_channels.add_co_pulse_chan_ticks(
                f"{train.board}/{train.counter}",
                f"/{train.board}/ai/SampleClock",
                idle_state=Level.LOW,
                initial_delay=train.first_sample,
                low_ticks=train.every_samples - high,
                high_ticks=high,
            )
            self._task.timing.cfg_implicit_timing(sample_mode=AcquisitionType.CONTINUOUS)
            self._task.start()
        except Error as exc:
            self.close()
            raise board_error(exc, f"start {train.counter}", train.board) from exc

    def close(self) -> None:
        """End the pulses and give the counter back; a driver that fails here is logged."""
        try:
            self._task.close()
        except Error as exc:
            logger.warning("%s: close of a counter: %s", self._board, exc)
