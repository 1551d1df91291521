"""What fibres of a campaign teach of each other, and what each of them tells of the instrument."""

import dataclasses
import math

import numpy as np
import pytest

from cosmic.autonomy.bending.curved import NaturalShape
from cosmic.autonomy.bending.fit import Certificate, MeasuredFibre, assess_campaign, fit_campaign
from cosmic.autonomy.bending.fit import measure_fibre as measure
from cosmic.autonomy.bending.response import direction_by_touch
from cosmic.autonomy.bending.settings import FitSettings
from oracles.sealed_session import STANDARD_EI, Fibre, Session, World, curves
from unit.autonomy.bending.sealed_fibres import SCALE, spans_of

WORLD = World(
    noise_un=0.03,
    friction=(0.2, 0.2),
    clamp=("log", 20.0, 0.3),
    jaw_un_um=(1500.0, 0.0),
    probe_side_un_um=10.0,
)
SETTINGS = FitSettings()
ALONG = "stiffness along the fibre"
CERTIFICATE = Certificate(STANDARD_EI * SCALE, 0.02)
PLACES_UM = np.array([120.0, 240.0, 360.0, 480.0, 600.0])


def drawn(world: World, seed: int, count: int) -> tuple[Session, list[Fibre]]:
    session = Session(world, np.random.default_rng(seed))
    return session, [Fibre.drawn(session) for _ in range(count)]


def measured(session: Session, fibre: Fibre) -> MeasuredFibre:
    return measure(spans_of(session, fibre), settings=SETTINGS)


def touched(fibre: Fibre, *, shown_deg: float, farther_um: float) -> tuple[float, float]:
    """Return how the fibre seems to be turned beside what is shown, and that by contact, deg."""
    _, _, _, touch_um = curves(fibre, PLACES_UM + farther_um)
    line = fibre.line(shown_deg)
    found = direction_by_touch(
        [NaturalShape(line[:, 0], line[:, 1], each) for each in PLACES_UM],
        fibre.held_y_um - touch_um,
        radius_um=25.0,
        noise_um=0.5,
        prior_rad=math.radians(1.0),
    )
    return math.degrees(found.turned_rad), math.degrees(found.by_contact)


@pytest.mark.parametrize("arc_deg", [0.0, 40.0, -70.0])
@pytest.mark.parametrize("shown_deg", [-2.0, 1.0])
def test_first_contacts_give_the_direction_of_a_fibre_beside_the_image(
    arc_deg: float, shown_deg: float
) -> None:
    fibre = dataclasses.replace(drawn(WORLD, 1, 1)[1][0], turn_deg=arc_deg)
    turned_deg, _ = touched(fibre, shown_deg=shown_deg, farther_um=0.0)
    assert turned_deg == pytest.approx(-shown_deg, abs=0.15)


@pytest.mark.parametrize("arc_deg", [50.0, -50.0])
def test_a_displaced_edge_turns_a_curled_fibre_by_its_derivative(
    arc_deg: float,
) -> None:
    fibre = dataclasses.replace(drawn(WORLD, 1, 1)[1][0], turn_deg=arc_deg)
    turned_deg, by_contact_deg = touched(fibre, shown_deg=0.0, farther_um=8.0)
    assert abs(turned_deg) > 0.2
    assert turned_deg + 8.0 * by_contact_deg == pytest.approx(0.0, abs=0.1)


@pytest.mark.parametrize(("variation", "low", "high"), [(0.02, 0.0, 0.06), (0.35, 0.26, 0.5)])
def test_how_much_fibres_vary_along_themselves_is_learned_from_all_of_them(
    variation: float, low: float, high: float
) -> None:
    session, fibres = drawn(dataclasses.replace(WORLD, ei_cv=variation), 5, 16)
    found = fit_campaign([measured(session, each) for each in fibres])
    lines = [line for each in found for line in each.budget if line.source == ALONG]
    assert low < np.median([line.std for line in lines]) < high


def test_jaws_far_softer_than_they_are_believed_to_be_are_found() -> None:
    world = dataclasses.replace(WORLD, jaw_un_um=(100.0, 0.0), stiffness=((1.0, 1.2e8, 0.4),))
    session, fibres = drawn(world, 7, 16)
    beams = [spans_of(session, Fibre.standard(session)) for _ in range(3)]
    found = fit_campaign(
        [measured(session, each) for each in fibres],
        standards=[measure(each, settings=SETTINGS, certificate=CERTIFICATE) for each in beams],
    )
    off = [
        math.log(each.ei_n_m2 / (fibre.true_ei(600.0) * SCALE))
        for each, fibre in zip(found, fibres, strict=True)
    ]
    assert abs(np.mean(off)) < 0.01
    assert np.sqrt(np.mean(np.square(off))) < 0.02


@pytest.mark.parametrize("shown_deg", [-8.0, -5.0, 5.0, 8.0])
def test_a_standard_whose_direction_the_image_has_wrong_is_believed_less(shown_deg: float) -> None:
    session, fibres = drawn(WORLD, 9, 4)
    beam = Fibre.standard(session)
    beams = [spans_of(session, beam, shown_deg=shown_deg) for _ in range(3)]
    scale = assess_campaign(
        [measured(session, each) for each in fibres],
        standards=[measure(each, settings=SETTINGS, certificate=CERTIFICATE) for each in beams],
    ).scale
    assert abs(scale.off_part) < 2.0 * scale.off_std_part
