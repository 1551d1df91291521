"""One sweep through a focus that is about known: where its peak is, or why there is none."""

import numpy as np
import pytest

from cosmic.vico.core.focus import FocusFault, peak_of


def sweep(peak: float, *, contrast: float = 1.0, noise: float = 0.0) -> list[tuple[float, float]]:
    positions = np.linspace(-120.0, 120.0, 9)
    measures = 1.0 + contrast / np.sqrt(1.0 + ((positions - peak) / 40.0) ** 2)
    measures += noise * np.random.default_rng(3).standard_normal(9)
    return list(zip(positions.tolist(), measures.tolist(), strict=True))


@pytest.mark.parametrize("peak", [-70.0, -13.0, 0.0, 41.0])
def test_the_peak_is_found_between_the_positions_and_how_sure_it_is(peak: float) -> None:
    found = peak_of(sweep(peak))
    assert found.position == pytest.approx(peak, abs=3.0)
    assert found.std is not None
    assert abs(found.position - peak) < 3.0 * max(found.std, 0.5)


@pytest.mark.parametrize(("peak", "end"), [(300.0, 120.0), (-500.0, -120.0)])
def test_a_peak_beyond_the_sweep_names_the_end_to_go_on_at(peak: float, end: float) -> None:
    found = peak_of(sweep(peak))
    assert (found.fault, found.position) == (FocusFault.AT_END, end)


def test_where_nothing_has_edges_there_is_no_focus() -> None:
    assert peak_of(sweep(0.0, contrast=0.01)).fault is FocusFault.FLAT


def test_noise_is_no_peak() -> None:
    found = peak_of(sweep(0.0, contrast=0.02, noise=0.3))
    assert found.fault is not None
    assert found.std is None
