import gc
import threading

import pytest
from PySide6.QtCore import QSettings, Qt
from PySide6.QtWidgets import QApplication, QLabel, QLineEdit, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from cosmic.app.configuration.platform_file import load_platform
from cosmic.app.platform import Platform
from cosmic.app.windows.hint_bar import HintBar
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.frame.clock import WALL, RatedClock
from cosmic.frame.errors import DeviceError, DeviceFault, MoveCancelled, StoppedError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.garbage import GARBAGE
from cosmic.frame.threads import running_threads
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.news import AxisBegun
from cosmic.mico.gui.mico_widget import MicoWidget, make_mico_gui
from gui.app.windows import Make, mico
from gui.mico.panels import click, enter, field, part, position, wait_for_position
from unit.mico.rigs import settings as small_settings
from unit.mico.scripted_controller import ScriptedController


def ready(window: OperatorWindow, qtbot: QtBot) -> MicoWidget:
    window.open_hardware()
    panel = mico(window)
    forward = part(panel.cards["left.x"], "MiCoCL_6", QPushButton)
    qtbot.waitUntil(forward.isEnabled)
    return panel


def moving(panel: MicoWidget, qtbot: QtBot) -> None:
    """Set left.x going on a long way."""
    card = panel.cards["left.x"]
    enter(qtbot, field(card, "target"), "5 mm")
    click(qtbot, card, "MiCoCL_9")
    qtbot.waitUntil(lambda: card.axis.details.in_motion and position(card) > 1.0)


def test_the_window_stands_before_the_hardware_is_there(make: Make, qtbot: QtBot) -> None:
    window = make(hardware=False)
    forward = part(mico(window).cards["left.x"], "MiCoCL_6", QPushButton)
    assert not forward.isEnabled()
    ready(window, qtbot)


def test_the_bar_says_what_is_in_force(make: Make) -> None:
    window = make(rate=20.0, hardware=False)
    texts = [label.text() for label in window.top_bar.findChildren(QLabel) if label.isVisible()]
    said = " | ".join(texts)
    for wanted in ("SIMULATED", "controls: this window", "×20"):
        assert wanted in said
    assert "no collision model" not in said


def test_stop_latches_with_its_reason_and_reset_lets_go(make: Make, qtbot: QtBot) -> None:
    window = make(rate=1.0, hardware=False)
    panel = ready(window, qtbot)
    moving(panel, qtbot)
    card = panel.cards["left.x"]
    panel.cards["right.y"].commands.ended.emit("something of before")
    qtbot.mousePress(part(window.top_bar, "stopButton", QPushButton), Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: window.top_bar.latched and not card.axis.details.in_motion)
    stood = position(card)
    for each in panel.cards.values():
        line = part(each, "status", QLabel)
        qtbot.waitUntil(lambda line=line: "stopped: stop button" in line.text().lower())
    click(qtbot, card, "MiCoCL_9")
    qtbot.waitUntil(lambda: "stopped" in field(card, "target").reason)
    assert abs(position(card) - stood) < 1.0

    click(qtbot, window.top_bar, "resetButton")
    qtbot.waitUntil(lambda: not window.top_bar.latched)
    assert not card.axis.details.in_motion
    assert "STOPPED" not in part(panel.cards["right.x"], "status", QLabel).text()
    enter(qtbot, field(card, "target"), "0")
    click(qtbot, card, "MiCoCL_9")
    wait_for_position(qtbot, card, 0.0)


def test_f12_stops_from_a_text_field_and_escape_only_takes_the_entry_back(
    make: Make, qtbot: QtBot
) -> None:
    window = make(rate=1.0, hardware=False)
    panel = ready(window, qtbot)
    moving(panel, qtbot)
    entry = field(panel.cards["right.x"], "MiCoCL_8")
    enter(qtbot, entry, "12")
    qtbot.keyClick(entry, Qt.Key.Key_Escape)
    assert not window.top_bar.latched
    assert entry.text() == "100.0"
    enter(qtbot, entry, "12")
    qtbot.keyClick(entry, Qt.Key.Key_F12)
    qtbot.waitUntil(lambda: window.top_bar.latched)
    assert entry.text() == "12"
    qtbot.waitUntil(lambda: not panel.cards["left.x"].axis.details.in_motion)


