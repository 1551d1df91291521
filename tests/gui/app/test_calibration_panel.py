"""The list of calibrations: what stands in it, and what is measured anew."""

from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Any

import pytest

from cosmic.app.panels.calibrations import AGE, HOW, RESIDUAL, STANDING, CalibrationPanel
from cosmic.autonomy.calibrating.registry import CalibrationEntry, CalibrationRegistry
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import NotAvailable

NOON = datetime(2026, 11, 21, 12, 0, tzinfo=UTC)


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def registry(clock: ManualClock) -> CalibrationRegistry:
    registry = CalibrationRegistry(clock=clock, now=lambda: NOON)
    for name, residual in (("height", 2.34), ("map", 0.1)):
        registry.put(
            CalibrationEntry(
                name, "left", {"up_um": 38.5}, residual, "um", 12.0, NOON, 0.0, registry.session
            )
        )
    return registry


@pytest.fixture
def panel(qtbot: Any, registry: CalibrationRegistry) -> Iterator[CalibrationPanel]:
    def calibrate(*, zooms: bool) -> Any:
        raise NotAvailable(f"every zoom: {zooms}; initialise the platform first")

    panel = CalibrationPanel(lambda: registry, calibrate)
    qtbot.addWidget(panel)
    panel.show()
    yield panel
    panel.shut_down()


def row(panel: CalibrationPanel, number: int) -> list[str]:
    item = panel.list.topLevelItem(number)
    assert item is not None
    return [item.text(column) for column in range(panel.list.columnCount())]


def test_each_is_listed_with_residual_and_age(panel: CalibrationPanel, clock: ManualClock) -> None:
    assert row(panel, 0)[: AGE + 1] == ["height", "left", "fresh", "2.3 µm", "12", "0.0 s"]
    clock.advance(8000.0)
    panel.refresh()
    assert row(panel, 0)[STANDING] == "stale"


def test_a_poor_one_says_why_and_shows_no_residual(
    panel: CalibrationPanel, registry: CalibrationRegistry
) -> None:
    registry.refuse(registry.entries[1], "residual 0.8 px, at most 0.5 is allowed")
    panel.refresh()
    shown = row(panel, 1)
    assert (shown[STANDING], shown[RESIDUAL]) == ("poor", "")
    assert "0.8 px" in shown[HOW]


def test_what_is_selected_is_measured_anew(
    panel: CalibrationPanel, registry: CalibrationRegistry
) -> None:
    assert not panel.anew.isEnabled()
    item = panel.list.topLevelItem(0)
    assert item is not None
    item.setSelected(True)
    panel.anew.click()
    assert [each.name for each in registry.entries] == ["map"]
    assert panel.list.topLevelItemCount() == 1


def test_why_nothing_could_be_begun_is_said(panel: CalibrationPanel) -> None:
    panel.zooms.setChecked(True)
    panel.run.start.click()
    assert "every zoom: True" in panel.run.reason.text()
