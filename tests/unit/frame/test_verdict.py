"""The gate's answer as a value."""

import dataclasses

import pytest

from cosmic.frame.verdict import ALLOWED, MoveVerdict, Reason, refuse


def test_a_verdict_says_whether_it_allows_and_is_itself_neither_true_nor_false() -> None:
    assert ALLOWED.allowed
    assert not refuse(Reason.LIMIT, "no").allowed
    with pytest.raises(TypeError, match="allowed"):
        bool(ALLOWED)


def test_a_refusal_keeps_what_was_asked_and_what_stood_against_it() -> None:
    verdict = refuse(Reason.LIMIT, "too far", axis="left.x", value=9000.0, limit=8000.0, unit="um")
    assert (verdict.axis, verdict.value, verdict.limit, verdict.unit) == (
        "left.x",
        9000.0,
        8000.0,
        "um",
    )
    assert (verdict.reason, str(verdict)) == (Reason.LIMIT, "too far")


def test_a_verdict_without_text_reads_as_its_reason() -> None:
    assert str(MoveVerdict(allowed=False, reason=Reason.NO_LEASE)) == "NO_LEASE"


def test_nobody_can_change_a_verdict() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        ALLOWED.allowed = False  # type: ignore[misc]


def test_reasons_are_their_own_words() -> None:
    assert all(reason == reason.name for reason in Reason)
