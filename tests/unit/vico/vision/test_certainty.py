"""What is certain is one whole fibre; what is whole is mostly certain."""

import cv2
import numpy as np
import pytest
from benchmarks.certainty import (
    CHECKED,
    FITTED,
    LEAST_WEIGHT,
    Example,
    Population,
    cases,
    drawn_cases,
    examples,
    field_of_twenty,
    fit,
    split,
    wrong,
)
from benchmarks.fibre_pairs import TOLD_APART, Kind, draw

from cosmic.vico.api import find_fibres
from cosmic.vico.core.vision import checks
from cosmic.vico.core.vision.axial import NAMES, Joints
from cosmic.vico.core.vision.certainty import CERTAIN, WEIGHTS, Signs, probability
from cosmic.vico.core.vision.certainty import NAMES as SIGNS
from cosmic.vico.core.vision.profiles import Profiles, find_edges
from unit.vico.vision.drawn_fibres import arc, drawn_image, strip

PAIRS = (Kind.TOUCHING, Kind.OVERLAPPING, Kind.GAP)
CLEARLY = 2.0 * TOLD_APART


def test_whole_fibres_stay_certain_and_their_interval_holds_the_length() -> None:
    found = [drawn_cases(draw(Kind.SINGLE, seed, jpeg=False)) for seed in range(200, 224)]
    certain = [case for each in found for case in each if case.fibre.certain]
    assert len(certain) >= 20
    assert all(case.right for case in certain)
    inside = [
        case.fibre.length_interval_px[0] <= case.length_px <= case.fibre.length_interval_px[1]
        for case in certain
    ]
    assert sum(inside) >= 0.85 * len(certain)


@pytest.mark.parametrize("kind", PAIRS)
def test_pairs_that_differ_clearly_are_not_one_certain_fibre(kind: Kind) -> None:
    """How near the limit of what pixels tell one may come is the benchmark's to say."""
    drawn = [one for seed in range(300, 316) if (one := draw(kind, seed)).apart >= CLEARLY]
    assert len(drawn) >= 5
    assert sum(wrong(drawn_cases(one)) for one in drawn) == 0


def test_a_gap_of_half_a_width_is_found_as_two_drawn_in_another_way() -> None:
    both = gaps = 0
    for seed in range(1, 13, 2):
        image, lines, gap = split(seed)
        found = cases(find_fibres(image), lines)
        assert wrong(found) == 0
        if gap >= 0.5:
            gaps += 1
            both += sum(case.right for case in found) == 2
    assert both >= 0.8 * gaps


def test_a_crossing_of_which_a_short_end_is_not_seen_is_not_read_with_certainty() -> None:
    image, lines = field_of_twenty(502)
    assert wrong(cases(find_fibres(image), lines)) == 0


def test_a_fibre_that_goes_on_thinner_is_not_certain() -> None:
    drawn = [drawn_cases(draw(Kind.GOES_ON, seed)) for seed in range(400, 412)]
    assert sum(wrong(each) for each in drawn) == 0


@pytest.mark.parametrize("seed", [100_020, 100_064, 100_280, 100_295])
def test_what_is_uneven_all_along_has_no_dirt_at_its_ends(seed: int) -> None:
    (found,) = drawn_cases(draw(Kind.SINGLE, seed, jpeg=False, large=seed % 7 < 2))
    assert found.right
    assert checks.IMPRECISE not in found.fibre.doubts


@pytest.mark.parametrize(("seed", "jpeg"), [(640_200, True), (640_272, True), (620_818, False)])
def test_a_joint_that_compression_or_roughness_hides_is_not_certain(seed: int, jpeg: bool) -> None:
    one = draw(PAIRS[seed % 3], seed, jpeg=jpeg, large=seed % 7 < 2)
    assert wrong(drawn_cases(one)) == 0


