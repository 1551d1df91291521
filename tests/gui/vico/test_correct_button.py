"""The fibres of the live image are opened for correction, and kept beside the image."""

from pathlib import Path

from PySide6.QtCore import QStandardPaths

from cosmic.vico.api.measure import Corrections, read_images, side_file


def test_fibres_of_the_image_shown_are_corrected_and_kept(qtbot, shown, camera, own) -> None:
    shown.correct.click()
    qtbot.waitUntil(lambda: shown.correct.editor is not None)
    editor = shown.correct.editor
    own(editor)
    image = shown.view.image
    camera.push()  # the camera goes on; the editor stays with its image
    editor.corrections.move_end(1, (400.0, 100.0), (300.0, 100.0))
    editor.save.click()
    editor.save.click()
    (file,) = camera.directory.glob("fibres-*.tif")
    assert file.name == "fibres-20261121-121640.tif"
    (page,) = read_images(file)
    assert (page.pixels == image.data).all()
    kept = Corrections.open(page.pixels, file)
    assert [round(each.length_px) for each in kept.lines] == [200]
    assert str(side_file(file)) in editor.note.text()
    assert shown.correct.isEnabled()


def test_why_no_fibres_can_be_corrected_is_said_over_the_image(qtbot, view, camera) -> None:
    view.correct.click()
    assert "no image yet" in view.message.text
    camera.push()
    qtbot.waitUntil(lambda: view.view.image is not None)
    camera.refuse = "fibres cannot be looked for"
    view.correct.click()
    qtbot.waitUntil(lambda: "cannot be looked for" in view.message.text)
    assert view.correct.editor is None and view.correct.isEnabled()


def test_corrections_on_the_image_of_a_station_are_kept_on_this_computer(
    qtbot, shown, camera, own, tmp_path, monkeypatch
) -> None:
    camera.remote, camera.directory = "fibres", Path("/no/such/folder/here")
    here = tmp_path / "documents"
    here.mkdir()
    monkeypatch.setattr(QStandardPaths, "writableLocation", lambda _: str(here))
    shown.correct.click()
    qtbot.waitUntil(lambda: shown.correct.editor is not None)
    editor = shown.correct.editor
    own(editor)
    editor.save.click()
    (file,) = here.glob("fibres-*.tif")
    assert str(side_file(file)) in editor.note.text()
