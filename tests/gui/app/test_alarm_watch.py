"""Alarms by level and rate: said once, graver again, over when better, with a sound if wanted."""

import logging
import re

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QPushButton
from pytestqt.qtbot import QtBot

from cosmic.app.configuration.alarms import (
    AlarmLevels,
    AlarmSettings,
    FallingLevels,
    RisingLevels,
)
from cosmic.app.panels.alarms import AlarmBook, AlarmPanel, Level
from cosmic.app.windows import alarm_watch
from cosmic.app.windows.alarm_watch import AlarmWatch, Quantity
from cosmic.daqco.api.daqco import daqco_of
from cosmic.daqco.core.settings import LimitSettings
from gui.app.windows import Make
from gui.mico.panels import part


class Bench:
    """One quantity, a book, and a time that the test moves."""

    def __init__(self, levels: AlarmLevels, *, sound: bool = False) -> None:
        self.book, self.now_s, self.beeps = AlarmBook(), 0.0, 0
        self.watch = AlarmWatch(self.book, sound=sound, now_s=lambda: self.now_s, beep=self._beep)
        self._value: float | None = 0.0
        self._quantity = Quantity("it", "The force", "uN", levels, "Go back", lambda: self._value)

    def _beep(self) -> None:
        self.beeps += 1

    def at(self, value: float | None, after_s: float = 1.0) -> list[tuple[Level, bool]]:
        """Look with another value; return level and whether it lasts, oldest first."""
        self.now_s += after_s
        self._value = value
        self.watch.look({"it": self._quantity})
        return [(each.level, each.lasts) for each in reversed(self.book.alarms)]


def test_each_level_is_raised_once_and_ends_when_it_is_better_by_some_share() -> None:
    bench = Bench(RisingLevels(warning=80.0, critical=95.0))
    assert bench.at(79.0) == []
    assert bench.at(81.0) == [(Level.WARNING, True)]
    assert bench.at(82.0) == [(Level.WARNING, True)]
    assert bench.at(96.0) == [(Level.WARNING, False), (Level.CRITICAL, True)]
    assert bench.at(94.0)[1:] == [(Level.CRITICAL, True)]  # not yet better by enough
    assert bench.at(85.0)[1:] == [(Level.CRITICAL, True)]  # less grave is no news
    assert bench.at(70.0)[1:] == [(Level.CRITICAL, False)]
    assert len(bench.at(81.0)) == 3


def test_what_costs_time_to_read_is_read_seldom_and_its_rate_is_right() -> None:
    book, reads, now_s = AlarmBook(), list[float](), [0.0]
    watch = AlarmWatch(book, now_s=lambda: now_s[0])

    def read() -> float:
        reads.append(now_s[0])
        return 10.0 * now_s[0]

    levels = RisingLevels(rate_warning=11.0)
    slow = Quantity("disk", "The room", "GB", levels, "Free some", read, every_s=5.0)
    for _ in range(22):
        now_s[0] += 0.5
        watch.look({"disk": slow})
    assert reads == [0.5, 5.5, 10.5]
    assert book.alarms == ()  # 10 a second, whenever it is read


def test_what_is_bad_when_small_raises_on_its_way_down() -> None:
    bench = Bench(FallingLevels(warning=5.0, critical=1.0))
    assert bench.at(6.0) == []
    assert bench.at(4.0) == [(Level.WARNING, True)]
    assert bench.at(0.5)[-1] == (Level.CRITICAL, True)


def test_a_fast_rise_raises_before_the_level_is_reached() -> None:
    bench = Bench(RisingLevels(warning=80.0, rate_warning=10.0, rate_critical=50.0))
    bench.at(0.0)
    assert bench.at(5.0) == []
    assert bench.at(20.0) == [(Level.WARNING, True)]
    assert "rises by 15 uN per second" in bench.book.alarms[0].cause
    assert bench.at(75.0)[-1] == (Level.CRITICAL, True)


