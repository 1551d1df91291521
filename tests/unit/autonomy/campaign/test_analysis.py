"""Final values come from the raw files alone: the same again, or it is said what changed."""

import dataclasses
import json
import math
import random
import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path

import h5py
import pytest

from cosmic.app.cli import main
from cosmic.autonomy.campaign.analysis import (
    altered_files,
    analyse,
    compare,
    finish,
    scale_in,
    settings_in,
)
from cosmic.autonomy.campaign.provenance import Provenance, sha256_of, write_provenance
from cosmic.autonomy.campaign.records import STANDARD, CampaignError, Outcome, Shape
from cosmic.autonomy.campaign.report import write_report
from cosmic.autonomy.campaign.stop_rule import StandardSchedule
from cosmic.autonomy.campaign.storage_format import FINAL, read_raw
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.frame.errors import CosmicError
from unit.autonomy.campaign.sample_records import INFO, good

STANDARD_EI = 1.8e-10
RECIPE = f"""
procedure = "bend test"
[stop]
count = 2
[parameters.standard]
ei_n_m2 = {STANDARD_EI}
[output]
html = false
pdf = false
"""


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign of two fibres between two measurements of the standard."""
    folder = tmp_path_factory.mktemp("analysed") / "campaign"
    info = dataclasses.replace(INFO, recipe_text=RECIPE)
    with CampaignStore.create(folder, info) as store:
        order = (
            (STANDARD, STANDARD_EI),
            ("fibre", 5e-11),
            ("fibre", 3e-11),
            (STANDARD, STANDARD_EI),
        )
        for n, (role, ei) in enumerate(order):
            number = store.begin_fibre(time_s=100.0 * n, role=role)
            record = good(number, ei_n_m2=ei, seed=n)
            store.finish_fibre(
                dataclasses.replace(
                    record, role=role, elapsed_s=100.0 * n, images=record.images if n == 1 else ()
                )
            )
        finish(store)
    return folder


def copied(campaign: Path, folder: Path) -> Path:
    folder.mkdir()
    for each in campaign.rglob("*"):
        if each.is_file() and each.name != "campaign.lock":
            target = folder / each.relative_to(campaign)
            target.parent.mkdir(exist_ok=True)
            target.write_bytes(each.read_bytes())
    return folder


def test_a_standard_is_no_fibre_of_the_sample(campaign: Path) -> None:
    reader = CampaignReader(campaign)
    assert [each.number for each in reader.fibres()] == [2, 3]
    assert [each.number for each in reader.fibres(STANDARD)] == [1, 4]
    assert [each.number for each in reader.finished()] == [2, 3]


def test_the_scale_of_the_record_comes_from_the_standard(campaign: Path, tmp_path: Path) -> None:
    reader = CampaignReader(campaign)
    scale = scale_in(reader.analysis())
    assert scale is not None
    assert scale.verified
    assert abs(scale.off_part) < 2.5 * scale.off_std_part < 0.06
    assert all(each.bending.scale_verified for each in reader.finished() if each.bending)
    write_report(reader, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text("utf-8")
    assert "verified by a standard, measured 2 times: the sensor reads" in page
    assert "<h2>Standard</h2>" in page


def test_the_raw_files_alone_give_the_same_numbers_again(campaign: Path) -> None:
    reader = CampaignReader(campaign)
    found = compare(reader, analyse(reader))
    assert found.compared == 4
    assert not found.changed
    assert not found.versions


def test_the_command_ends_with_0_for_the_same_and_with_3_for_other_numbers(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["recompute", str(campaign)]) == 0
    assert "4 values computed from raw files: 0 changed" in capsys.readouterr().out
    other = tmp_path / "other.toml"
    other.write_text(RECIPE.replace("e-10", "e-10\nexpanded_percent = 8.0"), "utf-8")
    assert main(["recompute", str(campaign), "--recipe", str(other)]) == 3
    assert "fibre 2: 4." in capsys.readouterr().out


@pytest.mark.usefixtures("qapp")
def test_new_values_are_put_into_the_record_when_wanted(campaign: Path, tmp_path: Path) -> None:
    folder, other = copied(campaign, tmp_path / "copy"), tmp_path / "other.toml"
    other.write_text(f"{RECIPE}\n[parameters.push.fit]\nfriction_std = 0.4\n", "utf-8")
    before = [each.bending for each in CampaignReader(folder).finished()]
    assert main(["recompute", str(folder), "--recipe", str(other), "--apply"]) == 3
    after = [each.bending for each in CampaignReader(folder).finished()]
    assert all(
        one is not None and other is not None and one.ei_high_n_m2 != other.ei_high_n_m2
        for one, other in zip(before, after, strict=True)
    )
    assert main(["recompute", str(folder)]) == 0
    assert not CampaignReader(folder).cut_off()


def test_a_raw_file_that_was_changed_is_refused(campaign: Path, tmp_path: Path) -> None:
    folder = copied(campaign, tmp_path / "copy")
    file = folder / "fibres" / "00002.h5"
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(bytes(content))
    with pytest.raises(CampaignError, match=r"00002\.h5 is not as it was written: its SHA-256"):
        analyse(CampaignReader(folder))
    file.unlink()
    with pytest.raises(CampaignError, match=r"00002\.h5 cannot be read"):
        analyse(CampaignReader(folder))


def test_what_beside_the_raw_files_is_not_as_it_was_written_is_named(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(campaign, tmp_path / "copy")
    image = next((folder / "fibres").glob("*.png"))
    image.write_bytes(image.read_bytes() + b"x")
    shutil.copy(folder / "fibres" / "00002.h5", folder / "fibres" / "00077.h5")
    assert main(["recompute", str(folder)]) == 4
    said = capsys.readouterr().out
    assert "0 changed" in said
    assert f"{image.name}: its SHA-256 differs" in said
    assert "fibres/00077.h5 belongs to no fibre of the record" in said
    assert main(["recompute", str(campaign)]) == 0


def test_fitted_curves_that_were_altered_or_lost_are_named_and_written_anew(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(campaign, tmp_path / "copy")
    with h5py.File(folder / FINAL, "r+") as file:
        file["00001/00"][0] += 1.0
    assert main(["recompute", str(folder)]) == 4
    assert "not as it was written: analysis.h5: its SHA-256 differs" in capsys.readouterr().out
    (folder / FINAL).unlink()
    assert main(["recompute", str(folder)]) == 4
    assert "not as it was written: analysis.h5: is missing" in capsys.readouterr().out
    with CampaignStore.open(folder, run=False) as store:
        finish(store)
    assert main(["recompute", str(folder)]) == 0


def test_a_campaign_that_kept_no_sum_of_its_fitted_curves_is_read_as_before(
    campaign: Path, tmp_path: Path
) -> None:
    folder = copied(campaign, tmp_path / "copy")
    with sqlite3.connect(folder / "campaign.sqlite") as base:
        (text,) = base.execute("SELECT analysis_json FROM campaign").fetchone()
        kept = json.loads(text)
        assert kept.pop("fitted_sha256") == sha256_of(folder / FINAL)
        base.execute("UPDATE campaign SET analysis_json = ?", (json.dumps(kept),))
    base.close()
    (folder / FINAL).unlink()
    assert main(["recompute", str(folder)]) == 0


def recorded(campaign: Path, folder: Path, *, hashed: bool) -> Path:
    """A copy whose run kept what it was made with; not `hashed`: by a program of before."""
    copied(campaign, folder)
    file = write_provenance(folder, 1, Provenance(facts={"seed": 7}), RECIPE)
    with sqlite3.connect(folder / "campaign.sqlite") as base:
        if hashed:
            base.execute("UPDATE run SET record_sha256 = ?", (sha256_of(file),))
        else:
            base.execute("ALTER TABLE run DROP COLUMN record_sha256")
            base.execute("UPDATE run SET versions_json = ?", ('{"commit": "abc"}',))
    base.close()
    return folder


@pytest.mark.parametrize("hashed", [True, False])
@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        (None, "is missing"),
        ("", "does not list what the run was made with"),
        ("{}", "does not list what the run was made with"),
        ("[1]", "does not list what the run was made with"),
        ('{"files": {"recipe.toml": 7}}', "does not list what the run was made with"),
    ],
)
def test_a_run_file_that_was_removed_or_emptied_is_named(
    campaign: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    *,
    hashed: bool,
    text: str | None,
    wanted: str,
) -> None:
    folder = recorded(campaign, tmp_path / "copy", hashed=hashed)
    assert main(["recompute", str(folder)]) == 0
    file = folder / "record" / "run-0001.json"
    if text is None:
        shutil.rmtree(folder / "record")
    else:
        file.write_text(text, "utf-8")
    assert main(["recompute", str(folder)]) == 4
    assert f"not as it was written: record/run-0001.json: {wanted}" in capsys.readouterr().out


def test_a_run_file_that_says_something_else_now_is_named(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = recorded(campaign, tmp_path / "copy", hashed=True)
    file = folder / "record" / "run-0001.json"
    file.write_text(file.read_text("utf-8").replace('"seed": 7', '"seed": 8'), "utf-8")
    assert main(["recompute", str(folder)]) == 4
    assert "record/run-0001.json: its SHA-256 differs" in capsys.readouterr().out


def test_a_campaign_of_before_records_were_kept_is_recomputed_and_says_so(
    campaign: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["recompute", str(campaign)]) == 0
    assert "record/run-0001.json: is not there, as of campaigns by" in capsys.readouterr().out


def test_of_a_running_campaign_it_says_that_it_is_running(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(campaign, tmp_path / "copy")
    with CampaignStore.open(folder, run=False):
        assert main(["recompute", str(folder)]) == 0
        assert "the campaign is running: these are its values of now" in capsys.readouterr().out
    assert main(["recompute", str(folder)]) == 0
    assert "is running" not in capsys.readouterr().out


def test_a_fibre_that_is_finished_meanwhile_is_not_said_to_be_lost(
    campaign: Path, tmp_path: Path
) -> None:
    folder = copied(campaign, tmp_path / "copy")
    with CampaignStore.open(folder) as store:
        analysis = analyse(store.reader)
        store.finish_fibre(good(store.begin_fibre(time_s=500.0)))
        assert compare(store.reader, analysis).missing == ()


def test_of_a_campaign_that_did_not_come_to_its_end_it_says_so(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(campaign, tmp_path / "copy")
    with sqlite3.connect(folder / "campaign.sqlite") as base:
        base.execute("UPDATE campaign SET analysis_json = '{}'")
    base.close()
    main(["recompute", str(folder)])
    said = capsys.readouterr().out
    assert "the campaign did not come to its end" in said
    assert "another version" not in said
    assert "otherwise in the record" not in said
    main(["recompute", "--apply", str(folder)])
    capsys.readouterr()
    assert main(["recompute", str(folder)]) == 0
    assert "did not come to its end" not in capsys.readouterr().out


def test_a_value_that_no_raw_file_stands_for_is_named(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = copied(campaign, tmp_path / "copy")
    with sqlite3.connect(folder / "campaign.sqlite") as base:
        base.execute("UPDATE fibre SET file = '' WHERE number = 2")
    base.close()
    assert main(["recompute", str(folder)]) == 3
    assert "not in the raw files: fibre 2" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("change", "wanted"),
    [
        (
            "campaign SET analysis_json = json_set(analysis_json, '$.scale.off_part', 0.04)",
            "the scale of the force",
        ),
        (
            "campaign SET analysis_json = json_set(analysis_json, '$.scale.standards[0].refused',"
            " 'a beam that slipped')",
            "the scale of the force",
        ),
        ("fibre SET scale_verified = 0 WHERE number = 3", "fibre 3: scale verified"),
        ("fibre SET notes = 'friction' WHERE number = 2", "fibre 2: notes"),
        (
            "fibre SET budget_json = json_set(budget_json, '$[0].share', 0.01) WHERE number = 2",
            "fibre 2: budget",
        ),
        ("span SET k_un_um = 2.0 * k_un_um WHERE fibre = 2 AND number = 1", "fibre 2: spans"),
        ("fibre SET clamp_offset_um = 3.0 WHERE number = 2", "fibre 2: clamp offset"),
    ],
)
def test_what_else_the_record_has_otherwise_is_named(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], change: str, wanted: str
) -> None:
    folder = copied(campaign, tmp_path / "copy")
    with sqlite3.connect(folder / "campaign.sqlite") as base:
        base.execute(f"UPDATE {change}")
    base.close()
    assert main(["recompute", str(folder)]) == 3
    assert f"otherwise in the record: {wanted}\n" in capsys.readouterr().out


@pytest.mark.parametrize(
    "change",
    [
        "campaign SET analysis_json = '{\"fit\": '",
        "campaign SET analysis_json = '[1]'",
        "campaign SET analysis_json = '{\"fit\": {}}'",
        "campaign SET analysis_json = json_set(analysis_json, '$.scale.new', 1)",
        "fibre SET flags = 'of a later program' WHERE number = 2",
        "fibre SET outcome = 'of a later program' WHERE number = 2",
        "fibre SET budget_json = '[{}]' WHERE number = 2",
        "span SET flags = 'of a later program' WHERE fibre = 3",
        "run SET versions_json = 'x'",
    ],
)
def test_what_a_record_holds_that_is_not_understood_is_said_in_words(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], change: str
) -> None:
    folder = copied(campaign, tmp_path / "copy")
    with sqlite3.connect(folder / "campaign.sqlite") as base:
        base.execute(f"UPDATE {change}")
    base.close()
    assert main(["recompute", str(folder)]) == 1
    said = capsys.readouterr().err
    assert "does not know" in said or "not understood" in said


def ended(campaign: Path, folder: Path) -> Path:
    """A copy that has come to its end."""
    copied(campaign, folder)
    with CampaignStore.open(folder) as store:
        store.end("2 fibres done", time_s=900.0)
    return folder


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ("UPDATE fibre SET outcome = 'failed', cause = 'dropped' WHERE number = 2", "table fibre"),
        ("UPDATE fibre SET length_um = 1.5 * length_um WHERE number = 2", "table fibre"),
        ("UPDATE fibre SET role = 'fibre' WHERE number = 4", "table fibre"),
        ("UPDATE fibre SET file_sha256 = '' WHERE number = 2", "table fibre"),
        ("UPDATE fibre SET began_s = began_s + 10 WHERE number = 2", "table fibre"),
        ("UPDATE run SET end_s = 100", "table run"),
        ("UPDATE campaign SET seed = 8", "table campaign"),
        ("UPDATE campaign SET operator = 'somebody else'", "table campaign"),
        ("DELETE FROM operation WHERE fibre = 2", "table operation"),
        ("INSERT INTO sighting (plate, number) VALUES (1, 77)", "table sighting"),
        ("INSERT INTO calibration VALUES ('map', 0.1, 'px', 'now', 1, 0.0)", "table calibration"),
        ("UPDATE campaign SET recipe_text = recipe_text || '# x'", "the recipe in it"),
        ("UPDATE campaign SET analysis_json = analysis_json || ' '", "results"),
    ],
)
def test_what_was_changed_in_the_record_by_another_program_is_named(
    campaign: Path, tmp_path: Path, change: str, part: str
) -> None:
    reader = CampaignReader(ended(campaign, tmp_path / "copy"))
    assert reader.changed_parts() == ()
    with sqlite3.connect(reader.folder / "campaign.sqlite") as base:
        base.execute(change)
    base.close()
    assert f"campaign.sqlite: {part} was changed since" in altered_files(reader)


def test_the_command_ends_with_4_where_the_record_was_changed_and_no_value(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = ended(campaign, tmp_path / "copy")
    with sqlite3.connect(folder / "campaign.sqlite") as base:
        base.execute("UPDATE fibre SET outcome = 'failed', cause = 'dropped' WHERE number = 2")
    base.close()
    assert main(["recompute", str(folder)]) == 4
    said = "not as it was written: campaign.sqlite: table fibre was changed since\n"
    assert said in capsys.readouterr().out


def test_what_was_changed_in_the_record_stays_known_when_it_is_gone_on_with(
    campaign: Path, tmp_path: Path
) -> None:
    folder = ended(campaign, tmp_path / "copy")
    with sqlite3.connect(folder / "campaign.sqlite") as base:
        base.execute("UPDATE fibre SET outcome = 'failed' WHERE number = 2")
        base.execute("UPDATE fibre SET ei_n_m2 = 1e-10 WHERE number = 3")
    base.close()
    assert CampaignReader(folder).changed_parts() == ("table fibre", "results")
    with CampaignStore.open(folder, run=False) as store:
        finish(store)  # the values are those of the raw files again; who was left out is not known
    assert CampaignReader(folder).changed_parts() == ("table fibre",)
    with CampaignStore.open(folder) as store:
        assert CampaignReader(folder).changed_parts() == ("table fibre",)
        store.end("2 fibres done", time_s=950.0)
    assert CampaignReader(folder).changed_parts() == ("table fibre",)


def test_a_record_of_an_earlier_program_that_kept_no_sums_is_read_as_before(
    campaign: Path, tmp_path: Path
) -> None:
    reader = CampaignReader(ended(campaign, tmp_path / "copy"))
    with sqlite3.connect(reader.folder / "campaign.sqlite") as base:
        base.execute("ALTER TABLE campaign DROP COLUMN sums_json")
    base.close()
    assert altered_files(reader) == ()
    with CampaignStore.open(reader.folder) as store:
        store.end("2 fibres done", time_s=950.0)
    assert altered_files(reader) == ()


def test_a_raw_file_of_an_older_program_that_is_another_fibres_is_refused(
    campaign: Path, tmp_path: Path
) -> None:
    folder = copied(campaign, tmp_path / "copy")
    with sqlite3.connect(folder / "campaign.sqlite") as base:
        base.execute("UPDATE fibre SET file_sha256 = ''")
    base.close()
    shutil.copy(folder / "fibres" / "00003.h5", folder / "fibres" / "00002.h5")
    with pytest.raises(CampaignError, match=r"00002\.h5 is that of fibre 3, and the record"):
        analyse(CampaignReader(folder))


def test_a_raw_file_of_which_a_part_is_spoilt_costs_no_traceback(
    campaign: Path, tmp_path: Path
) -> None:
    file, chance = tmp_path / "spoilt.h5", random.Random(3)
    whole = (campaign / "fibres" / "00002.h5").read_bytes()
    refused = 0
    for _ in range(150):
        content = bytearray(whole)
        for _ in range(12):
            content[chance.randrange(len(content))] = chance.randrange(256)
        file.write_bytes(content)
        try:
            read_raw(file)
        except CosmicError:
            refused += 1
    assert refused


def without(name: str, file: h5py.File) -> None:
    for column in ("way_um", "force_un", "force_std_un", "time_s", "loading"):
        if name in ("", column):
            del file[f"spans/00/{column}"]
            file[f"spans/00/{column}"] = "lost" if name else []


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda file: file.attrs.update(format_version=2), "it is of version 2, and this program"),
        (lambda file: file.attrs.update(format="cosmic recording"), "it is no file of a fibre"),
        (lambda file: without("force_un", file), "force_un of /spans/00 is no row of numbers"),
        (lambda file: without("", file), "cannot be analysed: the span at"),
    ],
)
def test_a_raw_file_that_is_not_understood_is_named_and_why(
    campaign: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    change: Callable[[h5py.File], None],
    words: str,
) -> None:
    folder = copied(campaign, tmp_path / "copy")
    with h5py.File(folder / "fibres" / "00002.h5", "r+") as file:
        change(file)
    with sqlite3.connect(folder / "campaign.sqlite") as base:
        base.execute("UPDATE fibre SET file_sha256 = ''")
    base.close()
    assert main(["recompute", str(folder)]) == 1
    said = capsys.readouterr().err
    assert "00002.h5 cannot be" in said
    assert words in said


def test_by_a_recipe_without_a_standard_its_measurements_are_not_said_to_be_lost(
    campaign: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other.toml"
    other.write_text('procedure = "bend test"\n[stop]\ncount = 2\n', "utf-8")
    assert main(["recompute", str(campaign), "--recipe", str(other)]) == 3
    said = capsys.readouterr().out
    assert "2 measurements of the standard are not used: these settings name none" in said
    assert "not in the raw files" not in said


def test_another_version_of_the_analysis_is_named(campaign: Path, tmp_path: Path) -> None:
    folder = copied(campaign, tmp_path / "copy")
    with sqlite3.connect(folder / "campaign.sqlite") as base:
        base.execute(
            "UPDATE campaign SET analysis_json = "
            "json_set(analysis_json, '$.versions.analysis', 'x')"
        )
    base.close()
    reader = CampaignReader(folder)
    (other,) = compare(reader, analyse(reader)).versions
    assert other.startswith("analysis x then, ")


def test_defaults_of_then_count_and_not_those_of_today(campaign: Path, tmp_path: Path) -> None:
    folder = copied(campaign, tmp_path / "copy")
    with sqlite3.connect(folder / "campaign.sqlite") as base:
        base.execute(
            "UPDATE campaign SET analysis_json = json_set(analysis_json, '$.fit.friction', 0.31)"
        )
    base.close()
    assert analyse(CampaignReader(folder)).settings.fit.friction == 0.31
    assert settings_in(RECIPE).fit.friction != 0.31


def test_what_older_records_say_of_shear_is_taken_over() -> None:
    text = (
        "[parameters.push.fit]\nshear_um2 = 500.0\nshear_std_um2 = 100.0\nfibre_width_um = 20.0\n"
    )
    fit = settings_in(text).fit
    assert (fit.shear_part, fit.shear_std_part) == (1.25, 0.25)


def test_a_fibre_that_is_not_trusted_in_the_end_is_no_good_one(tmp_path: Path) -> None:
    with CampaignStore.create(tmp_path, INFO) as store:
        number = store.begin_fibre(time_s=0.0)
        record = good(number)
        soft = settings_in("[parameters.push.fit]\nsoft_percent = 0.1")
        store.finish_fibre(dataclasses.replace(record, elapsed_s=0.0, shape=Shape(width_um=30.0)))
        assert store.reader.fibre(number).outcome is Outcome.GOOD
        finish(store, soft)
    (after,) = CampaignReader(tmp_path).finished()
    assert after.outcome is Outcome.DOUBTFUL
    assert after.cause == "not trusted"
    assert "the interval is" in after.text


def test_the_standard_is_due_at_begin_middle_and_end() -> None:
    due = StandardSchedule(("begin", "middle", "end"))
    assert due.due(0.9, ending=True) == "begin"
    due.done("begin")
    assert not due.due(0.4, ending=False)
    assert not due.due(math.nan, ending=False)
    assert due.due(0.5, ending=False) == "middle"
    due.done("middle")
    assert not due.due(0.9, ending=False)
    assert due.due(0.9, ending=True) == "end"
    due.done("end")
    assert not due.due(1.0, ending=True)
    assert not StandardSchedule(()).due(0.0, ending=True)
