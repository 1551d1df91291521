"""A source of samples without a board's limits, for benchmarks only."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from typing_extensions import override

from cosmic.daqco.hw.interface import BoardInfo, BoardLibrary, InputSettings, Volts
from cosmic.daqco.hw.sim_board import SimulatedBoard
from cosmic.daqco.hw.sim_faults import BoardFaults
from cosmic.daqco.hw.sim_signal import RepeatedSignal, Signal
from cosmic.frame.clock import Clock
from cosmic.frame.errors import NotConnectedError

NAME: Final = "Fast1"
COUNTER_LENGTH: Final = 1 << 16


def prepared_buffer(inputs: int, *, seed: int = 0) -> Volts:
    """Return a buffer to repeat, shape (inputs, 65536), float64, V.

    Row 0 counts the samples (sample number modulo 65536, times 0.1 mV), so that a gap shows;
    the others carry a sine with noise.
    """
    random = np.random.default_rng(seed)
    count = np.arange(COUNTER_LENGTH)
    phase = 2.0 * np.pi * 64 * count / COUNTER_LENGTH + np.arange(inputs)[:, np.newaxis]
    buffer_v = np.sin(phase) + random.normal(0.0, 0.01, (inputs, COUNTER_LENGTH))
    buffer_v[0] = count * 1e-4
    return buffer_v


class FastLibrary(BoardLibrary):
    """One board, `Fast1`, that makes any rate and repeats a prepared buffer.

    Parameters
    ----------
    buffer_v : ndarray, shape (inputs, length), float64, V, or None
        What it repeats; None is `prepared_buffer`.
    paced : bool
        True: samples come at the rate asked; False: as fast as they are fetched.

    Attributes
    ----------
    faults : BoardFaults
        Trouble to inject by name.
    """

    def __init__(
        self, clock: Clock, *, inputs: int = 32, buffer_v: Volts | None = None, paced: bool = True
    ) -> None:
        self._clock = clock
        self._paced = paced
        self._buffer_v = prepared_buffer(inputs) if buffer_v is None else buffer_v
        self._info = BoardInfo(
            name=NAME,
            product="fast source",
            simulated=True,
            serial=0,
            inputs=tuple(f"ai{number}" for number in range(self._buffer_v.shape[0])),
            max_single_rate_hz=1e9,
            max_multi_rate_hz=1e12,
            ranges_v=((-10.0, 10.0),),
        )
        self.faults = BoardFaults()
        self._owners: dict[str, SimulatedBoard] = {}

    @property
    @override
    def name(self) -> str:
        return "Fast source"

    @override
    def list_boards(self) -> tuple[BoardInfo, ...]:
        return (self._info,)

    @override
    def open(self, name: str) -> SimulatedBoard:
        if name != NAME:
            raise NotConnectedError(f"there is no board {name!r}; there is {NAME}")

        def make_signal(inputs: Sequence[InputSettings], chunk_samples: int) -> Signal:
            rows = [self._info.inputs.index(each.input) for each in inputs]
            return RepeatedSignal(self._buffer_v[rows], chunk_samples)

        return SimulatedBoard(
            self._info,
            self._clock,
            self.faults,
            make_signal,
            owners=self._owners,
            receiver=self._clock.worker(),
            timebase_hz=0.0,
            paced=self._paced,
        )
