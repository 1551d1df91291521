"""Who waits on a fast clock, and who must know of it."""

import math

from cosmic.frame.expectations import MOST, Expectations


def test_times_to_come_are_in_order_and_those_before_are_dropped():
    expectations = Expectations()
    for each in (3.0, 1.0, 2.0):
        expectations.add(each)
    assert expectations.next_s(0.5) == 1.0
    assert expectations.next_s(1.0) == 2.0, "what has come is waited for no longer"
    assert expectations.next_s(0.0) == 2.0
    assert expectations.next_s(3.0) == math.inf


def test_whoever_brings_it_hears_of_a_new_one():
    expectations, heard = Expectations(), []
    expectations.added.subscribe(heard.append)
    expectations.add(4.0)
    assert heard == [4.0]


def test_for_ever_is_waited_for_by_nobody():
    expectations, heard = Expectations(), []
    expectations.added.subscribe(heard.append)
    expectations.add(math.inf)
    expectations.add(math.nan)
    assert heard == []
    assert expectations.next_s(0.0) == math.inf


def test_what_nobody_comes_for_does_not_grow_for_ever():
    expectations = Expectations()
    for number in range(10 * MOST):
        expectations.add(float(number))
    assert expectations.next_s(-1.0) == 0.0
    assert expectations.next_s(MOST - 1.0) == math.inf, "the latest ones are not kept"
