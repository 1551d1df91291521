"""What the inputs of a simulated board see: sources, noise, hum, and the converter's steps."""

import hashlib
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt
from typing_extensions import override

from cosmic.daqco.hw.interface import Source, Volts

# An input with a cable but nothing at its end: a guess from such cables, not from this platform.
OPEN_NOISE_V: Final = 3e-3
OPEN_HUM_V: Final = 2e-3
OPEN_OFFSET_V: Final = 5e-3
MAINS_HZ: Final = 50.0
# NI 622x specification: 244 uV rms at +-10 V, which is 0.8 steps; in about that ratio elsewhere.
NOISE_STEPS: Final = 0.8
STEPS: Final = 2**16
# Two banks of coprime lengths are added, so that the noise repeats after 10**8 samples only.
_BANKS: Final = (10_007, 9_973)


class Signal(Protocol):
    """What all inputs of one acquisition carry."""

    @abstractmethod
    def volts(self, first: int, times_s: npt.NDArray[np.float64]) -> Volts:
        """Return fresh samples of all inputs, shape (inputs, n); `first` is the first's number."""


class BoardSignal(Signal):
    """The inputs of a real board: sources or nothing, noise, clipped and quantised.

    The same seed, inputs and sample numbers give the same noise, whatever the chunks.

    Parameters
    ----------
    ranges_v : sequence of (float, float)
        In force at each input.
    sources : mapping of int to Source
        By row; the other rows have nothing connected.
    rows : sequence of str
        Name of each row; rows of other names carry other noise.
    """

    def __init__(
        self,
        ranges_v: Sequence[tuple[float, float]],
        sources: Mapping[int, Source],
        *,
        rows: Sequence[str],
        chunk_samples: int,
        seed: int,
    ) -> None:
        self._sources = dict(sources)
        self._low = np.array([[low] for low, _ in ranges_v])
        self._step = np.array([[(high - low) / STEPS] for low, high in ranges_v])
        is_open = np.array([[row not in sources] for row in range(len(ranges_v))])
        # Two equal parts in quadrature, from two banks.
        sigma = np.hypot(NOISE_STEPS * self._step, OPEN_NOISE_V * is_open) / np.sqrt(2.0)
        self._offset = np.zeros((len(rows), 1))
        self._hum = np.zeros((len(rows), 2))
        self._banks = [np.empty((len(rows), length + chunk_samples)) for length in _BANKS]
        for row, name in enumerate(rows):
            random = np.random.default_rng(_seed_of(seed, name))
            offset, size, phase = random.uniform((-1.0, 0.5, 0.0), (1.0, 1.0, 2.0 * np.pi))
            if is_open[row, 0]:
                self._offset[row, 0] = OPEN_OFFSET_V * offset
                self._hum[row] = OPEN_HUM_V * size * np.array((np.cos(phase), np.sin(phase)))
            for bank, length in zip(self._banks, _BANKS, strict=True):
                bank[row, :length] = random.standard_normal(length) * sigma[row, 0]
                bank[row, length:] = np.resize(bank[row, :length], chunk_samples)
        # Chunks are short and come 500 times a second: what can be done once is done here, and
        # the rest reckons in steps of the converter.
        self._banks[0] += self._offset - self._low
        self._banks = [bank / self._step for bank in self._banks]
        self._hum /= self._step
        self._hums = bool(self._hum.any())
        self._steps_v = self._step[:, 0].tolist()

    @override
    def volts(self, first: int, times_s: npt.NDArray[np.float64]) -> Volts:
        count = times_s.size
        one, two = self._banks
        start, other = first % _BANKS[0], first % _BANKS[1]
        steps: Volts = one[:, start : start + count] + two[:, other : other + count]
        if self._hums:
            turns = np.empty((2, count))
            np.multiply(times_s, 2.0 * np.pi * MAINS_HZ, out=turns[1])
            np.sin(turns[1], out=turns[0])
            np.cos(turns[1], out=turns[1])
            steps += self._hum @ turns
        for row, source in self._sources.items():
            steps[row] += source.volts(times_s) / self._steps_v[row]
        return self._converted(steps)

    def _converted(self, volts: Volts) -> Volts:
        """Return what the converter reads, written over steps that are no whole ones."""
        np.rint(volts, out=volts)
        np.maximum(volts, 0.0, out=volts)
        np.minimum(volts, STEPS - 1.0, out=volts)
        volts *= self._step
        volts += self._low
        return volts


class RepeatedSignal(Signal):
    """A prepared buffer, over and over.

    Parameters
    ----------
    buffer_v : ndarray, shape (inputs, length), float64, V
    """

    def __init__(self, buffer_v: Volts, chunk_samples: int) -> None:
        self._length = buffer_v.shape[1]
        wanted = np.arange(self._length + chunk_samples) % self._length
        self._buffer_v = np.ascontiguousarray(buffer_v[:, wanted])

    @override
    def volts(self, first: int, times_s: npt.NDArray[np.float64]) -> Volts:
        start = first % self._length
        return self._buffer_v[:, start : start + times_s.size].copy()


def _seed_of(seed: int, name: str) -> list[int]:
    # Python's own hash of a text differs from process to process.
    digest = hashlib.blake2b(name.encode(), digest_size=8).digest()
    return [seed, int.from_bytes(digest, "little")]
