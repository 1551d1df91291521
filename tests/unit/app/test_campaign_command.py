"""``cosmic campaign``: its exit code says if it did what was asked, its seed is the one given."""

import hashlib
import logging
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cosmic.app.cli import main
from cosmic.app.commands import campaign as campaign_command
from cosmic.app.commands import chosen_rig
from cosmic.app.commands import repair as repair_command
from cosmic.autonomy.campaign.campaign import CampaignPhase
from cosmic.autonomy.campaign.provenance import Provenance, write_provenance
from cosmic.autonomy.campaign.records import CampaignInfo
from cosmic.autonomy.campaign.statistics import progress
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.frame.errors import RecordingError
from cosmic.frame.log_folding import FoldingHandler

logger = logging.getLogger("cosmic.test")

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


# A command makes a Qt application where there is none; of the wrong kind for the tests after it.
pytestmark = pytest.mark.usefixtures("qapp")


@pytest.fixture
def recipe(tmp_path: Path) -> Path:
    path = tmp_path / "short.toml"
    path.write_text(RECIPE, encoding="utf-8")
    return path


@pytest.fixture
def platforms(monkeypatch: pytest.MonkeyPatch, qapp: object) -> SimpleNamespace:
    """Stands for the platform: what it was begun with, and how the campaign on it ends."""
    made = SimpleNamespace(
        seeds=[], worlds=[], phase=CampaignPhase.ENDED, start=lambda: None, shortfall=""
    )

    @contextmanager
    def connect(*_: object, seed: int, world: str | None, **__: object) -> Iterator[Any]:
        made.seeds.append(seed)
        made.worlds.append(world)
        campaign = SimpleNamespace(
            phase=made.phase, over=True, end_reason="so it was", operation="", left_s=math.nan,
            plan="", request="",
            shortfall=made.shortfall,
            progress=progress((), 3.0), start=lambda: made.start(), join=lambda: None,
        )  # fmt: skip
        yield SimpleNamespace(campaign=lambda *_: campaign, simulated=True)

    monkeypatch.setattr(chosen_rig, "connect", connect)
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
    printed = capsys.readouterr()
    assert "so it was" in (printed.err if code else printed.out)


@pytest.mark.parametrize("name", ["a file", "a file/inner", "x" * 300])
def test_a_folder_that_cannot_be_is_refused_before_a_platform_is_started(
    recipe: Path,
    tmp_path: Path,
    platforms: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
    name: str,
) -> None:
    (tmp_path / "a file").touch()
    assert main(["campaign", str(recipe), "--out", str(tmp_path / name)]) == 1
    assert "name another folder" in capsys.readouterr().err
    assert not platforms.seeds


def test_a_campaign_that_ended_without_its_standard_did_not_do_what_was_asked(
    recipe: Path,
    tmp_path: Path,
    platforms: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
) -> None:
    platforms.shortfall = "the standard did not verify the scale of the force"
    assert main(["campaign", str(recipe), "--out", str(tmp_path / "out")]) == 4
    assert "so it was; the standard did not verify" in capsys.readouterr().err
    platforms.phase = CampaignPhase.STOPPED
    assert main(["campaign", str(recipe), "--out", str(tmp_path / "out")]) == 3


def test_the_seed_given_is_the_one_recorded_reported_and_printed(
    recipe: Path, tmp_path: Path, qapp: object, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["campaign", str(recipe), "--out", str(out), "--seed", "7"]) == 0
    assert CampaignReader(out).info().seed == 7
    assert "<td>7; " in (out / "report.html").read_text(encoding="utf-8")
    assert "seed 7" in capsys.readouterr().err


def test_what_a_run_is_made_with_is_kept_with_its_hash(
    recipe: Path, tmp_path: Path, qapp: object
) -> None:
    out = tmp_path / "out"
    assert main(["campaign", str(recipe), "--out", str(out)]) == 0
    kept = (out / "record" / "run-0001.json").read_bytes()
    assert CampaignReader(out).run_records() == {1: hashlib.sha256(kept).hexdigest()}


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


def test_a_campaign_is_resumed_in_its_own_world_unless_another_is_named(
    recipe: Path, tmp_path: Path, platforms: SimpleNamespace
) -> None:
    out, text = tmp_path / "out", recipe.read_text(encoding="utf-8")
    info = CampaignInfo(
        "short", "transport", "three", text, "2026-11-21T12:00:00+00:00", seed=7, world="harsh"
    )
    CampaignStore.create(out, info).close()
    main(["campaign", str(recipe), "--out", str(out)])
    main(["campaign", str(recipe), "--out", str(out), "--world", "plain"])
    main(["campaign", str(recipe), "--out", str(tmp_path / "another")])
    assert platforms.worlds == ["harsh", "plain", None]


