"""An operator corrects the fibres on an image: undoable, kept with the image, exported."""

import json
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
