"""Where a held fibre is foreseen, by where the probe has met it: right, and honest about it."""

import numpy as np
import pytest

from cosmic.autonomy.handling.surface import Contact, foresee_off

SPANS_UM = (600.0, 480.0, 360.0, 240.0, 120.0)


def test_before_a_fibre_was_met_it_may_lie_anywhere_near() -> None:
    off, std = foresee_off((), 600.0)
    assert off == 0.0
    assert 20.0 < std < 50.0


def test_a_fibre_that_lies_off_as_a_whole_or_askew_is_foreseen() -> None:
    for offs in (lambda _: 17.0, lambda span: 0.03 * span, lambda span: 5.0 - 0.02 * span):
        met = [Contact(span, offs(span), 0.7) for span in SPANS_UM[:3]]
        off, std = foresee_off(met, 240.0)
        assert off == pytest.approx(offs(240.0), abs=2.0)
        assert std < 4.0


def test_contacts_known_to_a_step_of_the_search_do_not_lead_it_astray() -> None:
    # Two close together, each half a step off to the other side: their line would be 6 um off.
    met = [Contact(461.0, 24.0, 4.0), Contact(391.0, 20.5, 4.0), Contact(324.0, 25.9, 1.8)]
    off, std = foresee_off(met, 256.0)
    assert off == pytest.approx(22.5, abs=2.5)
    assert 1.0 < std < 5.0


def test_what_is_foreseen_lies_within_three_deviations_of_where_a_fibre_is_met() -> None:
    random = np.random.default_rng(8)
    outside = total = 0
    for _ in range(200):
        shift, askew, bow = random.normal(0.0, (12.0, 20.0, 6.0))
        slope = abs(random.normal(0.0, 0.3))
        rough = random.normal(0.0, 1.0 + 3.0 * slope, len(SPANS_UM))
        far = np.array(SPANS_UM) / 600.0
        true = shift + askew * far + bow * far**2 + rough
        met: list[Contact] = []
        for span, here in zip(SPANS_UM, true.tolist(), strict=True):
            if met:
                off, std = foresee_off(met, span, slope)
                outside += here < off - 3.0 * std
                total += 1
            met.append(Contact(span, here + random.normal(0.0, 0.7), 0.7, slope))
    assert outside <= 0.005 * total


def test_a_steep_fibre_is_known_less_well() -> None:
    met = [Contact(600.0, 3.0, 0.7), Contact(480.0, 3.0, 0.7)]
    assert foresee_off(met, 360.0, 0.8)[1] > foresee_off(met, 360.0)[1] + 1.0
