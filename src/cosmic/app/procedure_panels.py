"""The panels of what MiCo does by itself or under other hands: SCM, teleoperation, loops."""

from typing import Final

from cosmic.app.control_panel import ControlPanel, make_control_panel
from cosmic.app.scene_panel import ScenePanel
from cosmic.autonomy.control.control import Control
from cosmic.frame.gui.server_gui import CosmicServerGui
from cosmic.mico.gui.mico_widget import MicoWidget
from cosmic.mico.gui.teleoperation_panel import TeleoperationPanel, make_teleoperation_panel
from cosmic.mico.gui.trajectory_panel import TrajectoryPanel, make_trajectory_panel

TRAJECTORIES: Final = "Trajectories"
TELEOPERATION: Final = "Teleoperation"
CONTROL: Final = "Control loop"


class ProcedurePanels:
    """Trajectories, teleoperation and control loops, in tabs with another panel; GUI thread.

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
        self.trajectories: TrajectoryPanel = make_trajectory_panel(gui.mico)
        self.trajectories.preview_changed.connect(scene.set_planned)
        self.trajectories.refused.connect(gui.verdict_given)
        self.teleoperation: TeleoperationPanel = make_teleoperation_panel(gui.mico)
        self.control: ControlPanel = make_control_panel(control)
        panels = {
            TRAJECTORIES: self.trajectories,
            TELEOPERATION: self.teleoperation,
            CONTROL: self.control,
        }
        for title, panel in panels.items():
            window.add_panel(title, panel, beside=beside, tabbed=True)
        window.dock(beside).raise_()

    def shut_down(self) -> None:
        """Let go of the input device."""
        self.teleoperation.shut_down()
