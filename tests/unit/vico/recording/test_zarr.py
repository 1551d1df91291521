"""OME-Zarr stores, as zarr, xarray and programs of microscopy open them."""

import json
from dataclasses import replace
from importlib.util import find_spec
from types import MappingProxyType

import numpy as np
import pytest

from cosmic.frame.errors import RecordingError, RecordingExistsError
from cosmic.vico.core.recording.export import export_images
from cosmic.vico.core.recording.formats import ImageFormat
from cosmic.vico.core.recording.image_file import ImageFile
from cosmic.vico.core.recording.reading import open_image_recording
from cosmic.vico.core.recording.side_row import row_of
from cosmic.vico.hw.interface import PixelFormat
from unit.vico.recording.image_helpers import AXES, image

COUNT = 5
RATE_HZ = 20.0
needs_zarr = pytest.mark.skipif(find_spec("zarr") is None, reason="there is no zarr here")


def moving(number, pixel_format=PixelFormat.MONO8):
    shot = image(number, time_s=number / RATE_HZ, pixel_format=pixel_format)
    places = MappingProxyType({"left.x": 10.0 * number})
    return replace(shot, circumstances=replace(shot.circumstances, positions=places))


def recorded(path, pixel_format=PixelFormat.MONO8, *, before_end=lambda: None):
    file = ImageFile(path, ImageFormat.ZARR, axes=AXES, rate_hz=2.0)
    shots = [moving(number, pixel_format) for number in range(COUNT)]
    for shot in shots:
        file.append(shot.data, row_of(shot, None))
    before_end()
    file.close(complete=True)
    return [each.data for each in shots]


@needs_zarr
@pytest.mark.parametrize("pixel_format", [PixelFormat.MONO8, PixelFormat.MONO12, PixelFormat.RGB8])
def test_zarr_reads_every_pixel_with_the_dimensions_of_ome(tmp_path, pixel_format):
    import zarr

    went_in = np.array(recorded(tmp_path / "run", pixel_format))
    group = zarr.open_group(str(tmp_path / "run.zarr"), mode="r")
    (known,) = group.attrs["multiscales"]
    names = [each["name"] for each in known["axes"]]
    read = group[known["datasets"][0]["path"]][:]
    if pixel_format is PixelFormat.RGB8:
        assert names == ["t", "c", "y", "x"]
        read = np.moveaxis(read, 1, -1)
    else:
        assert names == ["t", "y", "x"]
    np.testing.assert_array_equal(read, went_in)


@needs_zarr
def test_xarray_opens_it_with_times_and_positions(tmp_path):
    import xarray

    recorded(tmp_path / "run")
    with xarray.open_zarr(tmp_path / "run.zarr", consolidated=False) as found:
        assert found["0"].dims == ("t", "y", "x")
        np.testing.assert_allclose(found["t"], np.arange(COUNT) / RATE_HZ)
        np.testing.assert_allclose(found["left.x_um"], 10.0 * np.arange(COUNT))
        assert found["left.x_um"].units == "um"


@needs_zarr
@pytest.mark.parametrize("pixel_format", [PixelFormat.MONO8, PixelFormat.MONO12])
def test_xarray_has_whole_numbers_and_black_pixels_stay_black(tmp_path, pixel_format):
    import xarray

    file = ImageFile(tmp_path / "run", ImageFormat.ZARR, axes=AXES, rate_hz=2.0)
    shot = moving(0, pixel_format)
    black = np.zeros_like(shot.data)
    file.append(black, row_of(shot, None))
    file.close(complete=True)
    with xarray.open_zarr(tmp_path / "run.zarr", consolidated=False) as found:
        assert found["0"].dtype == black.dtype
        np.testing.assert_array_equal(found["0"][0], black)


def test_ome_says_the_pixel_size_and_the_real_time_between_images(tmp_path):
    recorded(tmp_path / "run")
    attributes = json.loads((tmp_path / "run.zarr" / ".zattrs").read_text())
    (known,) = attributes["multiscales"]
    assert known["version"] == "0.4"
    assert [each.get("unit") for each in known["axes"]] == ["second", "micrometer", "micrometer"]
    (scale,) = known["datasets"][0]["coordinateTransformations"]
    between_s, y_um, x_um = scale["scale"]
    assert between_s == pytest.approx(1 / RATE_HZ)
    assert y_um == x_um == pytest.approx(image(0).circumstances.scale_um_px)
    assert attributes["cosmic"]["camera"] == image(0).camera


def test_what_is_not_closed_is_read_from_its_beginning(tmp_path):
    read = []

    def look():
        with open_image_recording(tmp_path / "run.zarr") as found:
            assert not found.complete
            read.extend(each.data for each in found)

    went_in = recorded(tmp_path / "run", before_end=look)
    assert read
    np.testing.assert_array_equal(read, went_in[: len(read)])


def test_it_is_replaced_only_where_that_was_said(tmp_path):
    recorded(tmp_path / "run")
    with pytest.raises(RecordingExistsError):
        ImageFile(tmp_path / "run", ImageFormat.ZARR, axes=AXES)
    with pytest.raises(RecordingError, match="another format"):
        ImageFile(tmp_path / "run", ImageFormat.STACK, axes=AXES, overwrite=True)
    file = ImageFile(tmp_path / "run", ImageFormat.ZARR, axes=AXES, overwrite=True)
    file.close(complete=True)
    assert not (tmp_path / "run.zarr").exists(), "a recording without an image is none"


def test_a_folder_that_is_no_store_is_never_replaced(tmp_path):
    folder = tmp_path / "run.zarr"
    folder.mkdir()
    (folder / "thesis.txt").write_text("mine")
    with pytest.raises(RecordingExistsError):
        ImageFile(tmp_path / "run", ImageFormat.ZARR, axes=AXES, overwrite=True)
    with pytest.raises(RecordingError, match="other files"):
        export_images(
            export_source(tmp_path), ImageFormat.ZARR, tmp_path / "run.zarr", overwrite=True
        )
    assert (folder / "thesis.txt").read_text() == "mine"


def export_source(tmp_path):
    file = ImageFile(tmp_path / "source", ImageFormat.STACK, axes=AXES)
    shot = moving(0)
    file.append(shot.data, row_of(shot, None))
    file.close(complete=True)
    return file.path


def test_a_stack_is_exported_to_a_store_and_back(tmp_path):
    there = export_images(export_source(tmp_path), "zarr", tmp_path / "there")
    back = export_images(there, "tiff", tmp_path / "back")
    with open_image_recording(back) as found:
        np.testing.assert_array_equal(found[0].data, moving(0).data)


def test_a_store_of_another_program_is_named_and_not_read_wrongly(tmp_path):
    recorded(tmp_path / "run")
    array = tmp_path / "run.zarr" / "0" / ".zarray"
    found = json.loads(array.read_text()) | {"compressor": {"id": "zlib", "level": 1}}
    array.write_text(json.dumps(found))
    with pytest.raises(RecordingError, match="open it with zarr"):
        open_image_recording(tmp_path / "run.zarr")
