"""What truly happened, on file, and bodies that run into each other."""

from pathlib import Path

import pytest

from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import ConfigError
from cosmic.twin.sample_layout import put_on
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings
from cosmic.twin.truth import TruthFile, read_truth
from unit.twin.force_bench import FIBRE, Bench, Heard, before_the_fibre, settings

LYING = FIBRE.model_copy(update={"held_by": "", "free_um": 0.0, "x_um": 400.0})


def written(path: Path, seed: int = 3) -> Scene:
    twin = put_on(shipped_settings(), "three-dry", seed)
    return Scene.from_settings(twin, ManualClock(), seed, sample="three-dry", truth=TruthFile(path))


def test_a_file_of_truth_begins_with_the_sample_and_ends_in_order(tmp_path: Path) -> None:
    file = tmp_path / "truth.jsonl"
    scene = written(file)
    before = read_truth(file)
    assert (before.sample, before.seed, before.complete) == ("three-dry", 3, False)
    put = put_on(shipped_settings(), "three-dry", 3).fibres
    assert len(before.fibres) == 7
    for number, (record, fibre) in enumerate(zip(before.fibres, put, strict=True)):
        assert (record.number, record.ei_n_m2, record.role) == (number, fibre.ei_n_m2, fibre.role)
        assert (record.length_um, record.curl_deg) == (fibre.length_um, fibre.curl_deg)
    scene.close()
    scene.close()
    assert read_truth(file).complete


def test_what_was_cut_off_is_left_out(tmp_path: Path) -> None:
    file = tmp_path / "truth.jsonl"
    written(file).close()
    file.write_text(file.read_text(encoding="utf-8")[:-9], encoding="utf-8")
    found = read_truth(file)
    assert len(found.fibres) == 7 and not found.complete


def test_what_is_no_truth_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "other.jsonl"
    with pytest.raises(ConfigError, match="cannot be read"):
        read_truth(file)
    file.write_text('{"time_s": 0, "event": "end"}\n', encoding="utf-8")
    with pytest.raises(ConfigError, match="not a file of the twin's truth"):
        read_truth(file)
    with pytest.raises(ConfigError, match="cannot be written"):
        TruthFile(tmp_path / "nowhere" / "truth.jsonl")


def test_the_highest_force_is_reported_when_the_probe_has_left() -> None:
    heard = Heard()
    bench = before_the_fibre(Bench(truth=heard)).go(20.0, probe_y=-5005.0)
    highest = bench.force_un
    bench.go(20.0, probe_y=-4960.0)
    assert bench.force_un == 0.0
    assert heard.facts("touched")["abscissa_um"] == pytest.approx(400.0, abs=0.5)
    assert heard.facts("left")["peak_un"] == pytest.approx(highest, rel=1e-3)


def landed(um: float) -> Heard:
    heard = Heard()
    bench = Bench(settings(LYING, start={"left.gripper": 600.0}), truth=heard)
    bench.go(left_x=3600.0).go(left_z=-1500.0 - um).go(left_z=-1000.0)
    assert bench.moment
    return heard


def test_jaws_may_land_on_the_plate_softly() -> None:
    assert landed(3.0).facts("contact over")["meant"]
    over = landed(20.0).facts("contact over")
    assert not over["meant"] and over["depth_um"] == pytest.approx(20.0, abs=0.5)
    assert {"plate", "left_jaw_a"} == set(over["bodies"]) or "left_jaw_b" in over["bodies"]
    assert "contact" not in landed(-5.0).names


def test_jaws_in_the_clip_of_the_plate_are_never_meant() -> None:
    heard = Heard()
    bench = Bench(
        settings(LYING, start={"left.gripper": 600.0, "table.rotation": 154.8}), truth=heard
    )
    bench.go(left_x=-1156.0, left_y=2320.0).go(left_z=-1250.0)
    assert bench.moment and "contact" not in heard.names, "it is 200 um high"

    bench.go(left_z=-1490.0).go(left_z=-1000.0)

    assert bench.moment
    over = heard.facts("contact over")
    assert "plate_clip" in over["bodies"] and not over["meant"]
    assert over["depth_um"] == pytest.approx(190.0, abs=5.0)


def test_jaws_that_run_into_each_other_are_reported_with_their_depth() -> None:
    heard = Heard()
    bench = Bench(settings(LYING, start={"left.gripper": 100.0}), truth=heard)
    bench.go(left_x=3600.0).go(right_gripper=100.0)
    assert bench.moment and "contact" not in heard.names
    bench.go(right_x=-4600.0)
    assert bench.moment
    bodies = {body for name, facts in heard.events if name == "contact" for body in facts["bodies"]}
    assert {"left_jaw_a", "right_jaw_b"} <= bodies or {"left_jaw_a", "right_jaw_a"} <= bodies
    bench.scene.close()
    over = [facts for name, facts in heard.events if name == "contact over"]
    assert over and not any(each["meant"] for each in over)


def test_the_probe_in_a_jaw_is_a_contact_and_beside_it_is_none() -> None:
    heard = Heard()
    bench = before_the_fibre(Bench(truth=heard), 400.0)
    assert bench.moment and "contact" not in heard.names
    bench.go(probe_y=-4700.0).go(probe_x=-1000.0).go(probe_y=-4890.0)
    highest = bench.force_un
    assert "probe_tip" in heard.facts("contact")["bodies"]
    assert heard.facts("touched") == {"tool": "left"}
    bench.go(probe_y=-4700.0)
    assert bench.force_un == 0.0
    assert heard.facts("left") == {"tool": "left", "peak_un": pytest.approx(highest)}


def test_the_truth_of_an_earlier_run_is_kept_beside_the_new_one(tmp_path: Path) -> None:
    file = tmp_path / "truth.jsonl"
    for seed in (3, 4, 5):
        written(file, seed).close()
    found = [read_truth(tmp_path / name).seed for name in ("truth-1.jsonl", "truth-2.jsonl")]
    assert [*found, read_truth(file).seed] == [3, 4, 5]


def test_what_is_no_truth_is_not_written_over(tmp_path: Path) -> None:
    notes = tmp_path / "notes.txt"
    notes.write_text("my notes\n", encoding="utf-8")
    with pytest.raises(ConfigError, match="give another name"):
        written(notes)
    assert notes.read_text(encoding="utf-8") == "my notes\n"
    with pytest.raises(ConfigError, match="is not a file"):
        written(tmp_path)
