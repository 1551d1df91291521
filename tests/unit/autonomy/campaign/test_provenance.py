"""What a campaign was made with can be read, and compared, years later."""

import dataclasses
import hashlib
from pathlib import Path

import pytest

from cosmic.app.provenance import software
from cosmic.autonomy.campaign.provenance import (
    Provenance,
    changed_files,
    read_provenance,
    write_provenance,
)
from cosmic.autonomy.campaign.records import CampaignError
from cosmic.autonomy.campaign.report import write_report
from cosmic.autonomy.campaign.store import CampaignStore
from unit.autonomy.campaign.sample_records import INFO, good

FACTS = {
    "seed": 77,
    "sample": "forty-dry",
    "world": "harsh",
    "operator": "M. M.",
    "climate": {"temperature_c": 23.1, "rh_percent": 48.0},
    "sensor": {"serial": "S-12", "certificate": "", "calibrated": ""},
    "software": {"commit": "abc123", "system": "Linux", "packages": {"numpy": "2.0"}},
}


def made(tmp_path: Path, text: str = "name = 1\n") -> Provenance:
    file = tmp_path / "platform.toml"
    file.write_text(text, encoding="utf-8")
    return Provenance({"platform/platform.toml": file}, {"parameters": {"zoom": 0.58}}, FACTS)


def test_a_record_has_no_token_of_a_client(tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    text = '[[network.http.client]]\nname = "desk"\ntoken = "correct horse battery"\n'
    write_provenance(folder, 1, made(tmp_path, text), "procedure = 1\n")
    assert not [
        each for each in folder.rglob("*") if each.is_file() and b"horse" in each.read_bytes()
    ]
    (page,) = read_provenance(folder)
    copy = folder / page["files"]["platform/platform.toml"]["copy"]
    assert copy.read_text("utf-8") == text.replace("correct horse battery", "")
    assert changed_files(folder) == ()


def test_each_run_keeps_copies_and_hashes_of_its_files(tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    write_provenance(folder, 1, made(tmp_path), "procedure = 1\n")
    write_provenance(folder, 2, made(tmp_path, "name = 2\n"), "procedure = 1\n")
    first, second = read_provenance(folder)
    kept = first["files"]["platform/platform.toml"]
    assert kept["sha256"] == hashlib.sha256(b"name = 1\n").hexdigest()
    assert (folder / kept["copy"]).read_text("utf-8") == "name = 1\n"
    again = second["files"]["platform/platform.toml"]
    assert (folder / again["copy"]).read_text("utf-8") == "name = 2\n"
    assert first["files"]["recipe.toml"] == second["files"]["recipe.toml"]
    assert (first["seed"], first["sample"], first["world"]) == (77, "forty-dry", "harsh")
    assert first["settings"]["parameters"] == {"zoom": 0.58}


def test_a_copy_that_was_changed_is_named(tmp_path: Path) -> None:
    folder = tmp_path / "campaign"
    write_provenance(folder, 1, made(tmp_path), "procedure = 1\n")
    assert changed_files(folder) == ()
    (page,) = read_provenance(folder)
    (folder / page["files"]["platform/platform.toml"]["copy"]).write_text("name = 3\n", "utf-8")
    assert changed_files(folder) == ("platform/platform.toml of run 1",)


def test_of_a_large_file_only_the_hash_is_kept(tmp_path: Path) -> None:
    mesh = tmp_path / "mesh.stl"
    mesh.write_bytes(b"x" * 2_000_001)
    write_provenance(tmp_path / "campaign", 1, Provenance({"scene/mesh.stl": mesh}), "")
    (page,) = read_provenance(tmp_path / "campaign")
    assert set(page["files"]["scene/mesh.stl"]) == {"sha256"}


def test_a_file_that_cannot_be_read_is_no_record(tmp_path: Path) -> None:
    missing = Provenance({"platform/platform.toml": tmp_path / "none.toml"})
    with pytest.raises(CampaignError, match="is not kept"):
        write_provenance(tmp_path / "campaign", 1, missing, "")


def test_the_report_says_what_it_was_made_with_and_leads_to_the_raw_data(tmp_path: Path) -> None:
    with CampaignStore.create(tmp_path / "campaign", INFO) as store:
        write_provenance(store.folder, store.run, made(tmp_path), "")
        number = store.begin_fibre(time_s=0.0)
        store.finish_fibre(dataclasses.replace(good(number), images=()))
        write_report(store, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text("utf-8")
    for words in ("23.1 °C, 48 % relative humidity", "serial S-12", "abc123", "numpy 2.0"):
        assert words in page
    assert 'href="fibres/00001.h5"' in page
    digest = hashlib.sha256((tmp_path / "campaign/fibres/00001.h5").read_bytes()).hexdigest()
    assert digest in page


def test_the_software_is_named_with_the_packages_it_stands_on() -> None:
    found = software()
    assert {"numpy", "scipy", "h5py"} <= found["packages"].keys()
    assert found["CoSMic"]
