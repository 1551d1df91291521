"""What happens in any thread reaches a QObject in the GUI thread, while there is one."""

import threading
from types import MethodType

import pytest
from PySide6.QtCore import QCoreApplication, QEvent
from PySide6.QtWidgets import QWidget

from cosmic.frame.events import Event
from cosmic.frame.gui.relay import Relay

GOES = QEvent.Type.DeferredDelete.value


class Shown(QWidget):
    def __init__(self):
        super().__init__()
        self.heard = []

    def hear(self, *values):
        self.heard.append((values, threading.current_thread()))


@pytest.fixture
def event():
    return Event()


def goes(widget):
    widget.deleteLater()
    QCoreApplication.sendPostedEvents(widget, GOES)


def in_a_thread(function, *args):
    thread = threading.Thread(target=function, args=args)
    thread.start()
    thread.join()


def test_what_happens_in_a_thread_is_heard_in_the_gui_thread(qtbot, event):
    widget = Shown()
    qtbot.addWidget(widget)
    relay = Relay(widget.hear).follow(event.subscribe)
    in_a_thread(event.emit, 1, "left.x")
    qtbot.waitUntil(lambda: bool(widget.heard))
    assert widget.heard == [((1, "left.x"), threading.main_thread())]
    relay.end()


def test_in_the_gui_thread_it_is_heard_at_once_unless_it_is_queued(qtbot):
    widget = Shown()
    qtbot.addWidget(widget)
    Relay(widget.hear)("now")
    assert [values for values, _ in widget.heard] == [("now",)]
    later = Relay(widget.hear, queued=True)
    later("later")
    assert len(widget.heard) == 1
    qtbot.waitUntil(lambda: len(widget.heard) == 2)


def test_a_window_that_is_slow_looks_once_for_all_that_changed_meanwhile(qtbot, event):
    widget = Shown()
    qtbot.addWidget(widget)
    relay = Relay(widget.hear).follow(event.subscribe)
    in_a_thread(lambda: [event.emit() for _ in range(500)])
    qtbot.waitUntil(lambda: bool(widget.heard))
    QCoreApplication.processEvents()
    assert len(widget.heard) == 1
    in_a_thread(event.emit)
    qtbot.waitUntil(lambda: len(widget.heard) == 2)
    relay.end()


def test_a_change_while_it_looks_makes_it_look_again(qtbot, event):
    widget = Shown()
    qtbot.addWidget(widget)

    def look(*_values):
        widget.heard.append(len(widget.heard))
        if len(widget.heard) == 1:
            in_a_thread(event.emit)

    widget.hear = MethodType(lambda _self: look(), widget)
    relay = Relay(widget.hear).follow(event.subscribe)
    in_a_thread(event.emit)
    qtbot.waitUntil(lambda: len(widget.heard) == 2)
    relay.end()


def test_a_relay_that_another_thread_lets_go_of_ends_no_timer_of_the_gui_thread(qtbot):
    widget = Shown()
    qtbot.addWidget(widget)
    for _ in range(20):
        held = [Relay(widget.hear, least_ms=5)]
        held[0]()  # its timer runs
        in_a_thread(held.clear)
    qtbot.wait(50)
    assert len(widget.heard) == 20


def test_what_has_a_value_is_heard_each_time_and_in_order(qtbot, event):
    widget = Shown()
    qtbot.addWidget(widget)
    relay = Relay(widget.hear).follow(event.subscribe)
    in_a_thread(lambda: [event.emit(each) for each in range(100)])
    qtbot.waitUntil(lambda: len(widget.heard) == 100)
    assert [values[0] for values, _ in widget.heard] == list(range(100))
    relay.end()


def test_a_relay_that_rests_calls_at_once_then_seldom_and_never_misses_the_last(qtbot):
    widget = Shown()
    qtbot.addWidget(widget)
    relay = Relay(widget.hear, least_ms=60)
    for number in range(5):
        relay(number)
    assert [values for values, _ in widget.heard] == [(0,)]
    qtbot.waitUntil(lambda: len(widget.heard) == 2)
    assert widget.heard[-1][0] == (4,)
    qtbot.wait(80)
    assert len(widget.heard) == 2


def test_it_stops_listening_when_the_widget_goes_and_when_it_is_ended(qapp, event):
    kept = []
    widget = Shown()
    relay = Relay(widget.hear).follow(event.subscribe)
    relay.keep(lambda: kept.append("ended"))
    goes(widget)
    assert (len(event), kept) == (0, ["ended"])
    other = Shown()
    relay = Relay(other.hear).follow(event.subscribe)
    relay.end()
    relay.end()
    assert len(event) == 0
    goes(other)


def test_what_was_on_its_way_to_a_widget_that_is_gone_harms_nobody(qapp):
    widget = Shown()
    heard, relay = widget.heard, Relay(widget.hear)
    in_a_thread(relay, 1)
    goes(widget)
    QCoreApplication.processEvents()
    relay(2)
    assert heard == []


def test_a_relay_keeps_no_widget_alive(qapp):
    widget = Shown()
    gone = []
    widget.destroyed.connect(lambda: gone.append(True))
    relay = Relay(widget.hear)
    del widget
    assert gone == [True]
    relay(1)


def test_what_belongs_to_no_qobject_cannot_be_called_through_a_relay(qapp):
    with pytest.raises(TypeError, match="a method of a QObject"):
        Relay(print)