def test_a_failure_anywhere_stands_in_the_bar(make: Make, qtbot: QtBot) -> None:
    window = make(hardware=False)
    window.platform.policy.report(DeviceError("the cable is out"), "device 7")
    qtbot.waitUntil(lambda: "the cable is out" in window.top_bar.message)
    assert not window.top_bar.latched


@pytest.mark.defects
def test_a_defect_stops_everything(make: Make, qtbot: QtBot) -> None:
    window = make(rate=1.0, hardware=False)
    panel = ready(window, qtbot)
    moving(panel, qtbot)
    window.platform.policy.report(ValueError("a mistake"), "somewhere")
    qtbot.waitUntil(lambda: window.top_bar.latched)
    qtbot.waitUntil(lambda: not panel.cards["left.x"].axis.details.in_motion)


def test_closing_while_something_moves_ends_everything_in_time(
    make: Make, qtbot: QtBot, stored: QSettings
) -> None:
    window = make(rate=1.0, console=True, hardware=False)
    panel = ready(window, qtbot)
    moving(panel, qtbot)
    movement = panel.cards["left.x"].axis.set(5000.0)
    began_s = WALL.now_s()
    window.close()
    assert WALL.now_s() - began_s < 3.0
    assert isinstance(movement.exception(), (MoveCancelled, StoppedError))
    assert not running_threads()
    assert stored.value("window/docks") is not None


def test_no_collection_of_old_objects_stops_a_window_while_something_moves(
    make: Make, qtbot: QtBot
) -> None:
    window = make(rate=1.0, hardware=False)
    panel = ready(window, qtbot)
    assert GARBAGE.in_force
    assert gc.get_freeze_count() > 10_000
    assert "garbage" not in {thread.name for thread in running_threads()}  # it may be a widget
    moving(panel, qtbot)
    assert window.platform.garbage.moves()
    window.close()
    assert not GARBAGE.in_force
    assert gc.get_freeze_count() == 0
    assert gc.get_threshold()[2] < 1000


def test_only_the_thread_of_the_window_collects_garbage(make: Make, qtbot: QtBot) -> None:
    window = make(hardware=False)
    ready(window, qtbot)
    where: list[threading.Thread] = []
    made = threading.Event()

    class Ring:
        def __init__(self) -> None:
            self.itself = self

        def __del__(self) -> None:
            where.append(threading.current_thread())

    def make_garbage() -> None:
        for _ in range(20_000):  # far beyond what Python lets gather by itself
            Ring()
        made.set()

    threading.Thread(target=make_garbage).start()
    assert made.wait(10.0)
    qtbot.waitUntil(lambda: len(where) == 20_000)
    assert set(where) == {threading.main_thread()}
    window.close()
    assert gc.isenabled()


def test_closing_while_initialising_ends_in_time(make: Make, qtbot: QtBot) -> None:
    window = make(rate=1.0, hardware=False)
    panel = ready(window, qtbot)
    panel.initialise()
    assert panel.caution is not None
    panel.caution.go.click()
    qtbot.waitUntil(lambda: any(axis.details.in_motion for axis in panel.mico))
    began_s = WALL.now_s()
    window.close()
    assert WALL.now_s() - began_s < 3.0
    assert not running_threads()


def movements(panel: MicoWidget) -> list[str]:
    """Return a list that takes who commanded each movement from now on."""
    told: list[str] = []
    panel.mico.follow_movements(
        lambda news: told.append(news.source) if isinstance(news, AxisBegun) else None
    )
    return told


def test_the_console_moves_the_same_platform(make: Make, qtbot: QtBot) -> None:
    window = make(console=True, hardware=False)
    panel = ready(window, qtbot)
    console = window.console
    assert console is not None
    told = movements(panel)
    console.run('rig.mico["left.x"].move_to("0.1 mm")')
    wait_for_position(qtbot, panel.cards["left.x"], 100.0)
    qtbot.waitUntil(lambda: "100" in console.text() or "99." in console.text())
    assert told == ["console"]
    console.run("cosmic.__version__")
    qtbot.waitUntil(lambda: "0.1" in console.text())