def test_another_world_than_that_of_the_campaign_is_refused(
    recipe: Path, tmp_path: Path, qapp: object, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["campaign", str(recipe), "--out", str(out), "--world", "friendly"]) == 0
    assert CampaignReader(out).info().world == "friendly"
    assert main(["campaign", str(recipe), "--out", str(out), "--world", "harsh"]) == 1
    assert "Resume with --world friendly" in capsys.readouterr().err


def test_forces_by_another_scale_do_not_go_into_one_campaign(
    tmp_path: Path, qapp: object, capsys: pytest.CaptureFixture[str]
) -> None:
    recipe, out = tmp_path / "bend.toml", tmp_path / "out"
    recipe.write_text('procedure = "bend test"\n[stop]\ncount = 1\n', encoding="utf-8")
    text = recipe.read_text(encoding="utf-8")
    info = CampaignInfo("bend", "bend test", "three", text, "2026-11-21T12:00:00+00:00", seed=7)
    CampaignStore.create(out, info).close()
    scale = {"name": "FT-S540", "unit": "uN", "coefficients": [-250.0, 107.0]}
    daqco = {"scale": [scale], "channel": [{"name": "force", "scale": "FT-S540"}]}
    write_provenance(out, 1, Provenance(settings={"platform": {"daqco": daqco}}), text)
    assert main(["campaign", str(recipe), "--out", str(out)]) == 1
    said = capsys.readouterr().err
    assert "has the scale uN [-250.0, 100.0] now, and had uN [-250.0, 107.0] in run 1" in said


def test_the_log_of_a_campaign_is_kept_in_its_folder_and_warnings_are_reported_at_once(
    recipe: Path,
    tmp_path: Path,
    platforms: SimpleNamespace,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def start() -> None:
        logger.info("the plate is looked at")
        for number in range(1000):
            logger.warning("sample %d is late", number)

    platforms.start = start
    out = tmp_path / "out"
    assert main(["campaign", str(recipe), "--out", str(out)]) == 0
    for text in ((out / "cosmic.log").read_text(encoding="utf-8"), capsys.readouterr().err):
        assert 1 <= text.count("is late") < 100
        assert "repeated 950 times" in text
    assert "the plate is looked at" in (out / "cosmic.log").read_text(encoding="utf-8")
    assert "the plate is looked at" not in text, "the terminal is for the bar"
    handlers = logging.getLogger("cosmic").handlers
    assert not [each for each in handlers if isinstance(each, FoldingHandler)]


def test_a_campaign_that_is_refused_writes_no_log_into_the_folder_of_another(
    recipe: Path, tmp_path: Path, qapp: object, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    CampaignStore.create(
        out, CampaignInfo(name="short", procedure="transport", recipe_text="another", seed=1,
                          hardware="digital twin", sample="", started="2026-01-01T00:00:00+00:00"),
    ).close()  # fmt: skip
    assert main(["campaign", str(recipe), "--out", str(out)]) == 1
    assert "another recipe" in capsys.readouterr().err
    assert not (out / "cosmic.log").exists()


def test_a_folder_without_a_name_is_refused_before_anything_begins(
    recipe: Path,
    tmp_path: Path,
    platforms: SimpleNamespace,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    with pytest.raises(SystemExit) as ended:
        main(["campaign", str(recipe), "--out", ""])
    assert ended.value.code == 2
    assert "--out: is empty; name a file or a folder" in capsys.readouterr().err
    assert platforms.seeds == []
    assert not list(here.iterdir())


@pytest.mark.parametrize("command", ["calibrate", "repair"])
def test_a_flood_of_warnings_is_folded_by_every_command_without_a_window(
    command: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def flood(*_: object, **__: object) -> None:
        for number in range(1000):
            logger.warning("sample %d is late", number)
        raise RecordingError("and that was all")

    monkeypatch.setattr(chosen_rig, "connect", flood)
    monkeypatch.setattr(repair_command, "close_left_open", flood)
    assert main([command, *([str(tmp_path / "push.h5")] if command == "repair" else [])]) == 1
    printed = capsys.readouterr().err
    assert 1 <= printed.count("is late") < 100
    assert "repeated 950 times" in printed
    assert "and that was all" in printed
