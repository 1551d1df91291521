"""A window over other stations: who commands, STOP, and what it shows when one is away."""

import secrets
from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from contract.station_rig import free_port
from cosmic.app.configuration.network import NetworkSettings, serving
from cosmic.app.panels.instruments import DAQCO
from cosmic.app.platform import Platform, Uses, build_platform
from cosmic.app.stations.address import StationAddress
from cosmic.app.stations.host import StationHost
from cosmic.app.windows.operator_window import MICO, OperatorWindow
from cosmic.daqco.gui.main_widget import make_daqco_gui
from cosmic.mico.gui.mico_widget import make_mico_gui
from gui.app.windows import Make

NAME = "fiberstation"


class Station:
    """A platform in this process that others reach over a line."""

    def __init__(self, *applications: str) -> None:
        self.platform = build_platform(applications=applications, rate=20.0)
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        self.platform.initialize()
        self.host: StationHost
        self.open()

    def open(self) -> None:
        """Serve, again."""
        file = self.platform.file.platform
        how = serving(NetworkSettings(), file.name, self.platform.path, listen=self.endpoint)
        self.host = StationHost(self.platform, how)

    def close(self) -> None:
        """End all of it."""
        self.host.close()
        self.platform.shut_down()

    def used(self) -> Platform:
        """Return a platform whose applications are at this station."""
        return build_platform(
            applications=(),
            uses=Uses((StationAddress(NAME, self.endpoint),), "window"),
            mico_gui=make_mico_gui,
            daqco_gui=make_daqco_gui,
        )


@pytest.fixture
def station() -> Iterator[Callable[..., Station]]:
    with ExitStack() as at_end:

        def make_station(*applications: str) -> Station:
            made = Station(*applications)
            at_end.callback(made.close)
            return made

        yield make_station


def press(window: OperatorWindow, qtbot: QtBot, action: str) -> None:
    qtbot.mouseClick(window.top_bar.controls.buttons[action], Qt.MouseButton.LeftButton)


def test_axes_of_another_station_are_commanded_and_stopped_from_a_window(
    station: Callable[..., Station], make: Make, qtbot: QtBot
) -> None:
    there = station("mico")
    window = make(there.used())
    sign, lease = window.top_bar.controls, there.host.lease
    mico = there.platform.mico
    assert mico is not None
    assert window.mico_gui is not None
    assert "left.x" in window.mico_gui.cards, "the same panels as at home"
    qtbot.waitUntil(lambda: sign.text == f"controls: the operator at {NAME}")

    press(window, qtbot, f"take at {NAME}")
    qtbot.waitUntil(lambda: sign.text == "controls: this window")
    assert lease.state.holder.startswith("window-")
    press(window, qtbot, f"release at {NAME}")
    qtbot.waitUntil(lambda: lease.state.local)

    lease.take_over()
    qtbot.waitUntil(lambda: not sign.buttons, timeout=5000)
    window.stop("key F12")
    qtbot.waitUntil(lambda: "key F12" in (mico.manager.latch.state.reason or ""))
    qtbot.waitUntil(lambda: window.top_bar.latched)

    there.host.close()
    qtbot.waitUntil(lambda: f"{NAME} is away" in window.dock(MICO).failure, timeout=10_000)
    assert sign.text == f"controls: {NAME} is away"
    there.open()
    qtbot.waitUntil(lambda: not window.dock(MICO).failure, timeout=10_000)


def test_a_panel_is_grey_while_its_station_is_away(
    station: Callable[..., Station], make: Make, qtbot: QtBot
) -> None:
    there = station("daqco")
    window = make(there.used())
    assert window.top_bar.controls.text == "controls: this window", "nothing moves there"
    there.host.close()
    qtbot.waitUntil(lambda: f"{NAME} is away" in window.dock(DAQCO).failure, timeout=10_000)
    assert f"{NAME} is away" in window.top_bar.message
    assert not window.dock(DAQCO).panel.isEnabled()
    there.open()
    qtbot.waitUntil(lambda: not window.dock(DAQCO).failure, timeout=10_000)
    assert window.dock(DAQCO).panel.isEnabled()
    assert not window.top_bar.message


def test_a_window_that_serves_says_who_commands_and_takes_over(
    station: Callable[..., Station], make: Make, qtbot: QtBot
) -> None:
    there = station("daqco")
    window = make(there.platform, host=there.host, hardware=False)
    sign, lease = window.top_bar.controls, there.host.lease
    assert sign.text == "controls: this window"
    token = secrets.token_hex()
    lease.take("vision", token, in_process=True)
    qtbot.waitUntil(lambda: sign.text == "controls: vision")
    press(window, qtbot, "take over")
    qtbot.waitUntil(lambda: sign.text == "controls: this window, kept")
    assert lease.state.local
    assert not lease.state.offered
    press(window, qtbot, "offer")
    qtbot.waitUntil(lambda: sign.text == "controls: this window")
    lease.take("vision", token, in_process=True)
    assert lease.state.holder == "vision"
