"""How a campaign stands, and when it ends."""

import math
from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from cosmic.autonomy.campaign.records import FibreRecord, Outcome
from cosmic.autonomy.campaign.statistics import (
    CampaignProgress,
    fibres_needed,
    mean_ei,
    progress,
    share_interval,
)
from cosmic.autonomy.campaign.stop_rule import StopRule, StopSettings
from unit.autonomy.campaign.sample_records import failed, good


def some(goods: int, bads: int) -> list[FibreRecord]:
    return [good(n, seed=n % 3) for n in range(goods)] + [failed(100 + n) for n in range(bads)]


def test_fibres_are_counted_by_how_they_ended() -> None:
    fibres = [
        *some(3, 1),
        failed(7, "jaw adhesion"),
        failed(8, "jaw adhesion"),
        FibreRecord(9, Outcome.INTERRUPTED, 0.0, math.nan),
        FibreRecord(10, Outcome.RUNNING, 0.0, math.nan),
    ]
    now = progress(fibres, 120.0)
    assert (now.done, now.good, now.failed, now.interrupted) == (6, 3, 3, 1)
    assert now.good_per_hour == 90.0
    assert now.success_percent == 50.0
    assert list(now.causes.items()) == [("jaw adhesion", 2), ("missed grasp", 1)]
    assert 14.0 <= now.cycle_s < 40.0


def test_an_empty_campaign_has_no_rates() -> None:
    now = progress([], 0.0)
    assert now.done == 0
    assert math.isnan(now.good_per_hour)
    assert math.isnan(now.success_percent)
    assert math.isnan(now.cycle_s)
    assert now.mean.count == 0


@pytest.mark.parametrize("spread", [0.0, 0.02, 0.05, 0.2, 0.56])
def test_as_many_fibres_as_are_planned_make_the_mean_as_precise_as_wanted(spread: float) -> None:
    rng = np.random.default_rng(1)
    found = replace(mean_ei([5e-11, 5e-11]), spread_ln=spread, common_std_ln=0.01)
    needed = int(fibres_needed(found, 5.0))
    for count, precise in ((needed, True), (needed - 1, False)):
        if count < 2:
            continue
        logs = rng.standard_normal(count)
        logs = spread * (logs - logs.mean()) / logs.std(ddof=1)
        mean = mean_ei(5e-11 * np.exp(logs), common_std_ln=0.01)
        half = math.log(mean.ei_high_n_m2 / mean.ei_n_m2)
        assert (half <= math.log(1.05)) is precise


def test_the_interval_of_the_mean_covers_the_median_of_the_pulp() -> None:
    rng, covered = np.random.default_rng(2), 0
    for _ in range(400):
        found = mean_ei(5e-11 * np.exp(0.5 * rng.standard_normal(12)))
        covered += found.ei_low_n_m2 <= 5e-11 <= found.ei_high_n_m2
    assert 0.92 <= covered / 400 <= 0.98


def test_one_fibre_says_nothing_about_the_pulp() -> None:
    found = mean_ei([5e-11])
    assert found.ei_n_m2 == pytest.approx(5e-11, rel=1e-6, abs=0.0)
    assert found.precision_percent == math.inf
    assert not found.ei_high_n_m2 < math.inf


@pytest.mark.parametrize(
    ("settings", "elapsed_s", "words"),
    [
        (StopSettings(count=8), 100.0, "8 fibres done"),
        (StopSettings(count=9), 100.0, ""),
        (StopSettings(good=6), 100.0, "6 good fibres"),
        (StopSettings(count=99, time_s=90.0), 100.0, "100 s have passed"),
        (StopSettings(precision_percent=50.0, least=6), 100.0, "mean stiffness known to"),
        (StopSettings(precision_percent=50.0, least=7), 100.0, ""),
        (StopSettings(precision_percent=0.1, least=2), 100.0, ""),
        (StopSettings(plates=2), 100.0, "2 plates worked off"),
        (StopSettings(plates=3), 100.0, ""),
    ],
)
def test_the_first_rule_that_is_met_ends_the_campaign(
    settings: StopSettings, elapsed_s: float, words: str
) -> None:
    reason = StopRule(settings).reason(progress(some(6, 2), elapsed_s, plates=2))
    assert reason.startswith(words)
    assert bool(reason) == bool(words)


