"""The guard of the benchmarks: what got worse fails by its name."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from benchmarks import guard, guarded
from benchmarks.figures import Figure

from cosmic.mico.core.collision.sweep import Sweep

KEPT = {"gate: check": 2.0, "commands: stop": 10.0}


def test_what_is_at_most_one_and_a_half_times_as_much_is_good() -> None:
    assert guard.beyond(KEPT, {"gate: check": 3.0, "commands: stop": 0.1}) == {}


def test_what_is_worse_is_reported_by_its_name_with_both_values() -> None:
    bad = guard.beyond(KEPT, {"gate: check": 3.02, "commands: stop": 10.0})
    assert bad == {"gate: check": "3.02 now, 2 kept: 1.51 times as much"}


def test_what_is_not_a_number_is_worse() -> None:
    assert set(guard.beyond(KEPT, {**KEPT, "gate: check": float("nan")})) == {"gate: check"}


def test_what_was_not_measured_any_longer_or_never_kept_fails() -> None:
    bad = guard.beyond(KEPT, {"gate: check": 2.0, "twin: physics": 1.0})
    assert bad["commands: stop"] == "10 kept; no longer measured"
    assert "not kept" in bad["twin: physics"]


def test_what_is_beyond_once_is_measured_again_and_only_that() -> None:
    asked = []

    def measure(names: Sequence[str]) -> dict[str, float]:
        asked.extend(names)
        first = asked.count(names[0]) == 1
        return (
            {"gate: check": 5.0 if first else 2.1}
            if names == ["gate"]
            else {"commands: stop": 10.0}
        )

    assert guard.worse_than(KEPT, ["gate", "commands"], measure) == {}
    assert asked == ["gate", "commands", "gate"]


def test_a_probe_that_does_not_run_fails_by_the_names_of_its_ratios() -> None:
    bad = guard.worse_than(KEPT, ["gate", "commands"], lambda names: {})
    assert set(bad) == set(KEPT)


def test_a_state_is_read_as_it_was_kept(tmp_path: Path) -> None:
    path = tmp_path / "last_good.toml"
    state = guard.State(
        "2026-11-23", "abc1234", guard.machine(), 5000.0, KEPT, {'stop: "all", p99, ms': 9.5}
    )
    guard.write(state, path)
    assert guard.read(path) == state
    assert guard.read(tmp_path / "none.toml") is None


def test_only_tails_are_compared_in_the_full_form() -> None:
    figures = [
        Figure("stop", "11 channels, p99", 9.0, "ms"),
        Figure("stop", "11 channels, p50", 2.0, "ms"),
        Figure("skew", "native calls, p99", 0.2, "ms"),
        Figure("load", "idle", 2.0, "% of a core"),
    ]
    assert guard.tails(figures) == {
        "stop: 11 channels, p99, ms": 9.0,
        "skew: native calls, p99, ms": 1.0,  # less is the machine's
    }


def test_every_ratio_is_kept_with_its_date_commit_and_machine() -> None:
    state = guard.read()
    assert state is not None
    assert state.date
    assert state.commit
    assert {name.split(": ")[0] for name in state.ratios} == set(guarded.PROBES)
    assert {name.split(": ")[0] for name in state.full} <= set(guard.FULL)
    assert all(value > 0.0 for value in (*state.ratios.values(), *state.full.values()))


def test_a_gate_that_becomes_slow_fails_by_its_name(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The real probe and comparison, with a busy loop in the gate's check."""
    check = Sweep.check

    def slow(self: Sweep, *args: Any, **options: Any) -> object:
        before_s = time.thread_time()
        answer = check(self, *args, **options)
        until_s = time.thread_time() + (time.thread_time() - before_s)
        while time.thread_time() < until_s:
            pass
        return answer

    def here(names: Sequence[str]) -> dict[str, float]:
        return {f"{name}: {key}": each for name in names for key, each in guarded.gate().items()}

    state = guard.State("today", "this", guard.machine(), 1.0, here(["gate"]), {})
    monkeypatch.setattr(guard, "read", lambda: state)
    monkeypatch.setattr(guard, "probed", here)
    assert guard.main(["--only", "gate"]) == 0
    monkeypatch.setattr(Sweep, "check", slow)
    assert guard.main(["--only", "gate"]) == 1
    output = capsys.readouterr().out
    assert "guard: gate: check of the gate: " in output
    assert "1 worse" in output
