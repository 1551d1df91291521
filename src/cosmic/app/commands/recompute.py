"""``cosmic recompute``: the values of a campaign from its raw files alone, and what changed."""

import argparse
import sys
import tomllib
from pathlib import Path
from typing import Final

from cosmic.app.panels.campaign.output import gui_application, write_output
from cosmic.autonomy.campaign.analysis import (
    Analysis,
    Comparison,
    altered_files,
    analyse,
    compare,
    finish,
    settings_in,
)
from cosmic.autonomy.campaign.formatting import scale_words
from cosmic.autonomy.campaign.provenance import record_file
from cosmic.autonomy.campaign.recipe import RecipeFile, load_recipe
from cosmic.autonomy.campaign.records import CampaignError
from cosmic.autonomy.campaign.store import CampaignStore, is_written
from cosmic.autonomy.campaign.store_read import CampaignReader

CHANGED: Final = 3
ALTERED: Final = 4
MOST_LINES: Final = 40


def run(chosen: argparse.Namespace) -> int:
    """Analyse a campaign anew and return the exit code: 3 where a number differs.

    It is 4 where only images or the files that it was made with are not as they were written.

    Raises
    ------
    CosmicError
        The folder holds no campaign, a raw file is missing or was changed.
    """
    reader = CampaignReader(chosen.folder)
    reader.check()
    settings = None
    if chosen.recipe is not None:
        recipe = load_recipe(chosen.recipe)
        settings = settings_in(recipe.text, str(recipe.path))
    altered = altered_files(reader)
    analysis = analyse(reader, settings)
    found = compare(reader, analysis)
    lines = [
        *lines_of(found, analysis),
        *(f"not as it was written: {each}" for each in altered),
        *notes_of(reader),
    ]
    sys.stdout.write("\n".join(lines) + "\n")
    if chosen.apply:
        _apply(chosen.folder, analysis)
    if not found.same:
        return CHANGED
    return ALTERED if altered else 0


def _apply(folder: Path, analysis: Analysis) -> None:
    application = gui_application()  # noqa: F841 - Qt forgets one that nobody holds
    store = CampaignStore.open(folder, run=False)
    try:
        if finish(store, analysis.settings) is None:
            raise CampaignError(f"{folder}: nothing was measured there")
    finally:
        store.close()
    wanted = RecipeFile.model_validate(tomllib.loads(store.reader.info().recipe_text)).output
    for path in write_output(folder, wanted):
        sys.stdout.write(f"{path}\n")


def notes_of(reader: CampaignReader) -> list[str]:
    """Return what else whoever reads the numbers should know."""
    notes = [
        f"{file.relative_to(reader.folder).as_posix()}: is not there, as of campaigns by a program "
        "that kept no records; it is unknown what the run was made with"
        for run in reader.unrecorded_runs()
        if not (file := record_file(reader.folder, run)).exists()
    ]
    if is_written(reader.folder):
        notes.append("the campaign is running: these are its values of now")
    elif not reader.analysis():
        notes.append(
            "the campaign did not come to its end: what its record says of each fibre was fitted "
            "with the fibres before it alone; --apply keeps these values"
        )
    return notes


def lines_of(found: Comparison, analysis: Analysis) -> list[str]:
    """Return what is said of an analysis beside the record."""
    lines = [f"{found.compared} values computed from raw files: {len(found.changed)} changed"]
    for each in found.changed[:MOST_LINES]:
        trust = ""
        if each.trusted_before != each.trusted_now:
            trust = ", trusted now" if each.trusted_now else ", no longer trusted"
        lines.append(
            f"  fibre {each.number}: {each.before_n_m2:.6g} -> {each.now_n_m2:.6g} N m2 "
            f"({each.percent:+.3f} %), ±{each.half_before_percent:.2f} -> "
            f"±{each.half_now_percent:.2f} %{trust}"
        )
    if len(found.changed) > MOST_LINES:
        lines.append(f"  and {len(found.changed) - MOST_LINES} more")
    if found.missing:
        numbers = ", ".join(map(str, found.missing))
        lines.append(f"  in the record, and not in the raw files: fibre {numbers}")
    if found.standards_left_out:
        lines.append(
            f"  {found.standards_left_out} measurements of the standard are not used: "
            "these settings name none"
        )
    lines += [f"  otherwise in the record: {each}" for each in found.differences]
    lines += [f"another version: {each}" for each in found.versions]
    lines.append(f"scale of the force: {scale_words(analysis.scale)}")
    return lines
