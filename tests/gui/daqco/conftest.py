import pytest

from gui.daqco.fake_port import FakePort, settings


@pytest.fixture
def port(tmp_path) -> FakePort:
    """Two active channels, one of them a force, at 1 kHz."""
    return FakePort(settings(), tmp_path)
