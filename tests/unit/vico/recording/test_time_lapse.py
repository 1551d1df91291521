"""`TimeLapse`: an image each interval of platform time, late ones counted."""

import math

import pytest

from cosmic.frame.errors import ConfigError
from cosmic.vico.core.recording.time_lapse import TimeLapse, TimeLapsePlan


def chosen(lapse, times_s):
    return [time_s for time_s in times_s if lapse.take(time_s)]


def test_an_image_is_taken_at_each_interval_so_many_times():
    lapse = TimeLapse(TimeLapsePlan(interval_s=2.0, count=3), start_s=10.0)
    assert chosen(lapse, [9.0 + 0.5 * step for step in range(20)]) == [10.0, 12.0, 14.0]
    assert (lapse.taken, lapse.late, lapse.missed) == (3, 0, 0)
    assert lapse.done
    assert lapse.due_s is None


def test_it_ends_at_a_time():
    lapse = TimeLapse(TimeLapsePlan(interval_s=1.0, until_s=2.0), start_s=0.0)
    assert chosen(lapse, [0.25 * step for step in range(40)]) == [0.0, 1.0, 2.0]
    assert lapse.done


def test_without_an_end_it_goes_on():
    lapse = TimeLapse(TimeLapsePlan(interval_s=1.0), start_s=0.0)
    assert len(chosen(lapse, range(1000))) == 1000
    assert lapse.due_s == 1000.0
    assert not lapse.done


def test_a_late_image_is_counted_and_delays_no_other():
    lapse = TimeLapse(TimeLapsePlan(interval_s=1.0), start_s=0.0, late_after_s=0.2)
    assert chosen(lapse, [0.1, 1.5, 1.9, 2.1, 3.0]) == [0.1, 1.5, 2.1, 3.0]
    assert lapse.late == 1


def test_times_that_pass_without_an_image_are_counted_as_missed():
    lapse = TimeLapse(TimeLapsePlan(interval_s=1.0, count=6), start_s=0.0)
    assert chosen(lapse, [0.0, 3.05, 3.5, 4.0]) == [0.0, 3.05, 4.0]
    assert (lapse.taken, lapse.late, lapse.missed) == (3, 0, 2)
    assert not lapse.take(7.0)
    assert (lapse.taken, lapse.missed) == (3, 3)
    assert lapse.done


def test_an_image_of_no_known_time_is_not_taken():
    assert not TimeLapse(TimeLapsePlan(interval_s=1.0), start_s=0.0).take(math.nan)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"interval_s": 0.0}, "interval 0.0 s"),
        ({"interval_s": 1e-9}, "0.001 s is the shortest"),
        ({"interval_s": math.nan}, "interval nan s"),
        ({"interval_s": math.inf}, "interval inf s"),
        ({"interval_s": 1.0, "count": 0}, "0 images"),
        ({"interval_s": 1.0, "until_s": math.nan}, "not a number"),
    ],
)
def test_a_plan_that_makes_no_sense_is_refused(wrong, said):
    with pytest.raises(ConfigError, match=said):
        TimeLapsePlan(**wrong)
