"""A campaign assessed again and again while its fibres come in."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import pytest

from cosmic.autonomy.bending import fit, span_fit
from cosmic.autonomy.bending.fit import (
    CampaignFit,
    Certificate,
    MeasuredFibre,
    Refits,
    assess_campaign,
    half_width_percent,
    measure_fibre,
)
from cosmic.autonomy.bending.inference import DRIFT
from cosmic.autonomy.bending.result import SpanFit
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.autonomy.bending.span import Span
from oracles.sealed_session import STANDARD_EI, Fibre, Session, World
from unit.autonomy.bending.sealed_fibres import SCALE, spans_of

SMOOTH = World(noise_un=0.03, friction=(0.02, 0.02), clamp=("log", 12.0, 0.3))
SETTINGS = FitSettings(askew_std=0.02)
FIBRES = 5


@pytest.fixture(scope="module")
def session() -> Session:
    return Session(SMOOTH, np.random.default_rng(3))


@pytest.fixture(scope="module")
def fibres(session: Session) -> list[MeasuredFibre]:
    drawn = [Fibre.drawn(session) for _ in range(FIBRES)]
    return [measure_fibre(spans_of(session, each), settings=SETTINGS) for each in drawn]


@pytest.fixture(scope="module")
def standard(session: Session) -> MeasuredFibre:
    spans = spans_of(session, Fibre.standard(session))
    certificate = Certificate(STANDARD_EI * SCALE, 0.02)
    return measure_fibre(spans, settings=SETTINGS, certificate=certificate)


def assessed(
    fibres: list[MeasuredFibre], standard: MeasuredFibre, refits: Refits | None
) -> CampaignFit:
    return assess_campaign(fibres, standards=[standard], settings=SETTINGS, refits=refits)


@pytest.fixture
def fitted(monkeypatch: pytest.MonkeyPatch) -> list[float | None]:
    """Friction about which the spans of each fibre are fitted, in the order of that."""
    frictions = list[float | None]()

    def fit_spans(
        spans: Sequence[Span],
        *,
        settings: FitSettings,
        places_um: Sequence[float],
        friction: float | None = None,
    ) -> tuple[SpanFit, ...]:
        frictions.append(friction)
        return span_fit.fit_spans(spans, settings=settings, places_um=places_um, friction=friction)

    monkeypatch.setattr(fit, "fit_spans", fit_spans)
    return frictions


def test_each_fibre_is_fitted_once_while_friction_stays_near(
    fibres: list[MeasuredFibre], standard: MeasuredFibre, fitted: list[float | None]
) -> None:
    refits = Refits()
    assessed(fibres[:-1], standard, refits)
    found = assessed(fibres, standard, refits)
    assert len(fitted) == FIBRES + 1
    assert found.friction < SETTINGS.friction
    assert set(fitted) == {found.friction}


def test_values_are_those_of_a_campaign_assessed_at_once(
    fibres: list[MeasuredFibre], standard: MeasuredFibre
) -> None:
    refits = Refits()
    for count in range(2, FIBRES):
        assessed(fibres[:count], standard, refits)
    found = assessed(fibres, standard, refits)
    whole = assessed(fibres, standard, None)
    for one, other in zip(found.fibres, whole.fibres, strict=True):
        assert one.ei_n_m2 == pytest.approx(other.ei_n_m2, rel=2e-3, abs=0.0)
        assert half_width_percent(one) == pytest.approx(half_width_percent(other), rel=0.03)


def test_all_are_fitted_again_where_friction_is_far_from_before(
    fibres: list[MeasuredFibre], fitted: list[float | None]
) -> None:
    refits = Refits()
    refits.about(fibres, 0.1)
    friction, _ = refits.about(fibres, 0.12)
    assert friction == 0.1
    friction, again = refits.about(fibres, 0.2)
    assert friction == 0.2
    assert fitted == [0.1] * FIBRES + [0.2] * FIBRES
    assert again[0].spans[0].by_friction != 0.0


def test_nothing_is_fitted_again_where_friction_comes_back(
    fibres: list[MeasuredFibre], fitted: list[float | None]
) -> None:
    refits = Refits()
    _, before = refits.about(fibres[:-1], 0.1)
    refits.about(fibres, 0.2)
    friction, after = refits.about(fibres, 0.11)
    assert friction == 0.1
    assert fitted == [0.1] * (FIBRES - 1) + [0.2] * FIBRES + [0.1], "and the one that is new"
    assert [each.spans for each in after[:-1]] == [each.spans for each in before]


def test_a_fibre_pushed_again_is_fitted_again(
    session: Session, fibres: list[MeasuredFibre], fitted: list[float | None]
) -> None:
    refits = Refits()
    refits.about(fibres, 0.1)
    again = dataclasses.replace(fibres[-1], raw=(*fibres[-1].raw,))
    refits.about([*fibres[:-1], again], 0.1)
    assert len(fitted) == FIBRES + 1


def test_drift_of_the_scale_counts_by_when_a_fibre_was_measured(
    fibres: list[MeasuredFibre],
) -> None:
    refits = Refits()
    refits.about(fibres, 0.1)
    _, later = refits.about([each.at(0.7) for each in fibres], 0.1)
    for each in later:
        assert each.part == 0.7
        assert each.readings is not None
        assert np.all(each.readings.to_common[:, DRIFT] == 0.7)
