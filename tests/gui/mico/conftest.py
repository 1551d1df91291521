from collections.abc import Iterator

import pytest
from PySide6.QtCore import QCoreApplication, QEvent
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from cosmic.frame.gui.quantity_field import QuantityField
from cosmic.mico.gui.mico_widget import MicoWidget
from gui.busy_machine import PatientQtBot
from gui.mico.panels import position, simulated_panel


@pytest.fixture
def panel(qtbot: QtBot) -> Iterator[MicoWidget]:
    """The shipped platform, found warm, fifty times faster than real."""
    with simulated_panel(qtbot) as panel:
        yield panel


@pytest.fixture(scope="module")
def _kept_panel(
    qapp: QApplication, quick_platform: None, request: pytest.FixtureRequest
) -> Iterator[MicoWidget]:
    with simulated_panel(PatientQtBot(request)) as panel:
        yield panel
    panel.deleteLater()
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete.value)


@pytest.fixture
def still_panel(_kept_panel: MicoWidget, qtbot: QtBot) -> Iterator[MicoWidget]:
    """The same, one for all tests of a file that leave every axis where it stands."""
    panel = _kept_panel
    panel.activateWindow()
    qtbot.waitUntil(panel.isActiveWindow)
    fields = {each: each.value() for each in panel.findChildren(QuantityField)}
    stood = {name: position(card) for name, card in panel.cards.items()}
    yield panel
    for each, value in fields.items():
        if each.is_editing:
            each.revert()
        each.set_value(value)
    assert {name: position(card) for name, card in panel.cards.items()} == stood
