"""What a window shows of a campaign and of a fibre is what the records say."""

import math
from dataclasses import replace

import numpy as np
import pytest

from cosmic.autonomy.campaign.records import FibreRecord, Outcome
from cosmic.autonomy.campaign.snapshot import card_of, row_of, snapshot_of
from cosmic.autonomy.campaign.statistics import progress
from unit.autonomy.campaign.sample_records import failed, good


def test_a_board_counts_and_lists_all_fibres() -> None:
    fibres = [good(1), failed(2), good(3, ei_n_m2=2e-11, seed=1), failed(4, "slipped")]
    board = snapshot_of("quick", "running", fibres, progress(fibres, 120.0), operation="lift")
    assert (board.done, board.good, board.failed) == (4, 2, 2)
    assert board.good_per_hour == pytest.approx(60.0)
    assert board.success_percent == pytest.approx(50.0)
    assert [row.number for row in board.rows] == [1, 2, 3, 4]
    assert [each.number for each in board.measured] == [1, 3]
    assert board.causes == {"missed grasp": 1, "slipped": 1}
    assert board.mean.count == 2
    assert math.isnan(board.left_s)


def test_a_board_of_nothing_is_empty() -> None:
    board = snapshot_of("quick", "ready", [], progress([], 0.0))
    assert (board.done, board.rows, board.measured) == (0, (), ())
    assert math.isnan(board.good_per_hour)


def test_a_row_reports_the_interval_and_why_a_result_is_not_trusted() -> None:
    record = good(1)
    assert record.bending is not None
    row = row_of(record)
    assert row.ei is not None
    assert row.ei.ei_low_n_m2 < 5e-11 < row.ei.ei_high_n_m2
    assert row.cause == ""
    doubtful = replace(record.bending, trusted=False, reasons=("the jaws slipped", "one span"))
    row = row_of(replace(record, bending=doubtful, outcome=Outcome.DOUBTFUL))
    assert row.cause == "the jaws slipped; one span"
    assert row.ei is not None
    assert not row.ei.trusted


def test_a_result_without_a_number_is_none() -> None:
    record = good(1)
    assert record.bending is not None
    row = row_of(replace(record, bending=replace(record.bending, ei_n_m2=math.nan)))
    assert row.ei is None


def raised(record: FibreRecord, offset_un: float) -> FibreRecord:
    """Return the record of a sensor whose zero is off."""
    assert record.bending is not None
    spans = [replace(each, force_un=each.force_un + offset_un) for each in record.spans]
    fits = [
        replace(
            each, baseline_un=each.baseline_un + offset_un, fitted_un=each.fitted_un + offset_un
        )
        for each in record.bending.spans
    ]
    bending = replace(record.bending, spans=tuple(fits))
    return replace(record, spans=tuple(spans), bending=bending)


def test_a_card_has_curves_from_the_first_contact_without_their_baseline() -> None:
    record = raised(good(1), 40.0)
    card = card_of(record)
    assert record.bending is not None
    assert len(card.curves) == len(record.spans)
    for curve, span in zip(card.curves, record.spans, strict=True):
        assert curve.probe_um.shape == curve.force_un.shape == curve.fitted_un.shape
        before = curve.force_un[curve.probe_um < -0.5]
        assert np.abs(before).max() < 3.0, "the baseline is taken out"
        assert curve.force_un.max() > 20.0
        fitted = np.isfinite(curve.fitted_un)
        assert np.abs((curve.force_un - curve.fitted_un)[fitted]).max() < 5.0
        assert curve.loading.sum() == span.loading.sum()
    assert any(curve.used for curve in card.curves)
    assert card.clamp_offset_um == record.bending.clamp_offset_um
    assert card.uncertainty.startswith("Interval: ")
    assert card.uncertainty.endswith("Force scale not verified.")


def test_a_span_that_was_not_fitted_is_shown_all_the_same() -> None:
    card = card_of(replace(good(1), bending=None))
    assert card.ei is None
    assert len(card.curves) == len(good(1).spans)
    for curve in card.curves:
        assert curve.probe_um.min() == 0.0
        assert np.isnan(curve.fitted_un).all()
        assert not curve.used


def test_a_card_of_a_failed_fibre_shows_what_failed_before() -> None:
    card = card_of(failed(7))
    assert card.curves == ()
    assert card.failures == (("close", "missed grasp"),) * 2
    assert (card.cause, card.attempts) == ("missed grasp", 4)


def test_a_curve_that_was_sampled_finely_is_thinned_out() -> None:
    record = good(1)
    span = record.spans[0]
    many = 10_000
    way = np.linspace(0.0, 30.0, many)
    fine = replace(
        span,
        probe_um=way,
        force_un=way.copy(),
        force_std_un=np.ones(many),
        time_s=way.copy(),
        loading=np.ones(many, dtype=bool),
    )
    card = card_of(replace(record, spans=(fine,), bending=None))
    assert card.curves[0].probe_um.size <= 2000