def test_the_time_left_follows_from_the_pace_so_far() -> None:
    now = progress(some(6, 2), 160.0)
    assert StopRule(StopSettings(count=40)).left_s(now) == pytest.approx(32 * 20.0)
    assert StopRule(StopSettings(good=12)).left_s(now) == pytest.approx(6 * 160.0 / 6)
    assert StopRule(StopSettings(count=40, time_s=300.0)).left_s(now) == pytest.approx(140.0)
    assert StopRule(StopSettings(count=8)).left_s(now) == 0.0


def test_the_time_to_a_precision_grows_with_the_spread() -> None:
    def spread(ln: float) -> CampaignProgress:
        logs = ln * np.array([-1.0, 0.0, 1.0, -0.5, 0.5])
        fibres = [good(n, ei_n_m2=float(5e-11 * np.exp(each))) for n, each in enumerate(logs)]
        return progress(fibres, 100.0)

    rule = StopRule(StopSettings(precision_percent=10.0, least=2))
    assert 0.0 < rule.left_s(spread(0.2)) < rule.left_s(spread(0.6))


def test_what_all_fibres_share_is_in_the_interval_of_their_mean_and_does_not_average_out() -> None:
    rng, covered = np.random.default_rng(3), 0
    for _ in range(400):
        shared = 0.05 * rng.standard_normal()
        values = 5e-11 * np.exp(shared + 0.2 * rng.standard_normal(60))
        found = mean_ei(values, common_std_ln=0.05)
        covered += found.ei_low_n_m2 <= 5e-11 <= found.ei_high_n_m2
    assert 0.92 <= covered / 400 <= 0.98
    assert mean_ei(values).precision_percent < 0.6 * found.precision_percent
    more = [fibres_needed(replace(found, common_std_ln=each), 10.0) for each in (0.0, 0.02, 0.06)]
    assert more[0] < more[1] < more[2] == math.inf


@pytest.mark.parametrize("precision_percent", [1e-300, 1e-160, 1e-14])
def test_a_precision_next_to_nothing_asks_for_no_number_of_fibres(precision_percent: float) -> None:
    found = mean_ei([4e-11, 5e-11, 6e-11])
    assert fibres_needed(found, precision_percent) > 1e20


def test_a_precision_that_no_number_of_fibres_reaches_is_named_and_foretold_by_no_time() -> None:
    now = progress(some(6, 2), 160.0)
    rule = StopRule(StopSettings(precision_percent=0.1, least=2))
    assert "no number of fibres" in rule.plan(now)
    assert math.isnan(rule.left_s(now))
    assert "good fibres for ±30 %" in StopRule(StopSettings(precision_percent=30.0)).plan(now)


def test_the_interval_of_a_share_stays_inside_and_covers_it() -> None:
    assert share_interval(10, 10)[1] == 100.0
    assert share_interval(0, 10)[0] == 0.0
    rng = np.random.default_rng(4)
    hits = [share_interval(int(n), 20) for n in rng.binomial(20, 0.8, 500)]
    assert 0.92 <= np.mean([low <= 80.0 <= high for low, high in hits]) <= 0.99


def test_nothing_is_reported_before_the_first_fibre() -> None:
    assert math.isnan(StopRule(StopSettings(count=5)).left_s(progress([], 10.0)))


def test_a_stop_rule_without_any_rule_is_refused() -> None:
    with pytest.raises(ValidationError, match="give at least one of count"):
        StopSettings()
