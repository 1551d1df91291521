"""Windows of the operator over simulated platforms."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path

import pytest
from PySide6.QtCore import QCoreApplication, QEvent, QSettings
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from cosmic.app.panels.campaign.dock import PANEL
from cosmic.app.platform import Platform, build_platform
from cosmic.app.stations.host import StationHost
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.gui.main_widget import make_daqco_gui
from cosmic.frame.log import RingBufferHandler
from cosmic.mico.gui.mico_widget import make_mico_gui
from cosmic.vico.gui.vico_gui import make_vico_gui
from gui.app.windows import Make, wait_until_ready
from gui.busy_machine import PatientQtBot
from gui.mico.panels import show


@pytest.fixture
def stored(tmp_path: Path) -> QSettings:
    """What windows keep from one start to the next."""
    return QSettings(str(tmp_path / "window.ini"), QSettings.Format.IniFormat)


@contextmanager
def made_windows(qtbot: QtBot, stored: QSettings) -> Iterator[Make]:
    """Make shown windows, and close them at the end."""
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
        show(qtbot, window, *size)
        if hardware:
            window.open_hardware()
        return window

    yield make_window
    for window in made:
        window.close_now()
        window.deleteLater()


@pytest.fixture
def make(qtbot: QtBot, stored: QSettings) -> Iterator[Make]:
    """Make shown windows, by default over the shipped platform with MiCo alone."""
    with made_windows(qtbot, stored) as make_window:
        yield make_window


@pytest.fixture(scope="module")
def shared_window(
    qapp: QApplication,
    quick_platform: None,
    request: pytest.FixtureRequest,
    tmp_path_factory: pytest.TempPathFactory,
) -> Iterator[OperatorWindow]:
    """One of all applications, for tests that leave it as good as they found it."""
    folder = tmp_path_factory.mktemp("shared")
    stored = QSettings(str(folder / "window.ini"), QSettings.Format.IniFormat)
    with pytest.MonkeyPatch.context() as patch:
        for variable in ("XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_STATE_HOME"):
            patch.setenv(variable, str(folder))
        import_module(PANEL)  # else a thread of the window does it some time later
        bot = PatientQtBot(request)
        with made_windows(bot, stored) as make_window:
            window = make_window(applications=("mico", "daqco", "vico"))
            daqco = window.platform.daqco
            assert isinstance(daqco, DaqcoApplication)
            # What begins later belongs to the test during which it does.
            bot.waitUntil(lambda: daqco.running)
            yield window
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)


@pytest.fixture
def window(make: Make, qtbot: QtBot) -> OperatorWindow:
    """One whose axes are ready, and whose scene is there."""
    window = make()
    wait_until_ready(window, qtbot)
    return window
