"""``cosmic campaign``: a recipe without a window, with a bar that says how far it is."""

import argparse
import logging
import math
import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Final, TextIO

from cosmic.app.commands.chosen_rig import chosen_rig
from cosmic.app.panels.campaign.output import gui_application, write_output
from cosmic.autonomy.campaign.campaign import Campaign, CampaignPhase
from cosmic.autonomy.campaign.opening import check_folder, read_recipe, recorded
from cosmic.autonomy.campaign.plates import confirmed
from cosmic.autonomy.campaign.recipe import Recipe
from cosmic.autonomy.campaign.records import TWIN
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError
from cosmic.frame.log import set_up_logging
from cosmic.frame.platform_services import ending_signals

logger = logging.getLogger(__name__)

LOG: Final = "cosmic.log"
_EVERY_S: Final = 0.5
_BAR: Final = 24
_INCOMPLETE: Final = 4
_CODES: Final = {CampaignPhase.ENDED: 0, CampaignPhase.FAILED: 1, CampaignPhase.STOPPED: 3}


def run(chosen: argparse.Namespace) -> int:
    """Run a campaign to its end, and return the exit code.

    Raises
    ------
    CosmicError
        The recipe, the configuration or the folder is wrong; nothing has moved.
    """
    recipe = read_recipe(chosen.recipe)
    check_folder(chosen.out)
    application = gui_application()  # noqa: F841 - Qt forgets one that nobody holds
    twin = recipe.file.twin
    rate = twin.rate if chosen.rate is None else chosen.rate
    # A campaign that is gone on with has the fibres of its own seed, in its own world.
    known = recorded(chosen.out)
    seed, world = chosen.seed, chosen.world
    if seed is None:
        seed = twin.seed if known is None else known.seed
    if world is None and known is not None and known.hardware == TWIN:
        world = known.world or None
    sample = chosen.sample or recipe.file.sample.name or None
    with (
        ExitStack() as at_end,
        chosen_rig(chosen, rate=rate, seed=seed, sample=sample, world=world) as rig,
    ):
        campaign = rig.campaign(recipe, chosen.out)
        at_end.callback(_log_to(chosen.out / LOG))  # after this is known to be its own folder
        if rig.simulated:
            sys.stderr.write(f"{recipe.name}: {TWIN}, seed {seed}, {rate:g} times\n")
        with ending_signals(lambda name: campaign.abort(f"ended by {name}")):
            campaign.start()
            Bar(campaign, recipe, sys.stderr).follow()
            campaign.join()
    for path in write_output(chosen.out, recipe.file.output):
        sys.stdout.write(f"{path}\n")
    code = _CODES[campaign.phase]
    if code == 0 and campaign.shortfall:
        code = _INCOMPLETE
    reason = "; ".join(filter(None, (campaign.end_reason, campaign.shortfall)))
    text = f"{recipe.name}: {reason}\n"
    (sys.stderr if code else sys.stdout).write(text)
    return code


def _log_to(file: Path) -> Callable[[], None]:
    """Keep the log in `file`; where that cannot be written the campaign goes on without."""
    try:
        return set_up_logging(file=file)
    except OSError as exc:
        logger.warning("%s: no log is kept: %s", file, exc)
        return lambda: None


class Bar:
    """One line that says how a campaign stands; lines of their own where that is no terminal."""

    def __init__(self, campaign: Campaign, recipe: Recipe, terminal: TextIO) -> None:
        self._campaign = campaign
        self._name = recipe.name
        self._terminal = terminal
        self._length = 0
        self._done = -1
        self._share = 0.0
        self._asked = ""

    def follow(self) -> None:
        """Write until the campaign is over."""
        while not self._campaign.over:
            self._write()
            self._ask()
            WALL.sleep(_EVERY_S)
        self._write()
        if self._terminal.isatty():
            self._terminal.write("\n")

    def _ask(self) -> None:
        """Say once what a person is asked for, and take it as done when `cosmic plate` says so."""
        request, asked = self._campaign.request, self._asked
        self._asked = request
        if not request:
            return
        folder = self._campaign.store.folder
        if request != asked:
            self._terminal.write(f"\n{request}: cosmic plate {folder}\n")
        if confirmed(folder):
            try:
                self._campaign.confirm_plate()
            except CosmicError as exc:
                self._terminal.write(f"\n{exc}\n")

    def _write(self) -> None:
        now = self._campaign.progress
        if self._terminal.isatty():
            line = self._line()
            self._terminal.write(f"\r{line.ljust(self._length)}")
            self._length = len(line)
        elif now.done != self._done:
            self._terminal.write(f"{self._line()}\n")
        self._done = now.done
        self._terminal.flush()

    def _line(self) -> str:
        now, left_s = self._campaign.progress, self._campaign.left_s
        whole_s = now.elapsed_s + left_s
        if whole_s > 0.0:  # else it stays as it was: nothing can be told
            self._share = now.elapsed_s / whole_s
        full = round(_BAR * self._share)
        parts = [f"{self._name} [{'#' * full}{'.' * (_BAR - full)}]"]
        parts.append(f"{now.done} fibres, {now.good} good, {now.failed} failed")
        if now.done:
            parts.append(f"{now.good_per_hour:.0f} good an hour")
        if plan := self._campaign.plan:
            parts.append(plan)
        if not math.isnan(left_s):
            parts.append(f"{left_s / 60.0:.0f} min left")
        parts.append(self._campaign.operation or str(self._campaign.phase))
        return ", ".join(parts)
