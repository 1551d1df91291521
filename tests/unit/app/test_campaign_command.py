"""``cosmic campaign``: its exit code says if it did what was asked, its seed is the one given."""

import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cosmic.app import campaign_command
from cosmic.app.cli import main
from cosmic.autonomy.campaign.records import CampaignInfo
from cosmic.autonomy.campaign.statistics import progress
from cosmic.autonomy.campaign.steering import CampaignPhase
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.campaign.store_read import CampaignReader

RECIPE = """
procedure = "transport"
[twin]
seed = 1
[stop]
time_s = 0.001
[output]
pdf = false
table = false
"""


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    path = tmp_path / "short.toml"
    path.write_text(RECIPE, encoding="utf-8")
    return path


@pytest.fixture
def platforms(monkeypatch: pytest.MonkeyPatch, qapp: object) -> SimpleNamespace:
    """Stands for the platform: what it was begun with, and how the campaign on it ends."""
    made = SimpleNamespace(seeds=[], phase=CampaignPhase.ENDED)

    @contextmanager
    def connect(*_: object, seed: int, **__: object) -> Iterator[Any]:
        made.seeds.append(seed)
        campaign = SimpleNamespace(
            phase=made.phase, over=True, end_reason="so it was", operation="", left_s=math.nan,
            progress=progress((), 3.0), start=lambda: None, join=lambda: None,
        )  # fmt: skip
        yield SimpleNamespace(campaign=lambda *_: campaign, simulated=True)

    monkeypatch.setattr(campaign_command, "connect", connect)
    monkeypatch.setattr(campaign_command, "write_output", lambda *_: [])
    return made


@pytest.mark.parametrize(
    ("phase", "code"),
    [(CampaignPhase.ENDED, 0), (CampaignPhase.FAILED, 1), (CampaignPhase.STOPPED, 3)],
)
def test_the_exit_code_is_0_only_when_it_did_what_was_asked(
    recipe: Path,
    tmp_path: Path,
    platforms: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    phase: CampaignPhase,
    code: int,
) -> None:
    platforms.phase = phase
    assert main(["campaign", str(recipe), "--out", str(tmp_path / "out")]) == code
    told = capsys.readouterr()
    assert "so it was" in (told.err if code else told.out)


def test_the_seed_given_is_the_one_recorded_reported_and_printed(
    recipe: Path, tmp_path: Path, qapp: object, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["campaign", str(recipe), "--out", str(out), "--seed", "7"]) == 0
    assert CampaignReader(out).info().seed == 7
    assert "<td>7; " in (out / "report.html").read_text(encoding="utf-8")
    assert "seed 7" in capsys.readouterr().err


def test_a_campaign_is_gone_on_with_by_its_own_seed(
    recipe: Path, tmp_path: Path, platforms: SimpleNamespace
) -> None:
    out, text = tmp_path / "out", recipe.read_text(encoding="utf-8")
    info = CampaignInfo("short", "transport", "three", text, "2026-11-21T12:00:00+00:00", seed=7)
    CampaignStore.create(out, info).close()
    command = ["campaign", str(recipe), "--out", str(out)]
    main(command)
    main(["campaign", str(recipe), "--out", str(tmp_path / "another")])
    assert platforms.seeds == [7, 1]


def test_another_seed_than_that_of_the_campaign_is_refused(
    recipe: Path, tmp_path: Path, qapp: object, capsys: pytest.CaptureFixture[str]
) -> None:
    out, text = tmp_path / "out", recipe.read_text(encoding="utf-8")
    info = CampaignInfo("short", "transport", "three", text, "2026-11-21T12:00:00+00:00", seed=7)
    CampaignStore.create(out, info).close()
    assert main(["campaign", str(recipe), "--out", str(out), "--seed", "8"]) == 1
    assert re.search("twin with seed 7, and this one has seed 8", capsys.readouterr().err)
