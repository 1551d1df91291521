"""The question of an initialisation, asked of a program at another station."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from contract.station_rig import connected_in_memory
from cosmic.frame.errors import MoveCancelled
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.host import Host
from cosmic.frame.network.station import Station
from cosmic.mico.api.client import MicoClient
from cosmic.mico.api.mico import Mico, mico_of
from unit.mico.rigs import mico

ASKED = "is the plate clear?"


@contextmanager
def remote(policy: FailurePolicy, times: int = 1) -> Iterator[Mico]:
    """MiCo of a station whose initialisation asks, as a program at another station has it."""
    steps = {"initialisation": {"step": [{"do": "confirm", "text": ASKED}] * times}}
    with mico(**steps) as (here, _controller):
        station, side = Station("fibres", FailurePolicy()), Host("mico", here)
        station.host("mico", side)
        try:
            with connected_in_memory(station, "notebook") as transport:
                transport.take_lease()
                application = MicoClient(transport, policy)
                try:
                    application.initialize()
                    yield mico_of(application)
                finally:
                    application.shut_down()
        finally:
            side.close()


def test_the_answer_of_a_program_at_another_station_counts() -> None:
    asked: list[str] = []
    with remote(FailurePolicy()) as far:
        far.initialise(confirm=lambda text: not asked.append(text))
        assert asked == [ASKED]
        with pytest.raises(MoveCancelled, match="answered with no"):
            far.initialise(confirm=lambda _text: False)


def test_the_same_question_twice_in_a_row_is_asked_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cosmic.mico.api.client.POLL_S", 0.5)  # so that no look falls in between
    asked: list[str] = []
    with remote(FailurePolicy(), times=2) as far:
        far.initialise(confirm=lambda text: not asked.append(text))
    assert asked == [ASKED, ASKED]


@pytest.mark.defects
def test_a_mistake_in_what_should_answer_is_no_and_stops_nothing() -> None:
    policy, stops = FailurePolicy(), list[str]()
    policy.on_safe_stop(stops.append)

    def confirm(_text: str) -> bool:
        raise KeyError("plate")

    with remote(policy) as far:
        with pytest.raises(MoveCancelled, match="answered with no"):
            far.initialise(confirm=confirm)
        assert not stops
        far.initialise(confirm=lambda _text: True)