def test_what_is_not_known_ends_an_alarm_and_raises_none() -> None:
    bench = Bench(RisingLevels(warning=80.0))
    assert bench.at(None) == []
    bench.at(90.0)
    assert bench.at(None) == [(Level.WARNING, False)]


def test_a_sound_is_made_only_where_wanted_and_until_it_is_acknowledged() -> None:
    quiet, loud = (Bench(RisingLevels(critical=80.0), sound=each) for each in (False, True))
    for bench in (quiet, loud):
        bench.at(90.0)
        bench.at(90.0, after_s=1.0)
        bench.at(90.0, after_s=3.0)
    assert (quiet.beeps, loud.beeps) == (0, 2)
    loud.book.acknowledge()
    loud.at(90.0, after_s=9.0)
    assert loud.beeps == 2


def test_an_alarm_and_its_acknowledgement_stand_in_the_log(
    caplog: pytest.LogCaptureFixture,
) -> None:
    bench = Bench(RisingLevels(critical=80.0))
    with caplog.at_level(logging.INFO, "cosmic"):
        bench.at(90.0)
        bench.at(90.0)
        bench.book.acknowledge()
    assert caplog.messages == [
        "Alarm, critical: The force is 90 uN. Go back.",
        "Alarm acknowledged: The force is 90 uN.",
    ]


def test_the_chosen_alarm_is_acknowledged_though_another_one_came_meanwhile(qtbot: QtBot) -> None:
    book = AlarmBook()
    panel = AlarmPanel(book)
    qtbot.addWidget(panel)
    for source in ("first", "second"):
        book.raise_alarm(source, Level.WARNING, f"the {source}")
    panel.list.setCurrentItem(panel.list.topLevelItem(1))
    book.raise_alarm("third", Level.CRITICAL, "the third")
    qtbot.mouseClick(panel.one, Qt.MouseButton.LeftButton)
    assert {each.source: each.seen for each in book.alarms} == {
        "first": True,
        "second": False,
        "third": False,
    }
    qtbot.mouseClick(panel.one, Qt.MouseButton.LeftButton)
    assert [each.source for each in book.unseen] == ["second"], "the newest, as none is chosen"


def test_a_crossed_limit_is_reported_with_its_value_and_unit(make: Make, qtbot: QtBot) -> None:
    window = make(applications=("mico", "daqco", "vico"), rate=2.0)
    assert window.tasks is not None
    assert window.platform.daqco is not None
    book, daqco = window.tasks.book, daqco_of(window.platform.daqco)
    qtbot.waitUntil(lambda: daqco.running and bool(daqco.limits))
    daqco.set_limit(LimitSettings(channel="force", low=-150.0, high=0.5, armed=True))
    qtbot.waitUntil(lambda: any(each.source == "limit force" for each in book.alarms))
    cause = next(each.cause for each in book.alarms if each.source == "limit force")
    assert re.fullmatch(r"force crossed its limit at \d+\.\d+ uN", cause)


def test_a_warning_above_the_critical_level_is_refused() -> None:
    with pytest.raises(ValueError, match="warning must not lie above critical"):
        AlarmSettings(force=RisingLevels(warning=0.9, critical=0.5))


def test_a_disk_that_is_nearly_full_is_shown_in_the_bar_until_it_is_acknowledged(
    make: Make, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(alarm_watch, "disk_left_gb", lambda _folder: 0.4)
    monkeypatch.setattr(alarm_watch, "processor_load", lambda: None)
    window = make(applications=("mico", "daqco", "vico"), hardware=False)
    tasks = window.tasks
    assert tasks is not None
    qtbot.waitUntil(lambda: bool(tasks.book.unseen))
    assert "0.4 GB" in tasks.book.unseen[0].cause
    window.raise_panel("Alarms")
    qtbot.mouseClick(part(window, "ackAll", QPushButton), Qt.MouseButton.LeftButton)
    tasks.watch()
    assert tasks.book.unseen == ()
