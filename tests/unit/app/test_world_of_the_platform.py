"""Which world the simulated platform lives in, and who says so."""

from pathlib import Path

import pytest

import cosmic
from cosmic.twin.truth import read_truth


def world_of(tmp_path: Path, **options: str) -> str:
    truth = tmp_path / "truth.jsonl"
    with cosmic.connect(applications=("mico",), truth=truth, sample="empty", **options):
        pass
    return read_truth(truth).world


def test_the_realistic_world_is_the_default(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("COSMIC_WORLD")
    assert world_of(tmp_path) == "realistic"


def test_the_variable_goes_before_the_file_and_the_argument_before_both(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COSMIC_WORLD", "harsh")
    assert world_of(tmp_path) == "harsh"
    assert world_of(tmp_path, world="friendly") == "friendly"


def test_a_world_that_is_not_there_is_named() -> None:
    with pytest.raises(cosmic.ConfigError, match="no world 'kind'; known: plain, friendly"):
        cosmic.connect(applications=("mico",), world="kind")


def test_a_plate_is_changed_on_the_platform(tmp_path: Path) -> None:
    truth = tmp_path / "truth.jsonl"
    with cosmic.connect(
        applications=("mico",), rate=500.0, sample="three-dry", world="friendly", truth=truth
    ) as rig:
        assert [rig.change_plate(), rig.change_plate()] == [1, 2]
    told = read_truth(truth)
    assert len(told.of("plate")) == 2
    assert sum(each.role == "standard" for each in told.fibres) == 3
