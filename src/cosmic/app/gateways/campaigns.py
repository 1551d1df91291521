"""`Campaigns`: campaigns as programs elsewhere start, watch and end them."""

import math
import re
from collections.abc import Callable
from contextvars import copy_context
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, Any, Final

from cosmic.frame.arguments import reason_of
from cosmic.frame.clock import WALL
from cosmic.frame.config import shipped_config_dir
from cosmic.frame.declaration import Declared, command, state
from cosmic.frame.errors import CosmicError, NotAvailable, OperationCancelled
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.errors import CallRefused
from cosmic.frame.operation import Task

if TYPE_CHECKING:
    from cosmic.autonomy.campaign.campaign import Campaign
    from cosmic.autonomy.campaign.records import FibreRecord

CAMPAIGNS: Final = "campaigns"
OPENING_S: Final = 60.0
REPORTED_EVERY_S: Final = 0.2
MOST_RESULTS: Final = 500
_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,79}")

OpenCampaign = Callable[[Path, Path], "Campaign"]
"""`open_campaign(recipe, folder)` returns a campaign that is ready to start: `Rig.campaign`."""


@dataclass(frozen=True, slots=True)
class CampaignFibre:
    """One fibre of a campaign; nan where something was not measured.

    Attributes
    ----------
    number : int
        Of the fibre in the campaign.
    outcome : str
        How its treatment ended, such as "good".
    cause : str
        Why it failed; empty otherwise.
    ei_n_m2, ei_low_n_m2, ei_high_n_m2 : float
        Stiffness, with its 95 % interval.
    """

    number: int
    outcome: str
    cause: str
    ei_n_m2: float
    ei_low_n_m2: float
    ei_high_n_m2: float
    length_um: float
    width_um: float
    duration_s: float
    attempts: int


