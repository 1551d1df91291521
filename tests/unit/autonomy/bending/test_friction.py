"""A contact that sticks before it slides, and what the shapes of curves tell of it."""

import dataclasses

import numpy as np
import pytest

from cosmic.autonomy.bending.curved import NaturalShape, rubbed_of
from cosmic.autonomy.bending.fit import Certificate, assess_campaign, measure_fibre
from cosmic.autonomy.bending.friction import LAID_FRICTION, known_friction
from cosmic.autonomy.bending.result import SpanFit
from cosmic.autonomy.bending.settings import FitSettings
from oracles.pushed_rod import arc
from oracles.rubbed_rod import RubbedRod
from oracles.sealed_session import STANDARD_EI, Fibre, Session, World
from unit.autonomy.bending.sealed_fibres import SCALE, spans_of

SETTINGS = FitSettings()
WORLD = World(
    noise_un=0.03,
    friction=(0.3, 0.3),
    clamp=("log", 20.0, 0.3),
    jaw_un_um=(1500.0, 0.0),
    probe_side_un_um=10.0,
    relaxation=(0.01, 0.0),
    arc_deg=(40.0, 0.2),
)
ARC_UM = 1300.0


@pytest.mark.parametrize(
    ("turn_deg", "friction", "side", "span_um", "ei"),
    [
        (0.0, 0.3, 1e6, 400.0, 5e7),
        (0.0, 0.5, 10.0, 400.0, 5e7),
        (35.0, 0.3, 10.0, 400.0, 3e7),
        (35.0, 0.2, 10.0, 120.0, 3e7),
        (-35.0, 0.3, 10.0, 450.0, 1.5e8),
        (-35.0, 0.15, 10.0, 600.0, 3e7),
        (60.0, 0.3, 10.0, 400.0, 5e7),
        (-60.0, 0.3, 5.0, 250.0, 5e7),
    ],
)
def test_a_push_out_and_back_follows_the_law_of_coulomb(
    turn_deg: float, friction: float, side: float, span_um: float, ei: float
) -> None:
    shape = NaturalShape(*arc(ARC_UM, turn_deg, 400).T, span_um)
    most = max(friction, LAID_FRICTION)
    rubbed = rubbed_of([(shape, (ei / side,))], depth_um=0.0, radius_um=20.0, friction=most)
    stroke = min(0.1 * span_um, 40.0, 60.0 * span_um**3 / (3.0 * ei))
    ((((out, back),),),) = rubbed.curves([stroke], parts=[friction / most])
    lever = shape.lever_um()
    travels = np.linspace(0.04, 1.0, 25) * stroke
    found = np.concatenate(
        [
            3.0 * ei / lever**2 * np.interp(each, way.deflection * lever, way.pushed)
            for each, way in ((travels, out), (travels[-2:1:-1], back))
        ]
    )
    rod = RubbedRod(
        ei, span_um, friction, side, curvature=np.radians(turn_deg) / ARC_UM, radius_um=20.0
    )
    expected = [rod.go(each)[0] for each in [*travels.tolist(), *travels[-2:1:-1].tolist()]]
    assert found == pytest.approx(np.array(expected), rel=0.015, abs=0.1)


def fits(world: World, seed: int, count: int = 5) -> list[SpanFit]:
    session = Session(world, np.random.default_rng(seed))
    fibres = [Fibre.drawn(session) for _ in range(count)]
    measured = [measure_fibre(spans_of(session, each), settings=SETTINGS) for each in fibres]
    return [fit for each in measured for fit in each.spans]


@pytest.mark.parametrize("friction", [0.15, 0.3, 0.5])
def test_friction_is_read_from_the_shapes_of_curves(friction: float) -> None:
    found = known_friction(fits(dataclasses.replace(WORLD, friction=(friction,) * 2), 3), SETTINGS)
    assert not found.slides
    assert found.friction == pytest.approx(friction, abs=0.12)
    assert found.std < 0.09


def test_a_probe_that_never_sticks_is_noticed() -> None:
    found = known_friction(fits(dataclasses.replace(WORLD, slides=True), 3), SETTINGS)
    assert found.slides
    assert found.std == SETTINGS.friction_std


def test_a_probe_that_gives_way_more_than_it_should_is_noticed() -> None:
    soft, stiff = (
        known_friction(fits(dataclasses.replace(WORLD, probe_side_un_um=side), 3), SETTINGS).gives
        for side in (5.0, 20.0)
    )
    assert soft > 1.2 > 0.9 > stiff


def test_without_any_span_nothing_is_known() -> None:
    found = known_friction([], SETTINGS)
    assert (found.friction, found.std) == (SETTINGS.friction, SETTINGS.friction_std)


@pytest.mark.parametrize(
    ("friction", "slides"), [(0.1, False), (0.3, False), (0.5, False), (0.1, True), (0.3, True)]
)
def test_curled_fibres_are_measured_right_whether_contacts_stick_or_not(
    friction: float, slides: bool
) -> None:
    world = dataclasses.replace(
        WORLD, friction=(friction, friction), slides=slides, arc_deg=(60.0, 0.1)
    )
    session = Session(world, np.random.default_rng(6))
    certificate = Certificate(STANDARD_EI * SCALE, 0.02)
    beam = spans_of(session, Fibre.standard(session))
    standards = [measure_fibre(beam, settings=SETTINGS, certificate=certificate)]
    drawn = [Fibre.drawn(session) for _ in range(6)]
    spans = [spans_of(session, each) for each in drawn]
    fibres = [measure_fibre(each, settings=SETTINGS) for each in spans]
    results = assess_campaign(fibres, standards=standards, settings=SETTINGS).fibres
    errors = []
    for fibre, pushes, found in zip(drawn, spans, results, strict=True):
        true = fibre.true_ei(max(each.nominal_um for each in pushes)) * SCALE
        errors.append(np.log(found.ei_n_m2 / true))
        assert found.ei_low_n_m2 < true < found.ei_high_n_m2
    assert abs(float(np.mean(errors))) < 0.04


@pytest.mark.parametrize(
    ("friction", "slides", "side"),
    [(0.06, False, 10.0), (0.1, True, 10.0), (0.3, False, 10.0), (0.3, False, 5.0)],
)
def test_a_standard_is_read_about_the_friction_that_is_there(
    friction: float, slides: bool, side: float
) -> None:
    """Half of it, on the same probe; low friction hardly shows whether contacts stick."""
    session = Session(
        dataclasses.replace(
            WORLD, friction=(friction, friction), slides=slides, probe_side_un_um=side
        ),
        np.random.default_rng(6),
    )
    certificate = Certificate(STANDARD_EI * SCALE, 0.02)
    beam = measure_fibre(
        spans_of(session, Fibre.standard(session)), settings=SETTINGS, certificate=certificate
    )
    fibres = [
        measure_fibre(spans_of(session, Fibre.drawn(session)), settings=SETTINGS) for _ in range(6)
    ]
    (found,) = assess_campaign(fibres, standards=[beam], settings=SETTINGS).standards
    assert all(each.chi2 < each.freedom for each in found.spans)
    read = np.log(found.ei_n_m2 / certificate.ei_n_m2 / session.gain)
    assert read == pytest.approx(0.0, abs=0.015)
