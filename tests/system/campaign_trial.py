"""One campaign, struck in its operations again and again, and what must hold every time."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from cosmic.autonomy.campaign.campaign import Campaign, CampaignPhase
from cosmic.autonomy.campaign.records import FibreRecord, Outcome
from cosmic.autonomy.campaign.storage_format import DATABASE
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.frame.clock import WALL
from system.campaign_bench import GRACE_WALL_S, Bench, Strike, wait_for

END_WALL_S: Final = 15.0
LETTING_GO: Final = {"release", "make ready", "clear up", "shake and wipe", "initialise again"}
"""Operations that open the jaws, or shake off what hangs on them."""

Provoke = Callable[[Bench, Campaign], object]


@dataclass(frozen=True)
class Way:
    """How a campaign is brought to an operation.

    Attributes
    ----------
    forget : tuple of str
        Calibrations to be made anew.
    provoke : callable
        Makes go wrong, before the campaign begins, what the operation comes after.
    more : str
        Of the recipe: what the operation needs in it.
    """

    forget: tuple[str, ...] = ()
    provoke: Provoke = lambda bench, campaign: None
    more: str = ""


class Trial:
    """One campaign in one folder, which is struck in one operation, or in one after the other."""

    def __init__(
        self, bench: Bench, procedure: str, operation: str, way: Way | None = None, *, good: int = 2
    ) -> None:
        self.bench = bench
        self.operation = operation
        self.way = way or Way()
        self.good = good
        self.recipe = bench.recipe(procedure, good=good, more=self.way.more)
        self.folder = self.recipe.stem

    def go_on_to(self, operation: str, way: Way) -> None:
        """Have the same campaign struck in another operation from now on."""
        assert way.more == self.way.more, "that is another recipe"
        self.operation, self.way = operation, way

    @property
    def reader(self) -> CampaignReader:
        return CampaignReader(self.bench.home / self.folder)

    def fibres(self) -> tuple[FibreRecord, ...]:
        begun = (self.bench.home / self.folder / DATABASE).exists()
        return self.reader.fibres() if begun else ()

    def struck(self, do: Callable[[Campaign], None], *, moving: bool) -> Campaign:
        """Go on with the campaign until the operation, and do something there."""
        bench = self.bench
        campaign = bench.campaign(self.recipe, self.folder, forget=self.way.forget)
        self.way.provoke(bench, campaign)
        strike = Strike(campaign, self.operation, lambda: None if moving else do(campaign))
        campaign.start()
        wait_for(lambda: strike.struck.is_set() or campaign.over, self.operation)
        if moving:
            until_s = WALL.now_s() + 0.1
            wait_for(lambda: bench.moving or WALL.now_s() > until_s, "something moves")
            do(campaign)
        bench.rig.faults.clear()
        assert strike.struck.is_set() or self.is_done(), (
            f"{self.operation!r} was never reached ({campaign.end_reason}): say in PROVOKED what "
            "it comes after"
        )
        return campaign

    def is_done(self) -> bool:
        return sum(each.outcome is Outcome.GOOD for each in self.fibres()) >= self.good

    def stop(self, *, moving: bool) -> None:
        """Press STOP in the operation, and see that the end is a safe one."""
        bench, before = self.bench, self.fibres()
        reason = f"a hand on the button in {self.operation}"
        campaign = self.struck(lambda _campaign: bench.rig.stop(reason), moving=moving)
        stopped_s = bench.scene.clock.now_s()
        end_s = WALL.now_s() + GRACE_WALL_S
        wait_for(lambda: WALL.now_s() > end_s, "the time of grace")
        places = bench.places()
        wait_for(lambda: campaign.over, f"the end after STOP in {self.operation}", END_WALL_S)
        campaign.join()
        still_s = WALL.now_s() + GRACE_WALL_S
        wait_for(lambda: WALL.now_s() > still_s, "the time to look")
        assert not bench.moving
        assert not bench.wandered(places), "something was commanded after the stop"
        assert not any(axis.details.in_motion for axis in bench.rig.mico)
        if not (self.is_done() and campaign.phase is CampaignPhase.ENDED):
            assert reason in campaign.end_reason
        self.check_kept(before, reason)
        self.check_jaws(stopped_s)
        bench.rig.reset_stop()

    def abort(self, *, moving: bool) -> None:
        """End the campaign in the operation, and see that it leaves things safe."""
        bench, before = self.bench, self.fibres()
        reason = f"enough, in {self.operation}"
        campaign = self.struck(lambda campaign: campaign.abort(reason), moving=moving)
        aborted_s = bench.scene.clock.now_s()
        wait_for(lambda: campaign.over, f"the end after an abort in {self.operation}", 60.0)
        campaign.join()
        assert not bench.moving
        self.check_kept(before, reason)
        self.check_jaws(aborted_s)
        if self.is_done():
            return
        assert campaign.end_reason == reason
        work = campaign.work
        assert campaign.run is not None
        assert campaign.run.not_safe == ""
        assert work.tip_now(work.probe)[1] >= work.settings.places.probe_away_y_um - 2.0
        assert work.height_now() >= work.settings.places.travel_um - 2.0

    def check_kept(self, before: tuple[FibreRecord, ...], reason: str) -> None:
        """See that store and journal can be read, and no fibre was lost, doubled or left open."""
        self.reader.check()
        after = self.fibres()
        assert [each.number for each in after[: len(before)]] == [each.number for each in before]
        assert [each.outcome for each in after[: len(before)]] == [e.outcome for e in before]
        assert not [each.number for each in after if each.outcome is Outcome.RUNNING]
        cut_off = [each for each in after[len(before) :] if each.outcome is Outcome.INTERRUPTED]
        assert len(cut_off) <= 1
        for each in cut_off:
            assert reason in each.text
        assert any(each.operation == self.operation for each in self.reader.journal())

    def check_jaws(self, since_s: float) -> None:
        """See that no fibre was let go that was held when somebody ended it."""
        if self.operation in LETTING_GO:
            return
        names = ("released", "dropped", "slipped", "broken")
        let_go = [each for name in names for each in self.bench.truth.of(name)]
        assert not [each for each in let_go if each.time_s > since_s]

    def finish(self) -> None:
        """Go on to the end, and see by the truth that no fibre counts twice."""
        bench = self.bench
        campaign = bench.campaign(self.recipe, self.folder)
        campaign.run_here()
        assert campaign.end_reason == f"{self.good} good fibres"
        truth = bench.truth
        found: list[int] = []
        for record in self.fibres():
            if record.outcome is Outcome.GOOD:
                grasped = {
                    each.facts["fibre"]
                    for each in truth.of("grasped")
                    if record.began_s <= each.time_s <= record.ended_s
                }
                assert len(grasped) == 1
                found += grasped
        assert len(set(found)) == len(found), "a fibre was measured twice"
        unmeant = [each for each in truth.of("contact over") if not each.facts["meant"]]
        assert not unmeant
        peaks = [float(each.facts.get("peak_un", 0.0)) for each in truth.of("left")]
        assert max(peaks, default=0.0) <= 144.0
