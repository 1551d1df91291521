"""What an application tells reaches a widget in the GUI thread, while there is one."""

import threading

import pytest
from PySide6.QtCore import QCoreApplication, QEvent
from PySide6.QtWidgets import QWidget

from cosmic.frame.gui.relay import PortRelay

GOES = QEvent.Type.DeferredDelete.value


class Port:
    """Tells of changes."""

    def __init__(self):
        self.listeners = []

    def on_change(self, listener):
        self.listeners.append(listener)
        return lambda: self.listeners.remove(listener)

    def change(self):
        for each in self.listeners:
            each()


class Shown(QWidget):
    def __init__(self):
        super().__init__()
        self.threads = []

    def refresh(self):
        self.threads.append(threading.current_thread())


@pytest.fixture
def port():
    return Port()


def test_a_change_in_a_thread_is_told_in_the_gui_thread(qtbot, port):
    widget = Shown()
    qtbot.addWidget(widget)
    PortRelay(port, widget).changed.connect(widget.refresh)
    teller = threading.Thread(target=port.change)
    teller.start()
    teller.join()
    qtbot.waitUntil(lambda: bool(widget.threads))
    assert widget.threads == [threading.main_thread()]


def test_it_stops_listening_when_the_widget_goes_and_when_it_is_told_to(qapp, port):
    kept = []
    widget = Shown()
    relay = PortRelay(port, widget)
    relay.keep(lambda: kept.append("ended"))
    widget.deleteLater()
    QCoreApplication.sendPostedEvents(widget, GOES)
    assert (port.listeners, kept) == ([], ["ended"])
    other = Shown()
    relay = PortRelay(port, other)
    relay.end()
    relay.end()
    assert port.listeners == []
    other.deleteLater()
    QCoreApplication.sendPostedEvents(other, GOES)
