"""Chunks that fit together, and the larger pieces that a display gets."""

import numpy as np
import pytest

from cosmic.daqco.core.chunk import DataChunk, missing_samples
from cosmic.daqco.core.display_pieces import DisplayPieces
from cosmic.daqco.core.scale import VOLTS, Scale


def chunk(first: int, samples: int = 10, scale: Scale = VOLTS) -> DataChunk:
    return DataChunk(
        first, first / 1000.0, 1000.0, ("force",), np.full((1, samples), float(first)), (scale,)
    )


WRONG = [
    (1000.0, ("a", "b"), np.zeros((1, 5))),
    (1000.0, ("a",), np.zeros(5)),
    (1000.0, ("a",), np.zeros((1, 5), np.int16)),
    (1000.0, ("a",), np.zeros((1, 0))),
    (float("nan"), ("a",), np.zeros((1, 5))),
]


@pytest.mark.parametrize(("rate_hz", "channels", "volts"), WRONG, ids=range(len(WRONG)))
def test_samples_that_do_not_fit_together_are_no_chunk(
    rate_hz: float,
    channels: tuple[str, ...],
    volts: np.ndarray,  # type: ignore[type-arg]
) -> None:
    with pytest.raises(ValueError, match="do not fit together"):
        DataChunk(0, 0.0, rate_hz, channels, volts, (VOLTS,))


def test_samples_are_missing_between_chunks_but_not_before_another_acquisition() -> None:
    assert missing_samples(chunk(0), chunk(10)) == 0
    assert missing_samples(chunk(2**40), chunk(2**40 + 37)) == 27
    assert missing_samples(chunk(500), chunk(20)) == 0


def test_a_display_gets_the_same_samples_in_larger_pieces() -> None:
    shown: list[DataChunk] = []
    pieces = DisplayPieces(shown.append, display_s=0.05)
    other = Scale("other", "uN", (0.0, 2.0))
    for number in range(12):
        pieces.take(chunk(10 * number, scale=VOLTS if number < 7 else other))
    pieces.take(chunk(120, scale=other))
    for number in range(5):  # another acquisition
        pieces.take(chunk(10 * number))
    assert [(each.first_sample, each.samples) for each in shown] == [
        (0, 50),
        (50, 20),
        (70, 50),
        (0, 50),
    ]
    assert np.array_equal(shown[0].volts[0, ::10], [0.0, 10.0, 20.0, 30.0, 40.0])
    assert [each.scales[0] for each in shown] == [VOLTS, VOLTS, other, VOLTS]
