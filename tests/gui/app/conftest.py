"""Windows of the operator over simulated platforms."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QSettings
from pytestqt.qtbot import QtBot

from cosmic.app.platform import Platform, build_platform
from cosmic.app.stations.host import StationHost
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.daqco.gui.main_widget import make_daqco_gui
from cosmic.frame.log import RingBufferHandler
from cosmic.mico.gui.mico_widget import make_mico_gui
from cosmic.vico.gui.vico_gui import make_vico_gui
from gui.app.windows import Make, wait_until_ready
from gui.mico.panels import show


@pytest.fixture
def stored(tmp_path: Path) -> QSettings:
    """What windows keep from one start to the next."""
    return QSettings(str(tmp_path / "window.ini"), QSettings.Format.IniFormat)


@pytest.fixture
def make(qtbot: QtBot, stored: QSettings) -> Iterator[Make]:
    """Make shown windows, by default over the shipped platform with MiCo alone."""
    made: list[OperatorWindow] = []

    def make_window(
        platform: Platform | None = None,
        *,
        rate: float = 20.0,
        cold: bool = False,
        config: Path | None = None,
        applications: tuple[str, ...] = ("mico",),
        console: bool = False,
        hardware: bool = True,
        size: tuple[int, int] = (1400, 900),
        host: StationHost | None = None,
    ) -> OperatorWindow:
        platform = platform or build_platform(
            config,
            applications=applications,
            rate=rate,
            cold=cold,
            mico_gui=make_mico_gui,
            daqco_gui=make_daqco_gui,
            vico_gui=make_vico_gui,
        )
        window = OperatorWindow(platform, stored, RingBufferHandler(), console=console, host=host)
        made.append(window)
        qtbot.addWidget(window)
        show(qtbot, window, *size)
        if hardware:
            window.open_hardware()
        return window

    yield make_window
    for window in made:
        window.close()


@pytest.fixture
def window(make: Make, qtbot: QtBot) -> OperatorWindow:
    """One whose axes are ready, and whose scene is there."""
    window = make()
    wait_until_ready(window, qtbot)
    return window
