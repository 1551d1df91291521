"""The panel of campaigns in the operator window, and what joins it to the scene."""

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Final

from PySide6.QtCore import QObject, QStandardPaths, QTimer, Signal

from cosmic.app.panels.scene import ScenePanel
from cosmic.app.platform import Platform
from cosmic.app.rig import Rig
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.gui.late_panel import LatePanel
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.server_gui import CosmicServerGui
from cosmic.frame.job_queue import JobQueue
from cosmic.frame.operation import Operation

if TYPE_CHECKING:
    from cosmic.app.panels.campaign.panel import CampaignPanel
    from cosmic.autonomy.campaign.campaign import Campaign
    from cosmic.autonomy.campaign.records import FibreRecord

CAMPAIGN: Final = "Campaign"
PANEL: Final = "cosmic.app.panels.campaign.panel"
LOAD_AFTER_MS: Final = 5000
"""The window is usable by then; the panel opens at once afterwards."""


class CampaignDock(QObject):
    """Hosts the panel beside another one; GUI thread.

    The panel is made when it is first seen or asked for: statistics take a second to load.

    Parameters
    ----------
    rig : Rig
        Where campaigns run.
    scene : ScenePanel
        Where fibres are replayed.
    policy : FailurePolicy
        Told of defects.
    beside : str
        Title of the panel whose place it shares.

    Signals
    -------
    replayed()
        The scene shows movements of before from now on.
    opened()
        A campaign is about to begin, or to go on.
    """

    replayed = Signal()
    opened = Signal()

    def __init__(
        self,
        window: CosmicServerGui,
        rig: Rig,
        scene: ScenePanel,
        policy: FailurePolicy,
        beside: str,
    ) -> None:
        super().__init__(window)
        self._rig = rig
        self._scene = scene
        self._policy = policy
        self._late: LatePanel[CampaignPanel] = LatePanel(self._made)
        window.add_panel(CAMPAIGN, self._late, scroll=False, beside=beside, tabbed=True)
        self._loading: JobQueue | None = None
        self._loaded = Relay(self._on_loaded)
        self._load_later = QTimer(self, interval=LOAD_AFTER_MS, singleShot=True)
        self._load_later.timeout.connect(self._load)
        self._load_later.start()

    @property
    def panel(self) -> "CampaignPanel":
        """The panel, made now if need be."""
        return self._late.panel

    def _made(self) -> "CampaignPanel":
        from cosmic.app.panels.campaign.panel import CampaignPanel
        from cosmic.app.panels.scene_replay import SceneReplay

        panel = CampaignPanel(self._rig.campaign, campaigns_folder(), self._policy)
        self._replay = SceneReplay(self._scene, self)
        panel.replay_requested.connect(self._on_replay)
        panel.opened.connect(self.opened)
        return panel

    @property
    def _campaign(self) -> "Campaign | None":
        """The campaign begun here last."""
        panel = self._late.made
        return None if panel is None else panel.campaign

    @property
    def home(self) -> Path:
        """Where the campaign begun here last lies; before one, where they are made."""
        campaign = self._campaign
        return campaigns_folder() if campaign is None else campaign.store.folder.parent

    @property
    def running(self) -> bool:
        """True while a campaign that was begun here is running."""
        campaign = self._campaign
        return campaign is not None and not campaign.over

    @property
    def paused(self) -> bool:
        """True while that waits for Resume, which goes on with it."""
        campaign = self._campaign
        return campaign is not None and campaign.phase == "paused"

    @property
    def request(self) -> str:
        """What that waits for a person to do; "" for nothing."""
        campaign = self._campaign
        return "" if campaign is None or campaign.over else campaign.request

    @property
    def unfinished(self) -> bool:
        """True where the campaign begun here last ended early: it can be resumed."""
        campaign = self._campaign
        return campaign is not None and campaign.over and campaign.unfinished

    @property
    def finished(self) -> bool:
        """True where the campaign begun here last came to its end."""
        campaign = self._campaign
        return campaign is not None and campaign.over and not campaign.unfinished

    def resume(self) -> None:
        """Have the campaign that is paused, or ended early, go on."""
        self.panel.procedure.resume.click()

    def confirm_plate(self) -> None:
        """Say that the plate is there which the campaign asks for."""
        self.panel.confirm_plate()

    def show_report(self) -> None:
        """Write the report of the campaign, and open it."""
        self.panel.show_report()

    def _load(self) -> None:
        """Load statistics and all that the panel needs while nobody waits for it."""
        if PANEL in sys.modules:
            return
        self._loading = JobQueue("campaign panel", self._policy)
        self._loading.submit(lambda: import_module(PANEL), "the panel").add_callback(self._loaded)

    def _on_loaded(self, _loaded: Operation[ModuleType]) -> None:
        loading, self._loading = self._loading, None
        if loading is not None:
            loading.request_end()
            loading.join()

    def shut_down(self) -> None:
        """End what runs; what it did is kept."""
        self._load_later.stop()
        if self._loading is not None:
            self._loading.request_end()
            self._loading.join()
            self._loading = None
        if self._late.made is not None:
            self._replay.stop()
            self._late.made.shut_down()

    def _on_replay(self, record: "FibreRecord") -> None:
        self.replayed.emit()
        self._replay.start(record.series, f"fibre {record.number}")


def can_run(platform: Platform) -> bool:
    """Return whether all that a campaign needs is in use, with the cameras in this program."""
    return platform.mico is not None and platform.daqco is not None and "vico" in platform.own


def campaigns_folder() -> Path:
    """Return where folders of campaigns are made unless the operator says otherwise."""
    place = QStandardPaths.StandardLocation.DocumentsLocation
    return Path(QStandardPaths.writableLocation(place)) / "CoSMic" / "campaigns"
