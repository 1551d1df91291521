"""Pulses on the sample clock of a board, such as for a camera."""

from abc import abstractmethod
from dataclasses import dataclass
from typing import Final, Protocol, runtime_checkable

LEAST_EVERY: Final = 4
"""A counter is high and low for at least two ticks each."""


@dataclass(frozen=True, slots=True)
class PulseTrain:
    """A pulse at sample `first_sample`, and at every so many samples from then on.

    Attributes
    ----------
    board, counter : str
        Where: "Dev1" and "ctr0".
    """

    board: str
    counter: str
    first_sample: int
    every_samples: int

    def samples_in(self, first: int, count: int) -> range:
        """Return the samples of a chunk at which it rises."""
        begin = max(0, -(-(first - self.first_sample) // self.every_samples))
        start = self.first_sample + begin * self.every_samples
        return range(start, first + count, self.every_samples)

    def number_of(self, sample: int) -> int:
        """Return the number of the pulse at a sample, counted from 0."""
        return (sample - self.first_sample) // self.every_samples

    def nearest(self, sample: float) -> int:
        """Return the sample of the pulse that lies nearest."""
        number = round((sample - self.first_sample) / self.every_samples)
        return self.first_sample + max(0, number) * self.every_samples


@runtime_checkable
class PulsingBoard(Protocol):
    """A board that has counters; a `Board` may be one."""

    @abstractmethod
    def pulse(self, train: PulseTrain | None) -> None:
        """Give these pulses with each acquisition from the next start on; None: none."""
