"""An operator corrects the fibres on an image: undoable, kept with the image, exported."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt
import pytest

from cosmic.app.cli import main
from cosmic.frame.errors import ConfigError, RecordingError, RecordingExistsError
from cosmic.vico.api import find_fibres
from cosmic.vico.core.measuring.corrections import Corrections
from unit.vico.vision.drawn_fibres import arc, drawn_image

IMAGE = drawn_image([arc((60.0, 100.0), 0.0, 300.0, 0.0)], [9.0], shape=(300, 400))


def corrected() -> Corrections:
    return Corrections(IMAGE, find_fibres(IMAGE), "a.png")


def lengths(corrections: Corrections) -> list[float]:
    return sorted(round(each.length_px) for each in corrections.lines)


def numbers(corrections: Corrections) -> list[int]:
    return [each.number for each in corrections.lines]


def test_each_edit_does_what_it_says_and_can_be_undone() -> None:
    edits = corrected()
    assert lengths(edits) == [300]
    edits.cut(1, (160.0, 104.0))
    assert lengths(edits) == pytest.approx([100, 200], abs=2)
    edits.add([(50.0, 200.0), (150.0, 200.0)])
    assert edits.lines[2].width_px == pytest.approx(9.0, abs=0.5)
    edits.move_end(3, (148.0, 201.0), (250.0, 200.0))
    assert round(edits.lines[2].length_px) == 200
    edits.move_end(3, (250.0, 200.0), (170.0, 200.0))
    assert edits.lines[2].length_px == pytest.approx(120, abs=2)
    edits.join(1, 2)
    assert lengths(edits) == pytest.approx([120, 300], abs=2)
    edits.delete(3)
    assert lengths(edits) == [300]
    for _ in range(6):
        edits.undo()
    assert lengths(edits) == [300]
    assert not edits.can_undo
    assert not edits.lines[0].by_operator
    edits.redo()
    assert lengths(edits) == pytest.approx([100, 200], abs=2)
    edits.delete(1)
    assert not edits.can_redo


def test_what_cannot_be_is_refused_and_changes_nothing() -> None:
    edits = corrected()
    for refused in (
        lambda: edits.delete(7),
        lambda: edits.add([(1.0, 2.0)]),
        lambda: edits.add([(1.0, 2.0), (float("nan"), 2.0)]),
        lambda: edits.join(1, 1),
        lambda: edits.cut(1, (60.0, 100.0)),
    ):
        with pytest.raises(ConfigError, match="corrections"):
            refused()
    assert not edits.can_undo


def test_a_click_finds_the_fibre_under_it() -> None:
    edits = corrected()
    near = edits.nearest((200.0, 110.0))
    assert near is not None
    assert near.number == 1
    assert edits.nearest((200.0, 250.0)) is None


def test_corrections_are_kept_with_their_image_and_no_other(tmp_path: Path) -> None:
    edits = corrected()
    edits.cut(1, (160.0, 100.0))
    edits.delete(1)
    edits.undo()
    edits.save(tmp_path / "a.png")
    again = Corrections.open(IMAGE, tmp_path / "a.png")
    assert lengths(again) == lengths(edits)
    assert again.can_redo
    other = IMAGE.copy()
    other[0, 0] += 1
    with pytest.raises(RecordingError, match="another image"):
        Corrections.open(other, tmp_path / "a.png")
    (tmp_path / "a.png.fibres.json").write_text("{}")
    with pytest.raises(RecordingError, match="can be read"):
        Corrections.open(IMAGE, tmp_path / "a.png")


def test_training_data_has_pixels_labels_and_lines(tmp_path: Path) -> None:
    edits = corrected()
    edits.cut(1, (160.0, 100.0))
    edits.export(tmp_path, "one")
    labels = cv2.imread(str(tmp_path / "one-labels.png"), cv2.IMREAD_UNCHANGED)
    assert labels.dtype == np.uint16
    assert set(np.unique(labels)) == {0, 1, 2}
    assert {int(labels[100, 80]), int(labels[100, 300])} == {1, 2}
    assert np.array_equal(cv2.imread(str(tmp_path / "one.png"), cv2.IMREAD_UNCHANGED), IMAGE)
    assert len(json.loads((tmp_path / "one.json").read_text())["fibres"]) == 2


def test_training_data_of_what_was_saved_are_exported_by_a_command(tmp_path: Path) -> None:
    file = tmp_path / "a.png"
    cv2.imwrite(str(file), IMAGE)
    edits = corrected()
    edits.delete(1)
    edits.save(file)
    assert main(["correct", str(file), "--export", str(tmp_path / "out")]) == 0
    assert json.loads((tmp_path / "out" / "a.json").read_text())["fibres"] == []


NAN, INF = float("nan"), float("inf")


def image_file(folder: Path, name: str, pixels: npt.NDArray[np.uint8] = IMAGE) -> Path:
    file = folder / name
    assert cv2.imwrite(str(file), pixels)
    return file


def test_an_export_beside_the_image_leaves_the_image_as_it_was(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = image_file(tmp_path, "a.png", np.dstack([IMAGE] * 3))
    before = file.read_bytes()
    assert main(["correct", str(file), "--export", str(tmp_path)]) == 1
    said = capsys.readouterr().err
    assert f"{file}: there is such a file" in said
    assert "another folder" in said
    assert file.read_bytes() == before
    assert [each.name for each in tmp_path.iterdir()] == ["a.png"]


@pytest.mark.parametrize("there", ["a.png", "a-labels.png", "a.json"])
def test_an_export_replaces_no_file_and_leaves_no_half(tmp_path: Path, there: str) -> None:
    (tmp_path / there).write_text("mine")
    with pytest.raises(RecordingExistsError, match=there):
        corrected().export(tmp_path, "a")
    assert [each.name for each in tmp_path.iterdir()] == [there]
    assert (tmp_path / there).read_text() == "mine"


def test_two_images_of_one_name_are_not_exported_over_each_other(tmp_path: Path) -> None:
    out = tmp_path / "out"
    first, second = image_file(tmp_path, "s.png"), image_file(tmp_path, "s.tif", IMAGE[::-1].copy())
    assert main(["correct", str(first), "--export", str(out)]) == 0
    before = {each: each.read_bytes() for each in out.iterdir()}
    assert main(["correct", str(second), "--export", str(out)]) == 1
    assert {each: each.read_bytes() for each in out.iterdir()} == before


def test_a_screenshot_does_not_replace_the_image(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = image_file(tmp_path, "a.png")
    before = file.read_bytes()
    command = ["correct", str(file), "--offscreen", "0", "--screenshot", str(file)]
    assert main(command) == 1
    assert "another file" in capsys.readouterr().err
    assert file.read_bytes() == before


def test_an_export_into_a_file_says_that_it_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(RecordingError, match="cannot be written"):
        corrected().export(tmp_path / "out", "a")


@pytest.mark.parametrize("width", [-5.0, 0.0, NAN, INF, 300.0, "wide"])
def test_a_width_that_no_fibre_can_have_is_refused(width: float) -> None:
    edits = corrected()
    with pytest.raises(ConfigError, match=r"narrower than the image, 300 px, not .* px$"):
        edits.add([(10.0, 10.0), (60.0, 60.0)], width)
    assert not edits.can_undo


@pytest.mark.parametrize(
    "points",
    [
        [(10.0, 10.0), (100_000.0, 10.0)],
        [(-1000.0, 10.0), (60.0, 60.0)],
        [(10.0, 10.0), (60.0, 300.6)],
        [(10.0, 10.0), (-1.1, 60.0)],
        [(10.0, 10.0), (INF, 60.0)],
        [(10.0, 10.0), (60.0,)],
        [(10.0, 10.0), (60.0, "y")],
        [(10.0, 10.0), (60.0, 10**400)],
    ],
)
def test_points_that_are_not_on_the_image_are_refused(points: list[tuple[float, float]]) -> None:
    edits = corrected()
    with pytest.raises(ConfigError, match="corrections: "):
        edits.add(points)
    assert not edits.can_undo


def test_a_fibre_may_reach_the_border_of_the_image() -> None:
    edits = corrected()
    edits.add([(-0.5, 250.0), (399.5, 250.0)])
    edits.move_end(2, (399.5, 250.0), (400.0, 299.5))
    assert edits.contains((-1.0, 300.0))
    assert not edits.contains((-1.1, 0.0))
    assert not edits.contains((NAN, 0.0))


def test_an_end_is_not_moved_out_of_the_image_nor_from_far_away() -> None:
    edits = corrected()
    with pytest.raises(ConfigError, match=r"\(7000, 2400\) lies outside the image of 400 x 300 px"):
        edits.move_end(1, (360.0, 100.0), (7000.0, 2400.0))
    with pytest.raises(ConfigError, match="from fibre 1"):
        edits.move_end(1, (360.0, 160.0), (300.0, 100.0))
    assert lengths(edits) == [300]


def test_a_cut_far_from_the_fibre_is_refused_with_the_distance_and_the_limit() -> None:
    edits = corrected()
    with pytest.raises(
        ConfigError, match=r"\(160, 290\) is 190 px from fibre 1, and 2\d px is the"
    ):
        edits.cut(1, (160.0, 290.0))
    with pytest.raises(ConfigError, match="inf px from"):
        edits.cut(1, (1.7e308, 1.7e308))
    edits.cut(1, (160.0, 119.0))
    assert len(edits.lines) == 2


def test_whatever_click_finds_a_fibre_can_cut_it() -> None:
    for width in (3.0, 6.0, 40.0):
        edits = Corrections(IMAGE)
        edits.add([(60.0, 100.0), (360.0, 100.0)], width)
        away = max(y for y in range(100, 300) if edits.nearest((200.0, float(y))))
        edits.cut(1, (200.0, float(away)))


def test_the_number_of_a_fibre_that_is_gone_is_given_to_no_other(tmp_path: Path) -> None:
    edits = corrected()
    edits.cut(1, (160.0, 100.0))
    edits.delete(2)
    edits.add([(50.0, 200.0), (150.0, 200.0)])
    assert numbers(edits) == [1, 3]
    edits.undo()
    assert numbers(edits) == [1]
    edits.redo()
    assert numbers(edits) == [1, 3]
    edits.undo()
    edits.save(tmp_path / "a.png")
    again = Corrections.open(IMAGE, tmp_path / "a.png")
    again.redo()
    assert numbers(again) == [1, 3]
    again.undo()
    again.add([(50.0, 250.0), (150.0, 250.0)])
    assert numbers(again) == [1, 4]
    again.undo()
    again.delete(1)  # of the edit that made fibre 4 nothing is left
    again.save(tmp_path / "a.png")
    again = Corrections.open(IMAGE, tmp_path / "a.png")
    again.add([(50.0, 250.0), (150.0, 250.0)])
    assert numbers(again) == [5]


def test_numbers_of_numpy_are_kept_as_any_others(tmp_path: Path) -> None:
    edits = corrected()
    edits.cut(np.int64(1), (160.0, 100.0))  # type: ignore[arg-type]
    edits.save(tmp_path / "a.png")
    assert numbers(Corrections.open(IMAGE, tmp_path / "a.png")) == [1, 2]
    with pytest.raises(ConfigError, match="no fibre '1'"):
        edits.delete("1")  # type: ignore[arg-type]


def test_a_file_of_version_1_opens_with_the_numbers_that_it_had(tmp_path: Path) -> None:
    line = {"number": 1, "width_px": 9.0, "length_px": 300.0, "by_operator": False}
    line["line_px"] = [[float(x), 100.0] for x in range(60, 362, 2)]
    edits = [
        {"kind": "cut", "numbers": [1], "points_px": [[160.0, 290.0]], "width_px": 0.0},
        {"kind": "delete", "numbers": [2], "points_px": [], "width_px": 0.0},
        {"kind": "add", "numbers": [], "points_px": [[50, 200], [450.0, 200.0]], "width_px": 9.0},
        {"kind": "add", "numbers": [], "points_px": [[50, 250], [150.0, 250.0]], "width_px": 9.0},
    ]
    when = "2026-11-01T10:00:00+00:00"
    whole = {
        "version": 1,
        "image": "a.png",
        "pixels_sha256": corrected().digest,
        "found": [line],
        "edits": [each | {"when": when} for each in edits],
        "in_force": 3,
        "fibres": [],
    }
    (tmp_path / "a.png.fibres.json").write_text(json.dumps(whole))
    old = Corrections.open(IMAGE, tmp_path / "a.png")
    assert numbers(old) == [1, 2]
    assert lengths(old) == [100, 400]
    old.redo()
    assert numbers(old) == [1, 2, 3]
    old.undo()
    old.add([(50.0, 280.0), (150.0, 280.0)])
    assert numbers(old) == [1, 2, 4]


Kept = dict[str, object]


def _in_edit(number: int, **changed: object) -> Callable[[Kept], Kept]:
    def change(whole: Kept) -> Kept:
        edits = list(whole["edits"])  # type: ignore[call-overload]
        edits[number] |= changed
        return whole | {"edits": edits}

    return change


def _in_found(**changed: object) -> Callable[[Kept], Kept]:
    return lambda whole: whole | {"found": [whole["found"][0] | changed]}  # type: ignore[index]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda whole: [whole], "no version"),
        (lambda whole: whole | {"version": True}, "no version"),
        (lambda whole: whole | {"version": 99}, "is of version 99"),
        (lambda whole: whole | {"version": 0}, "is of version 0"),
        (lambda whole: whole | {"found": 3}, "found"),
        (lambda whole: whole | {"found": whole["found"] * 2}, "two fibres have one number"),
        (lambda whole: whole | {"in_force": 7}, "7 edits in force of 2"),
        (lambda whole: whole | {"in_force": -1}, "in_force"),
        (lambda whole: whole | {"in_force": 1e300}, "in_force"),
        (lambda whole: whole | {"other": INF}, "Infinity"),
        (_in_found(width_px=NAN), "NaN"),
        (_in_found(width_px=-5.0), "width_px"),
        (_in_found(number="x"), "number"),
        (_in_found(line_px=[[1.0, 2.0]]), "line_px"),
        (_in_found(line_px=[]), "line_px"),
        (_in_found(line_px=[[1.0, 2.0], [1.0]]), "line_px"),
        (_in_found(line_px=[[1e12, 2.0]] * 9), "and 6 more"),
        (_in_edit(0, kind="explode"), "edit 1: corrections: there is no edit 'explode'"),
        (_in_edit(0, points_px=[]), "edit 1: corrections: there is no edit 'cut' of 1 fibres and"),
        (_in_edit(0, numbers=[]), "edit 1: corrections: there is no edit 'cut' of 0 fibres and 1"),
        (_in_edit(0, new_number=1), "edit 1: corrections: 1 is not the number of a new fibre"),
        (_in_edit(1, numbers=[8]), "edit 2: corrections: there is no fibre 8"),
        (_in_edit(0, numbers=[10**30]), "numbers"),
    ],
)
def test_a_damaged_file_is_refused_by_its_name_and_what_is_wrong(
    tmp_path: Path, change: Callable[[Kept], object], said: str
) -> None:
    edits = corrected()
    edits.cut(1, (160.0, 100.0))
    edits.delete(2)
    side = edits.save(tmp_path / "a.png")
    side.write_text(json.dumps(change(json.loads(side.read_text()))))
    with pytest.raises(RecordingError) as refused:
        Corrections.open(IMAGE, tmp_path / "a.png")
    assert str(refused.value).startswith(f"{side}: ")
    assert said in str(refused.value)
    assert "move it away" in str(refused.value)


@pytest.mark.parametrize(
    "content", [b"", b"\xff\xfe", b"[" * 100_000, b"9" * 9_000, b'{"version": 1e999}', b"null"]
)
def test_what_is_no_file_of_corrections_is_refused_by_its_name(
    tmp_path: Path, content: bytes
) -> None:
    side = tmp_path / "a.png.fibres.json"
    side.write_bytes(content)
    with pytest.raises(RecordingError, match=r"a\.png\.fibres\.json: holds no corrections"):
        Corrections.open(IMAGE, tmp_path / "a.png")


def test_what_is_not_finite_is_written_to_no_file(tmp_path: Path) -> None:
    (fibre,) = find_fibres(IMAGE)
    edits = Corrections(IMAGE, [replace(fibre, width_px=NAN)])
    with pytest.raises(RecordingError, match="not finite"):
        edits.save(tmp_path / "a.png")
    assert list(tmp_path.iterdir()) == []


def test_a_number_too_large_for_a_label_is_not_exported_as_another(tmp_path: Path) -> None:
    edits = corrected()
    side = edits.save(tmp_path / "a.png")
    side.write_text(json.dumps(json.loads(side.read_text()) | {"next_number": 65_536}))
    edits = Corrections.open(IMAGE, tmp_path / "a.png")
    edits.add([(50.0, 200.0), (150.0, 200.0)])
    with pytest.raises(RecordingError, match="65535, and a fibre has the number 65536"):
        edits.export(tmp_path / "out", "a")