class Campaigns(Declared):
    """The campaign of a station, one at a time; any thread. At last `close`.

    What a client starts moves by that client's right to move: it ends when the client loses that
    right, falls silent or is gone.

    Parameters
    ----------
    home : callable
        Returns the folder with the folders of campaigns, and with recipes of one's own.
    """

    def __init__(self, home: Callable[[], Path], policy: FailurePolicy) -> None:
        self._home = home
        self._policy = policy
        self._open: OpenCampaign | None = None
        self._lock = Lock()
        self._opening = False
        self._campaign: Campaign | None = None
        self._threads: list[Any] = []
        self._reported_s = -math.inf

    def use(self, open_campaign: OpenCampaign) -> None:
        """Open campaigns by `open_campaign` from now on."""
        self._open = open_campaign

    # State

    @property
    @state
    def name(self) -> str:
        """The recipe of the newest campaign; empty before the first."""
        return "" if self._campaign is None else self._campaign.recipe.name

    @property
    @state
    def folder(self) -> str:
        """Name of its folder."""
        return "" if self._campaign is None else self._campaign.store.folder.name

    @property
    @state
    def phase(self) -> str:
        """What it is at, such as "running"; "none" before the first."""
        return "none" if self._campaign is None else str(self._campaign.phase)

    @property
    @state
    def operation(self) -> str:
        """The operation that is carried out now, in words."""
        return "" if self._campaign is None else self._campaign.operation

    @property
    @state
    def request(self) -> str:
        """What a person is asked for, such as another plate; empty for nothing."""
        return "" if self._campaign is None else self._campaign.request

    @property
    @state
    def end_reason(self) -> str:
        """Why it ended; empty before."""
        return "" if self._campaign is None else self._campaign.end_reason

    @property
    @state
    def shortfall(self) -> str:
        """What is missing of what was asked for, though it has ended; empty: nothing."""
        return "" if self._campaign is None else self._campaign.shortfall

    @property
    @state
    def done(self) -> int:
        """How many fibres have their end."""
        return 0 if self._campaign is None else self._campaign.progress.done

    @property
    @state
    def good(self) -> int:
        """How many of them are good."""
        return 0 if self._campaign is None else self._campaign.progress.good

    @property
    @state
    def failed(self) -> int:
        """How many of them failed."""
        return 0 if self._campaign is None else self._campaign.progress.failed

    @property
    @state(quiet=True)
    def elapsed_s(self) -> float:
        """How long it has been carried out, on the platform's clock."""
        return 0.0 if self._campaign is None else self._campaign.progress.elapsed_s

    @property
    @state(quiet=True)
    def left_s(self) -> float:
        """Time until it ends, on the platform's clock; nan: it cannot be told."""
        return math.nan if self._campaign is None else self._campaign.left_s

    # Commands

    @command(reads=True)
    def recipes(self) -> tuple[str, ...]:
        """Return what can be started: recipes that ship, and those in the folder of campaigns."""
        return tuple(sorted(self._recipes()))

    @command(moves=True, timeout_s=OPENING_S)
    def start(self, recipe: str, folder: str) -> Task:
        """Begin a campaign by a recipe, or go on with the one in that folder.

        The task ends when the campaign does; what cancels the task ends the campaign.

        Parameters
        ----------
        recipe : str
            One of `recipes`.
        folder : str
            Name of its folder among those of campaigns here.

        Raises
        ------
        NotAvailable
            A campaign or an operation on a fibre is running, or an application is missing.
        ConfigError, CampaignError
            The recipe does not fit the platform, or the folder holds another campaign.
        """
        path, place = self._recipes().get(recipe), self._home() / _checked(folder)
        if path is None:
            raise CallRefused(
                f"there is no recipe {recipe[:60]!r}; there are {', '.join(self.recipes())}"
            )
        campaign = self._opened(path, place)
        from cosmic.autonomy.procedures.run import RunThread  # with all that procedures need

        task = Task(f"campaign {campaign.recipe.name}")
        task.on_cancel(partial(campaign.abort, "ended by who started it"))
        campaign.on_change(partial(self._report, campaign, task))
        # Its thread moves as the one that called: by its right, and no longer than that.
        carry_out = partial(copy_context().run, self._carry_out, campaign, task)
        thread = RunThread(carry_out, campaign.abort, campaign.recipe.name, self._policy)
        self._threads = [*(each for each in self._threads if not each.isFinished()), thread]
        thread.start()
        self.note_change()
        return task

    @command
    def pause(self) -> None:
        """Rest at the next safe point; harmless when it does not run."""
        self._present().pause()

    @command(moves=True)
    def resume(self) -> None:
        """Go on after a pause; harmless when it does not pause."""
        self._present().resume()

    @command(moves=True)
    def confirm_plate(self) -> None:
        """Say that the plate is on the table which `request` asks for.

        Raises
        ------
        NotAvailable
            None was asked for, or it cannot be there.
        """
        self._present().confirm_plate()

    @command(at_once=True)
    def abort(self, reason: str = "ended by a program") -> None:
        """End it now: what moves is cancelled, then it is made safe."""
        campaign = self._campaign
        if campaign is not None:
            campaign.abort(reason_of(reason)[:200])

    @command(reads=True)
    def results(self, first: int = 0) -> tuple[CampaignFibre, ...]:
        """Return up to 500 fibres of the newest campaign, from number `first` of the list on."""
        found = () if self._campaign is None else self._campaign.fibres
        begin = max(first, 0)
        return tuple(_row(each) for each in found[begin : begin + MOST_RESULTS])

    def close(self) -> None:
        """End what runs and wait for it; any state."""
        self._open = None
        self.abort("the station closes")
        for each in self._threads:
            each.join()

    # Its own work

    def _recipes(self) -> dict[str, Path]:
        shipped = (shipped_config_dir() / "recipes").glob("*.toml")
        own = self._home().glob("*.toml")
        return {each.stem: each for each in (*own, *shipped)}

    def _opened(self, recipe: Path, folder: Path) -> "Campaign":
        with self._lock:
            before, opened = self._campaign, self._open
            if self._opening or (before is not None and not before.over):
                raise NotAvailable("a campaign is running; end it first")
            if opened is None:
                raise NotAvailable("no campaign can be started here now")
            self._opening = True
        try:
            self._campaign = opened(recipe, folder)
        finally:
            self._opening = False
        return self._campaign

    def _present(self) -> "Campaign":
        if self._campaign is None:
            raise NotAvailable("no campaign was started here")
        return self._campaign

    def _report(self, campaign: "Campaign", task: Task) -> None:
        if campaign.over or WALL.now_s() - self._reported_s < REPORTED_EVERY_S:
            return
        self._reported_s = WALL.now_s()
        now, left_s = campaign.progress, campaign.left_s
        share = now.elapsed_s / max(now.elapsed_s + left_s, 1e-9) if left_s >= 0.0 else 0.0
        text = f"{now.done} fibres, {now.good} good, {campaign.operation or campaign.phase}"
        task.report(share, text)
        self.note_change()

    def _carry_out(self, campaign: "Campaign", task: Task) -> None:
        failure: CosmicError | None = OperationCancelled("a defect ended it; the log names it")
        try:
            campaign.run_here()
            failure = OperationCancelled(campaign.end_reason) if campaign.unfinished else None
        except CosmicError as exc:  # it was ended before it began
            failure = exc
        finally:
            if failure is None:
                task.finish()
            else:
                task.fail(failure)
            self.note_change()


def _checked(folder: str) -> str:
    if not _NAME.fullmatch(folder):
        raise CallRefused("folder: a name of letters, digits, and . _ - between them")
    return folder


def _row(record: "FibreRecord") -> CampaignFibre:
    found = record.bending
    return CampaignFibre(
        number=record.number,
        outcome=str(record.outcome),
        cause=record.cause,
        ei_n_m2=math.nan if found is None else found.ei_n_m2,
        ei_low_n_m2=math.nan if found is None else found.ei_low_n_m2,
        ei_high_n_m2=math.nan if found is None else found.ei_high_n_m2,
        length_um=record.shape.length_um,
        width_um=record.shape.width_um,
        duration_s=record.duration_s,
        attempts=record.attempts,
    )