@pytest.mark.parametrize("seed", [1_511_428, 1_511_443])
def test_a_joint_that_shows_in_no_single_sign_is_not_certain(seed: int) -> None:
    one = draw(PAIRS[seed % 3], seed, large=seed % 7 < 2)
    assert wrong(drawn_cases(one)) == 0


def test_what_goes_on_faintly_beyond_an_end_is_seen() -> None:
    line = arc((60.0, 200.0), 0.0, 250.0, 0.0)
    image = drawn_image([line], [12.0], noise=2.0).astype(np.float32)
    whole = find_fibres(image.astype(np.uint8))[0]
    assert whole.certain
    image -= 14.0 * strip(image.shape[:2], arc((310.0, 200.0), 0.2, 200.0, 0.0), 4.0)
    part = next(
        each for each in find_fibres(image.astype(np.uint8)) if abs(each.length_px - 250.0) < 20.0
    )
    assert not part.certain
    assert part.probability < whole.probability


def test_a_sign_that_becomes_clearer_lowers_the_probability() -> None:
    values = [probability(Signs(soft=level, goes_on=level), []) for level in (0.0, 0.5, 0.8, 1.2)]
    assert values == sorted(values, reverse=True)
    assert values[0] >= CERTAIN > values[-1]
    assert probability(Signs(), ["the image's border cuts it off"]) == 0.0


def test_weak_signs_count_together_where_they_lie_in_one_place() -> None:
    weak = 0.9  # From 1 on a sign counts by itself.
    scattered = np.diag(np.full(len(NAMES), weak))
    together = np.zeros_like(scattered)
    together[:, 3] = weak
    uneven, joint = (Signs(Joints(along=along)) for along in (scattered, together))
    assert probability(uneven, []) >= CERTAIN
    assert probability(joint, []) < 0.9


def test_a_network_that_sees_no_joint_makes_little_of_the_other_signs() -> None:
    weak = Joints(along=np.full((len(NAMES), 1), 0.5))
    alone, looked = (probability(Signs(weak, joint=level), []) for level in (None, 0.0))
    assert alone < looked
    assert looked / (1.0 - looked) < 2.5 * alone / (1.0 - alone)


def test_a_network_that_sees_a_joint_takes_the_certainty_away() -> None:
    told = [probability(Signs(joint=level), []) for level in (0.0, 0.5, 1.0, 2.0)]
    assert told == sorted(told, reverse=True)
    assert told[0] >= CERTAIN > told[2]


def test_a_compressed_fibre_without_a_sign_is_certain() -> None:
    levels = [probability(Signs(compressed=level), []) for level in (0.0, 0.8, 1.5, 6.0)]
    assert levels == sorted(levels, reverse=True)
    assert levels[-1] >= CERTAIN
    weak = Joints(along=np.full((len(NAMES), 1), 0.35))
    plain, compressed = (probability(Signs(weak, compressed=level), []) for level in (0.0, 1.5))
    assert plain > compressed


def test_on_a_compressed_image_a_network_that_sees_no_joint_makes_more_certain() -> None:
    weak = Joints(along=np.full((len(NAMES), 1), 0.35))
    unasked, clear, gloss, joined = (
        probability(Signs(weak, compressed=2.0, joint=level), [])
        for level in (None, 0.0, 0.48, 1.0)
    )
    assert clear >= CERTAIN > unasked
    assert gloss >= unasked > joined
    strong = Joints(along=np.full((len(NAMES), 1), 1.0))
    assert probability(Signs(strong, compressed=2.0, joint=0.0), []) < CERTAIN


@pytest.mark.parametrize("seed", [4_300_417, 4_300_879])
def test_a_joint_that_only_the_network_sees_on_a_compressed_image_is_not_certain(seed: int) -> None:
    one = draw(PAIRS[seed % 3], seed, jpeg=True, large=seed % 7 < 2, compare=False)
    assert wrong(drawn_cases(one)) == 0


