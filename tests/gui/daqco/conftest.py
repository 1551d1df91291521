import pytest

from cosmic.frame.gui.theme import apply_theme, current_palette
from gui.daqco.fake_port import FakePort, settings


@pytest.fixture(autouse=True)
def _dark(qapp):
    """Colours are those of the dark theme, whatever theme an earlier test put on."""
    if current_palette().name != "dark":
        apply_theme(qapp, "dark")


@pytest.fixture
def port(tmp_path) -> FakePort:
    """Two active channels, one of them a force, at 1 kHz."""
    return FakePort(settings(), tmp_path)
