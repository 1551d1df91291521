"""What everybody may rely on who tells or hears of something: `Event`."""

import logging
import threading
from collections.abc import Callable

import pytest

from cosmic.frame.events import Event


@pytest.fixture
def event() -> Event[int]:
    return Event()


def test_all_subscribers_hear_in_the_order_in_which_they_subscribed(event: Event[int]) -> None:
    heard: list[tuple[str, int]] = []
    event.subscribe(lambda value: heard.append(("first", value)))
    event.subscribe(lambda value: heard.append(("second", value)))
    event.emit(7)
    assert heard == [("first", 7), ("second", 7)]


def test_an_event_without_a_value_only_says_that_it_happened() -> None:
    happened: Event[[]] = Event()
    calls: list[str] = []
    happened.subscribe(lambda: calls.append("heard"))
    happened.emit()
    assert calls == ["heard"]


def test_nobody_hears_after_the_subscription_ended(event: Event[int]) -> None:
    heard: list[int] = []
    unsubscribe = event.subscribe(heard.append)
    event.emit(1)
    unsubscribe()
    event.emit(2)
    assert heard == [1]
    assert len(event) == 0


def test_ending_twice_harms_nobody_who_subscribed_the_same_callable(event: Event[int]) -> None:
    heard: list[int] = []
    listener = heard.append
    unsubscribe = event.subscribe(listener)
    event.subscribe(listener)
    unsubscribe()
    unsubscribe()
    event.emit(3)
    assert heard == [3]


def test_a_subscriber_that_fails_is_logged_and_keeps_nobody_from_hearing(
    event: Event[int], caplog: pytest.LogCaptureFixture
) -> None:
    heard: list[int] = []
    event.subscribe(lambda value: heard.append(value // 0))
    event.subscribe(heard.append)
    with caplog.at_level(logging.ERROR, "cosmic"):
        event.emit(4)
    assert heard == [4]
    assert "a subscriber failed" in caplog.text
    assert "ZeroDivisionError" in caplog.text


def test_a_subscriber_may_end_itself_and_bring_others_while_it_hears(event: Event[int]) -> None:
    heard: list[str] = []
    ends: list[Callable[[], None]] = []

    def once(value: int) -> None:
        heard.append(f"once {value}")
        ends[0]()
        event.subscribe(lambda value: heard.append(f"later {value}"))

    ends.append(event.subscribe(once))
    event.emit(1)
    event.emit(2)
    assert heard == ["once 1", "later 2"]


def test_a_slow_subscriber_in_one_thread_delays_no_emission_in_another(event: Event[int]) -> None:
    entered, release, past = threading.Event(), threading.Event(), threading.Event()

    def hear(value: int) -> None:
        if value == 1:
            entered.set()
            release.wait(20.0)
        else:
            past.set()

    event.subscribe(hear)
    slow = threading.Thread(target=event.emit, args=(1,))
    slow.start()
    assert entered.wait(20.0)
    event.emit(2)
    event.subscribe(lambda _value: None)()
    assert past.is_set()
    assert slow.is_alive()
    release.set()
    slow.join(20.0)


def test_subscriptions_from_many_threads_are_all_kept(event: Event[int]) -> None:
    heard: list[int] = []

    def subscribe_often() -> None:
        for _ in range(200):
            event.subscribe(lambda _value: None)()
            event.subscribe(heard.append)

    threads = [threading.Thread(target=subscribe_often) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20.0)
    event.emit(5)
    assert heard == [5] * 800


@pytest.mark.parametrize("odd", [None, 5, "abc"])
def test_what_cannot_be_called_is_refused_at_once(odd: object) -> None:
    heard: Event[[]] = Event()
    with pytest.raises(TypeError, match="subscriber must be callable"):
        heard.subscribe(odd)  # type: ignore[arg-type]
    assert len(heard) == 0
