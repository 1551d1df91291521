"""Recordings of images in another format."""

import numpy as np
import pytest

from cosmic.frame.errors import ExportCancelled, RecordingError, RecordingExistsError
from cosmic.vico.core.recording.export import export_images
from cosmic.vico.core.recording.formats import ImageFormat
from cosmic.vico.core.recording.image_file import ImageFile
from cosmic.vico.core.recording.reading import open_image_recording
from cosmic.vico.core.recording.side_row import row_of
from cosmic.vico.hw.interface import PixelFormat
from unit.vico.recording.image_helpers import AXES, images


@pytest.fixture
def make(tmp_path):
    def make(image_format=ImageFormat.FFV1, name="run", count=6, **how):
        file = ImageFile(tmp_path / name, image_format, axes=AXES)
        for shot in images(count, **how):
            file.append(shot.data, row_of(shot, None))
        file.close(complete=True)
        return file.path

    return make


def names(directory):
    return sorted(str(each.relative_to(directory)) for each in directory.rglob("*"))


@pytest.mark.parametrize("to", ImageFormat)
def test_an_export_has_the_same_images_and_rows(tmp_path, make, to):
    path = make(ImageFormat.FAST)
    fractions = []
    out = export_images(path, to, progress=fractions.append)
    assert out == tmp_path / f"run_{to}{'' if to in {'tiff', 'png'} else out.suffix}"
    assert fractions == [0.0, *(pytest.approx(number / 6) for number in range(1, 7))]
    with open_image_recording(path) as before, open_image_recording(out) as after:
        assert after.complete
        assert after.rows == before.rows
        assert after.axes == AXES
        if to is not ImageFormat.SMALL:
            for one, other in zip(before, after, strict=True):
                np.testing.assert_array_equal(one.data, other.data)
    if to in {"tiff", "png"}:
        assert (out / f"run_{to}_000005.{'tif' if to == 'tiff' else 'png'}").exists()
    assert not [each for each in names(tmp_path) if "export" in each]


@pytest.mark.parametrize("to", [ImageFormat.FFV1, ImageFormat.TIFF])
def test_a_cancelled_export_leaves_nothing(tmp_path, make, to):
    path = make(ImageFormat.FAST)
    before = names(tmp_path)
    with pytest.raises(ExportCancelled, match="cancelled"):
        export_images(path, to, progress=lambda fraction: fraction < 0.5)
    assert names(tmp_path) == before


def test_what_is_there_is_replaced_only_when_asked_to(tmp_path, make):
    path = make()
    for to in (ImageFormat.TIFF, ImageFormat.FAST):
        export_images(path, to)
        with pytest.raises(RecordingExistsError, match="may be replaced"):
            export_images(path, to)
        export_images(path, to, overwrite=True)


def test_files_of_others_are_never_replaced(tmp_path, make):
    path = make()
    (tmp_path / "run_tiff").mkdir()
    (tmp_path / "run_tiff" / "notes.txt").touch()
    with pytest.raises(RecordingError, match="there are other files"):
        export_images(path, "tiff", overwrite=True)
    with pytest.raises(RecordingError, match="onto itself"):
        export_images(path, "ffv1", path, overwrite=True)
    with pytest.raises(RecordingError, match="onto itself"):
        export_images(path, "png", tmp_path / "run", overwrite=True)
    with open_image_recording(path) as found:
        assert len(found) == 6


def test_formats_that_do_not_fit_are_reported(make):
    path = make(pixel_format=PixelFormat.MONO12)
    with pytest.raises(RecordingError, match="small cannot keep Mono12"):
        export_images(path, "small")
    with pytest.raises(RecordingError, match="cannot export to 'csv'; there are ffv1"):
        export_images(path, "csv")


def test_a_recording_cut_off_is_exported_as_far_as_it_goes(tmp_path, make):
    path = make(count=10)
    side = tmp_path / "run.csv"
    side.write_text("".join(side.read_text().splitlines(keepends=True)[:4]))
    out = export_images(path, "png")
    with open_image_recording(out) as found:
        assert len(found) == 10
        assert [row.status for row in found.rows] == ["complete"] * 3 + ["unknown"] * 7
        assert np.diff(found.time_s) == pytest.approx(1 / 20.0)
