"""Tabs of what moves axes by itself or by another hand: trajectories, teleoperation, loops."""

from typing import Final

from PySide6.QtWidgets import QWidget

from cosmic.app.panels.control import ControlPanel, make_control_panel
from cosmic.app.panels.scene import ScenePanel
from cosmic.autonomy.control.control import Control
from cosmic.frame.gui.late_panel import LatePanel
from cosmic.frame.gui.server_gui import CosmicServerGui
from cosmic.mico.gui.mico_widget import MicoWidget
from cosmic.mico.gui.teleoperation_panel import TeleoperationPanel, make_teleoperation_panel
from cosmic.mico.gui.trajectory_panel import TrajectoryPanel, make_trajectory_panel

TRAJECTORIES: Final = "Trajectories"
TELEOPERATION: Final = "Teleoperation"
CONTROL: Final = "Control loop"


class MotionTabs:
    """Trajectories, teleoperation and control loops, in tabs with another panel; GUI thread.

    Each is made when it is first seen or asked for.

    Parameters
    ----------
    beside : str
        Title of the panel whose place they share; it stays in front.
    """

    def __init__(
        self,
        window: CosmicServerGui,
        gui: MicoWidget,
        scene: ScenePanel,
        control: Control,
        beside: str,
    ) -> None:
        self._gui = gui
        self._scene = scene
        self._trajectories = LatePanel(self._make_trajectories)
        self._teleoperation = LatePanel(lambda: make_teleoperation_panel(gui.mico))
        self._control = LatePanel(lambda: make_control_panel(control, busy=lambda: gui.busy))
        panels: dict[str, QWidget] = {
            TRAJECTORIES: self._trajectories,
            TELEOPERATION: self._teleoperation,
            CONTROL: self._control,
        }
        for title, panel in panels.items():
            window.add_panel(title, panel, beside=beside, tabbed=True)
        window.dock(beside).raise_()

    def _make_trajectories(self) -> TrajectoryPanel:
        panel = make_trajectory_panel(self._gui.mico)
        panel.preview_changed.connect(self._scene.set_planned)
        panel.refused.connect(self._gui.verdict_given)
        return panel

    @property
    def trajectories(self) -> TrajectoryPanel:
        """The panel of SCM, made now if need be."""
        return self._trajectories.panel

    @property
    def teleoperation(self) -> TeleoperationPanel:
        """The panel that steers by an input device, made now if need be."""
        return self._teleoperation.panel

    @property
    def control(self) -> ControlPanel:
        """The panel of control loops, made now if need be."""
        return self._control.panel

    def shut_down(self) -> None:
        """Let go of the input device."""
        if self._teleoperation.made is not None:
            self._teleoperation.made.shut_down()
