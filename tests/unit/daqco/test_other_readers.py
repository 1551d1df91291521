"""Recordings opened by programs that know nothing of CoSMic: NeXus, xarray, plain HDF5."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray
from nexusformat.nexus import nxload

from cosmic.daqco.api.recording import open_recording
from cosmic.daqco.core.recording_file import RecordingFile
from cosmic.daqco.core.recording_format import AxisPosition
from cosmic.daqco.core.scale import Scale
from unit.daqco.recording_helpers import FORCE, START_UTC, chunks, header, volts_of

AXES = (("left.x", "um"), ("table.rotation", "deg"))


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    """A recording of 5,003 samples with positions of two axes, five times."""
    path = tmp_path_factory.mktemp("readers") / "push.h5"
    head = replace(header(names=("noise", "force")), axes=AXES)
    volts = volts_of(2, 5003)
    file = RecordingFile(path, head)
    for number, chunk in enumerate(chunks(head, volts, 50)):
        file.append(chunk)
        if number % 20 == 0:
            time_s = chunk.time_s
            file.add_positions(
                AxisPosition(time_s, axis, 10.0 * number, unit) for axis, unit in AXES
            )
            file.flush()
    file.close(complete=True)
    return path, volts


def test_nexus_plots_force_over_time(recording):
    path, volts = recording
    root = nxload(str(path))
    entry = root["entry"]
    assert root.nxclass == "NXroot"
    assert entry.nxclass == "NXentry"
    assert entry["start_time"].nxvalue == START_UTC.isoformat()
    shown = entry.plottable_data
    assert shown.nxsignal.nxname == "force"
    assert shown.nxsignal.attrs["units"] == "uN"
    assert [each.nxname for each in shown.nxaxes] == ["time"]
    np.testing.assert_array_equal(shown.nxsignal.nxdata, FORCE.apply(volts[1]))
    np.testing.assert_allclose(shown.nxaxes[0].nxdata, np.arange(5003) / 1000.0, atol=1e-9)


def opened(path, group):
    # Tables beside the entry have no dimensions of their own; xarray is told that it is meant.
    return xarray.open_dataset(path, group=group, engine="h5netcdf", phony_dims="access")


def test_xarray_opens_it_with_units_and_times(recording):
    path, volts = recording
    with opened(path, "entry/data") as found:
        assert found["force"].dims == ("time",)
        assert found["force"].attrs["units"] == "uN"
        np.testing.assert_array_equal(found["noise"].values, volts[0])
        start = np.datetime64(START_UTC.replace(tzinfo=None), "ns")
        assert found["time"].values[0] == start
        later = np.abs(found["time"].values[5000] - start - np.timedelta64(5, "s"))
        assert later < np.timedelta64(1, "us")
    with opened(path, "entry/positions") as found:
        assert found["left.x_um"].attrs["units"] == "um"
        turned = found["table.rotation_deg"].values.tolist()
        assert turned == [0.0, 200.0, 400.0, 600.0, 800.0, 1000.0]


def test_positions_and_force_share_one_clock(recording):
    path, _ = recording
    with h5py.File(path) as file:
        moments = file["entry/positions/time"]
        assert moments.attrs["units"] == file["entry/data/time"].attrs["units"]
        assert [round(b - a, 6) for a, b in pairwise(moments)] == [1.0] * 5


def test_it_reads_as_before_and_is_whole_by_plain_names(recording):
    path, volts = recording
    with open_recording(path) as found, h5py.File(path) as file:
        assert found.samples == 5003
        np.testing.assert_array_equal(file["/entry/data/force"][:], found.values("force"))
        assert file["/volts"].shape == volts.shape


def test_a_scale_that_changes_makes_no_value_in_a_wrong_unit(tmp_path):
    head = header(names=("force",))
    volts = volts_of(1, 3000)
    given = list(chunks(head, volts, 100))
    finer = Scale("finer", "uN", (0.0, 2.0))
    other = Scale("mass", "mg", (0.0, 3.0))
    given[10:20] = [replace(each, scales=(finer,)) for each in given[10:20]]
    given[20:] = [replace(each, scales=(other,)) for each in given[20:]]
    file = RecordingFile(tmp_path / "run.h5", head)
    for each in given:
        file.append(each)
    file.close(complete=True)
    with h5py.File(tmp_path / "run.h5") as found:
        force = found["entry/data/force"][:]
    np.testing.assert_array_equal(force[:1000], FORCE.apply(volts[0, :1000]))
    np.testing.assert_array_equal(force[1000:2000], finer.apply(volts[0, 1000:2000]))
    assert np.isnan(force[2000:]).all()


def test_a_channel_that_is_called_time_does_not_take_the_place_of_the_times(tmp_path):
    file = RecordingFile(tmp_path / "run.h5", header(names=("time", "force")))
    file.close(complete=True)
    with h5py.File(tmp_path / "run.h5") as opened:
        assert set(opened["entry/data"]) == {"time", "time_", "force"}


def test_a_recording_of_before_still_opens(tmp_path: Path, recording):
    old = tmp_path / "old.h5"
    with h5py.File(recording[0]) as source, h5py.File(old, "w") as target:
        for name in source:
            if name != "entry":
                source.copy(source[name], target, name)
        for name, value in source.attrs.items():
            if name not in ("NX_class", "default"):
                target.attrs[name] = value
    with open_recording(old) as found:
        np.testing.assert_array_equal(found.values("force"), FORCE.apply(recording[1][1]))


@pytest.mark.parametrize("flushes", range(4))
def test_a_closed_recording_has_all_its_values_however_often_it_was_flushed(tmp_path, flushes):
    head, volts = header(), volts_of(2, 700)
    file = RecordingFile(tmp_path / "short.h5", head)
    for chunk in chunks(head, volts, 50):
        file.append(chunk)
    for _ in range(flushes):
        file.flush()
    file.close(complete=True)
    with h5py.File(tmp_path / "short.h5") as found:
        force = head.names.index("force")
        np.testing.assert_array_equal(found["entry/data/force"][:], FORCE.apply(volts[force]))
        assert len(found["entry/data/time"]) == 700
