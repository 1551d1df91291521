import h5py
import numpy as np
import pytest

from cosmic.daqco.api.recording import open_recording
from cosmic.daqco.core.recording_file import RecordingFile
from cosmic.daqco.core.recording_format import AxisPosition, RecordedEvent, RecordingError
from cosmic.daqco.core.scale import VOLTS, Scale

from unit.daqco.recording_helpers import FORCE, START_UTC, chunks, header, volts_of


@pytest.mark.parametrize(("rate_hz", "size"), [(10.0, 1), (1000.0, 10), (15000.0, 150)])
def test_volts_come_back_bit_for_bit(tmp_path, rate_hz, size):
    head = header(rate_hz=rate_hz)
    volts = volts_of(2, 20_003)
    file = RecordingFile(tmp_path / "run.h5", head)
    for number, chunk in enumerate(chunks(head, volts, size)):
        file.append(chunk)
        if number % 7 == 0:
            file.flush()
    file.close(complete=True)
    with open_recording(tmp_path / "run.h5") as found:
        assert found.complete
        assert found.samples == 20_003
        np.testing.assert_array_equal(found.volts("force"), volts[0])
        np.testing.assert_array_equal(found.volts("noise"), volts[1])
        np.testing.assert_array_equal(found.values("force"), FORCE.apply(volts[0]))
        np.testing.assert_allclose(
            found.time_s, 100.0 + np.arange(20_003) / rate_hz, rtol=0, atol=1e-9
        )
