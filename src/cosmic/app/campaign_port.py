"""A campaign as the panel of procedures shows and steers it."""

from collections.abc import Callable
from typing import Final

from typing_extensions import override

from cosmic.app.procedure_tree_port import ProcedurePort
from cosmic.autonomy.campaign.campaign import Campaign
from cosmic.autonomy.campaign.steering import CampaignPhase
from cosmic.autonomy.procedures.procedure import outline_of
from cosmic.autonomy.procedures.run_state import RunState
from cosmic.autonomy.procedures.tree import NodeView, TreeKeeper
from cosmic.frame.errors import CosmicError

_STATES: Final = {
    CampaignPhase.READY: RunState.READY,
    CampaignPhase.RUNNING: RunState.RUNNING,
    CampaignPhase.PAUSING: RunState.PAUSING,
    CampaignPhase.PAUSED: RunState.PAUSED,
    CampaignPhase.ENDING: RunState.ABORTING,
    CampaignPhase.ENDED: RunState.DONE,
    CampaignPhase.STOPPED: RunState.ABORTED,
    CampaignPhase.FAILED: RunState.FAILED,
}


class CampaignRun(ProcedurePort):
    """The tree is that of the fibre in hand; start, pause, step and abort are of the whole."""

    def __init__(self, campaign: Campaign) -> None:
        self.campaign = campaign
        root = campaign.procedure.root
        self._waiting = TreeKeeper(outline_of(root), campaign.work.clock).snapshot()

    @property
    @override
    def name(self) -> str:
        done = self.campaign.progress.done
        return f"{self.campaign.recipe.name}, fibre {done + 1}"

    @property
    @override
    def state(self) -> RunState:
        return _STATES[self.campaign.phase]

    @property
    @override
    def failure(self) -> Exception | None:
        campaign = self.campaign
        return CosmicError(campaign.end_reason) if campaign.unfinished else None

    @property
    @override
    def not_safe(self) -> str:
        run = self.campaign.run
        return run.not_safe if run is not None else ""

    @property
    @override
    def tree(self) -> NodeView:
        run = self.campaign.run
        return run.tree if run is not None else self._waiting

    @override
    def on_change(self, listener: Callable[[], object]) -> Callable[[], None]:
        return self.campaign.on_change(listener)

    @override
    def start(self) -> None:
        self.campaign.start()

    @override
    def pause(self) -> None:
        self.campaign.pause()

    @override
    def resume(self) -> None:
        self.campaign.resume()

    @override
    def step(self) -> None:
        if self.campaign.phase is CampaignPhase.READY:
            self.campaign.start()
            self.campaign.pause()
        else:
            self.campaign.step()

    @override
    def abort(self, reason: str = "aborted") -> None:
        self.campaign.abort(reason)

    @override
    def join(self) -> None:
        self.campaign.join()