def test_on_compressed_images_most_single_fibres_are_certain() -> None:
    drawn = [draw(Kind.SINGLE, seed, jpeg=True) for seed in range(200, 248)]
    found = [drawn_cases(one) for one in drawn if one.view.jpeg >= 70]
    certain = sum(any(case.fibre.certain and case.right for case in each) for each in found)
    assert certain >= 0.65 * len(found)
    assert sum(wrong(each) for each in found) == 0


def test_what_compression_hides_at_quality_75_counts_no_more_at_30() -> None:
    image = drawn_image([arc((100.0, 200.0), 0.0, 300.0, 0.3)], [12.0], noise=4.0)
    told = []
    for quality in (30, 60, 75):
        coded = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])[1]
        fibre = find_fibres(cv2.imdecode(coded, cv2.IMREAD_GRAYSCALE))[0]
        told.append(fibre.signs[SIGNS.index("compressed")])
    assert told[0] == told[1] == told[2] > 1.0
    never = find_fibres(image)[0].signs[SIGNS.index("compressed")]
    assert never < 0.1


def learnt_from(gap: float, *, right: bool, others: float = 0.3) -> Example:
    along = np.full((len(NAMES), 3), others)
    along[0, 1] = gap
    return Example(Signs(Joints(along=along)), right, None)


def test_a_useful_sign_is_given_weight_and_a_useless_one_is_left_at_the_floor() -> None:
    gaps = np.linspace(0.0, 1.4, 29)
    known = [learnt_from(gap, right=bool(gap < 0.7)) for gap in gaps]
    *weights, alone = fit(known)
    assert weights[0] > 3.0
    assert weights[1:] == pytest.approx([LEAST_WEIGHT] * (len(SIGNS) - 1))
    assert alone > 0.0


def test_how_many_are_right_says_nothing_about_the_weights() -> None:
    few = [learnt_from(gap, right=right) for gap in (0.3, 0.6, 1.0) for right in (True, False)]
    many = few + 4 * [each for each in few if each.right]
    np.testing.assert_allclose(fit(many), fit(few), atol=0.02)


def test_what_is_learnt_is_the_same_again_and_is_never_what_is_checked() -> None:
    for population in FITTED:
        assert not set(population.seeds) & set(CHECKED)
    part = Population((Kind.SINGLE, Kind.TOUCHING), range(335_000, 335_004))
    first, again = (examples(part, part.seeds) for _ in range(2))
    assert [each.right for each in first] == [each.right for each in again]
    assert {True, False} == {each.right for each in first}
    for one, other in zip(first, again, strict=True):
        np.testing.assert_array_equal(
            one.signs.weighed_by(WEIGHTS), other.signs.weighed_by(WEIGHTS)
        )


@pytest.mark.parametrize("degrees", [20, 26, 32, 38])
def test_a_fibre_that_another_one_crosses_obliquely_is_not_longer_for_it(degrees: int) -> None:
    lean = float(np.radians(degrees))
    first = arc((100.0, 240.0), 0.0, 420.0, 0.0)
    start = (310.0 - 170.0 * np.cos(lean), 240.0 - 170.0 * np.sin(lean))
    second = arc(start, lean, 340.0, 0.0)
    found = find_fibres(drawn_image([first, second], [9.0, 12.0], noise=2.0))
    for fibre, length in zip(found, (420.0, 340.0), strict=True):
        low, high = fibre.length_interval_px
        assert low <= length <= high


def test_an_edge_that_is_covered_before_the_section_falls_is_not_seen() -> None:
    across = np.arange(-40.0, 41.0, dtype=np.float32)
    height = np.tile(np.exp(-0.5 * (across / 12.0) ** 2), (60, 1)).astype(np.float32)
    flat = np.zeros(60)
    for reach, cut in ((40.0, False), (12.0, True)):
        clear = np.tile(np.abs(across) <= reach, (60, 1))
        seen = Profiles(across, height, clear, 0.0, np.zeros((60, 2)), flat, flat)
        assert find_edges(seen, height * clear, np.ones(60, np.bool_), 28.0).cut is cut
