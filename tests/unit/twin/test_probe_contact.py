"""Contact that remembers its side."""

from cosmic.twin.probe_contact import ProbeContact


def look(*places: tuple[float, float]) -> list[bool]:
    touch = ProbeContact()
    return [touch.look(reach, way) for reach, way in places]


def test_a_probe_that_comes_from_the_front_touches() -> None:
    assert look((10.0, -5.0), (10.0, 0.5), (10.0, 3.0)) == [False, True, True]


def test_one_long_step_through_a_thin_body_is_still_a_touch() -> None:
    assert look((10.0, -500.0), (10.0, 4000.0)) == [False, True]


def test_a_probe_that_is_past_the_face_when_first_seen_pushes_nothing() -> None:
    assert look((10.0, 20.0), (10.0, 30.0)) == [False, False]


def test_a_probe_that_comes_in_from_the_side_stands_beside() -> None:
    assert look((-10.0, 20.0), (10.0, 20.0), (10.0, 40.0)) == [False, False, False]


def test_beside_becomes_before_once_it_went_back() -> None:
    assert look((-10.0, 20.0), (10.0, 20.0), (10.0, -1.0), (10.0, 1.0))[-1]


def test_leaving_sideways_ends_the_touch_and_coming_back_does_not_renew_it() -> None:
    assert look((10.0, -5.0), (10.0, 5.0), (-1.0, 5.0), (10.0, 5.0)) == [False, True, False, False]


def test_of_two_crossings_in_one_step_the_first_counts() -> None:
    assert look((-10.0, -90.0), (90.0, 10.0))[-1], "over the body first, then down on it"
    assert not look((-90.0, -10.0), (10.0, 90.0))[-1], "past the face first, then in from the side"


def test_a_lost_touch_is_not_found_again_from_behind() -> None:
    touch = ProbeContact()
    touch.look(10.0, -1.0)
    assert touch.look(10.0, 50.0)
    touch.lose()
    assert not touch.look(10.0, 60.0)
    assert not touch.look(10.0, 0.0)
    assert touch.look(10.0, 1.0)
