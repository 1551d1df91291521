import numpy as np
import pytest

from cosmic.daqco.api.recording import open_recording
from cosmic.daqco.core.file_writer import UDaqFileWriter
from cosmic.frame.failure import FailurePolicy

from unit.daqco.recording_helpers import chunks, header, volts_of


@pytest.fixture
def policy():
    return FailurePolicy()


def test_everything_put_before_the_end_is_in_the_file(tmp_path, policy):
    head = header()
    volts = volts_of(2, 5000)
    writer = UDaqFileWriter(tmp_path / "run.h5", head, policy)
    writer.start()
    for chunk in chunks(head, volts):
        writer.put(chunk)
    writer.request_end()
    assert writer.join()
    assert writer.error is None
    with open_recording(tmp_path / "run.h5") as found:
        assert found.complete
        np.testing.assert_array_equal(found.volts("noise"), volts[1])
