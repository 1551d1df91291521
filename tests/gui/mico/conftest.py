from collections.abc import Iterator

import pytest
from pytestqt.qtbot import QtBot

from cosmic.mico.gui.mico_widget import MicoWidget
from gui.mico.panels import simulated_panel


@pytest.fixture
def panel(qtbot: QtBot) -> Iterator[MicoWidget]:
    """The shipped platform, found warm, fifty times faster than real."""
    with simulated_panel(qtbot) as panel:
        yield panel