def test_interrupting_the_console_halts_what_moves(make: Make, qtbot: QtBot) -> None:
    window = make(rate=1.0, console=True, hardware=False)
    panel = ready(window, qtbot)
    console = window.console
    assert console is not None
    card = panel.cards["left.x"]
    card.axis.set_closed_loop_frequency(100)  # 34 s to the target: a busy machine sees it move
    console.run('rig.mico["left.x"].move_to(5000)')
    qtbot.waitUntil(lambda: card.axis.details.in_motion)
    console.interrupt()
    qtbot.waitUntil(lambda: not console.busy and not card.axis.details.in_motion)
    assert position(card) < 4900.0
    assert not window.top_bar.latched


def test_keys_typed_into_the_console_move_nothing(make: Make, qtbot: QtBot) -> None:
    window = make(console=True, hardware=False)
    panel = ready(window, qtbot)
    console = window.console
    assert console is not None
    line = next(each for each in console.findChildren(QWidget) if takes_keys(each))
    line.setFocus()
    qtbot.keyClicks(line, "dddd")
    assert position(panel.cards["left.x"]) == 0.0


def takes_keys(widget: QWidget) -> bool:
    return type(widget).__name__ == "ConsoleInput" or isinstance(widget, QLineEdit)


def test_the_hint_is_dismissed_once_and_for_all(
    make: Make, qtbot: QtBot, stored: QSettings
) -> None:
    first = make(hardware=False)
    hint = first.findChild(HintBar)
    assert hint is not None
    assert hint.isVisible()
    click(qtbot, hint, "gotIt")
    assert not hint.isVisible()
    first.close()
    again = make(hardware=False).findChild(HintBar)
    assert again is not None
    assert not again.isVisible()


def test_every_key_is_listed(make: Make, qtbot: QtBot) -> None:
    window = make(hardware=False)
    window.show_keys()
    dialog = next(w for w in QApplication.topLevelWidgets() if w.windowTitle() == "Keys")
    assert dialog.isVisible()
    dialog.close()


# Hardware that is not there


class Deaf(ScriptedController):
    """A controller whose library finds nothing until it is mended."""

    deaf = True

    def find_devices(self) -> tuple[int, ...]:
        if self.deaf:
            raise DeviceError("no device answers", fault=DeviceFault.COMMUNICATION)
        return super().find_devices()


def scripted_platform(controller: ScriptedController) -> Platform:
    policy, clock = FailurePolicy(), RatedClock(1.0)
    application = MicoApplication(
        controller, small_settings(), clock=clock, policy=policy, gui_factory=make_mico_gui
    )
    file, path = load_platform(None)
    return Platform(file=file, path=path, clock=clock, policy=policy, mico=application)


def test_closing_stops_the_hardware_before_it_lets_go(make: Make, qtbot: QtBot) -> None:
    controller = ScriptedController(("LLN",), instant=False)
    window = make(scripted_platform(controller), hardware=False)
    window.open_hardware()
    card = mico(window).cards["d0.c0"]
    qtbot.waitUntil(part(card, "MiCoCL_6", QPushButton).isEnabled)
    click(qtbot, card, "MiCoCL_6")
    qtbot.waitUntil(lambda: bool(controller.of("move_to")))
    window.close()
    calls = [call[0] for call in controller.calls]
    assert "stop" in calls[calls.index("move_to") :]
    assert calls[-1] == "close"


def test_a_controller_that_is_not_there_greys_the_panel_until_a_rescan(
    make: Make, qtbot: QtBot
) -> None:
    controller = Deaf(("LLN",))
    window = make(scripted_platform(controller), hardware=False)
    dock = window.dock("Axes")
    window.open_hardware()
    qtbot.waitUntil(lambda: "no device answers" in dock.failure)
    assert "no device answers" in window.top_bar.message
    controller.deaf = False
    rescan = next(b for b in dock.findChildren(QPushButton) if b.text() == "Rescan")
    qtbot.mouseClick(rescan, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: not dock.failure)
    card = mico(window).cards["d0.c0"]
    qtbot.waitUntil(part(card, "MiCoCL_6", QPushButton).isEnabled)
    click(qtbot, card, "MiCoCL_6")
    wait_for_position(qtbot, card, 100.0)
