"""``cosmic blind-trial``: measure what nobody knows, freeze the analysis, and only then look."""

import argparse
import hashlib
import json
import secrets
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import IO, Final

from cosmic.app.blind_trial import (
    Measured,
    TrialError,
    TrialResult,
    TrialRow,
    digest_of,
    run_session,
    sealed_program,
    table_of,
)
from cosmic.autonomy.campaign.analysis import analyse, scale_in
from cosmic.autonomy.campaign.opening import read_recipe
from cosmic.autonomy.campaign.records import STANDARD, CampaignError, FibreRecord
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.frame.platform_services import own_session
from cosmic.twin.truth import TruthRecord, read_truth

FROZEN: Final = "frozen.json"
SEALED: Final = "sealed"
SEED_BITS: Final = 48
FIBRES: Final = 16
"""Of a session, where no other number is wanted."""


def run(chosen: argparse.Namespace) -> int:
    """Carry out a blind trial, print its table and return the exit code.

    That of a whole campaign is the one with which it ended.

    Raises
    ------
    CosmicError
        A session does not answer, its seal is broken, the folder holds something already, or an
        option does not belong to this kind of trial.
    """
    _check_options(chosen)
    if chosen.whole is not None:
        results = [whole(chosen.whole, chosen.out, chosen.world)]
    else:
        program = chosen.sealed_by or sealed_program()
        results = [
            run_session(chosen.world, chosen.fibres or FIBRES, program=program, publish=_say)
            for _ in range(chosen.sessions or 1)
        ]
    sys.stdout.write("\n".join(table_of(results)) + "\n")
    return max(each.exit_code for each in results)


def _check_options(chosen: argparse.Namespace) -> None:
    """Refuse an option that the kind of trial does not look at."""
    if chosen.whole is None:
        wrong, kind = {"--out": chosen.out}, "a trial of sessions writes no folder; add --whole"
    else:
        wrong = {
            "--fibres": chosen.fibres,
            "--sessions": chosen.sessions,
            "--sealed-by": chosen.sealed_by,
        }
        kind = "a whole trial is one campaign, and its recipe says of how many fibres"
    given = [name for name, value in wrong.items() if value is not None]
    if given:
        raise TrialError(f"{', '.join(given)} would have no effect: {kind}")


def whole(recipe: Path, folder: Path | None, world: str) -> TrialResult:
    """Run a campaign on a twin of a secret seed, freeze its values, and open the truth.

    Raises
    ------
    ConfigError
        The recipe is none.
    TrialError
        No folder is named, it is not empty, or the campaign came to nothing.
    """
    read_recipe(recipe)  # or it is said here what is wrong with it, and not in the sealed folder
    if folder is None or (folder.exists() and any(folder.iterdir())):
        raise TrialError("a whole trial needs --out with a folder that is empty, or is not there")
    seed = secrets.randbits(SEED_BITS)
    nonce = secrets.token_hex(16)
    seal = hashlib.sha256(f"{seed} {nonce}".encode()).hexdigest()
    (folder / SEALED).mkdir(parents=True)
    _say(f"sealed: {seal}")
    campaign, truth = folder / "campaign", folder / SEALED / "truth.jsonl"
    command = [sys.executable, "-m", "cosmic", "campaign", str(recipe), "--out", str(campaign)]
    command += ["--seed", str(seed), "--world", world, "--truth", str(truth)]
    said = folder / SEALED / "output.txt"  # it names the seed
    with said.open("wb") as output:
        code = _run_to_its_end(command, output)
    reader = CampaignReader(campaign)
    try:
        reader.check()
    except CampaignError as exc:
        raise TrialError(f"the campaign did not begin; {said} says why: {exc}") from exc
    analysis = analyse(reader)
    final = [
        Measured.of(number, result)
        for number, result in analysis.results.items()
        if number not in {each.number for each in reader.fibres(STANDARD)}
    ]
    frozen = digest_of(final)
    page = {"seal": seal, "analysis": frozen, "measured": [asdict(each) for each in final]}
    (folder / FROZEN).write_text(json.dumps(page), "utf-8")
    _say(f"frozen: {frozen}")
    opened = {"seed": seed, "nonce": nonce}
    (folder / SEALED / "secret.json").write_text(json.dumps(opened), "utf-8")
    known, records = read_truth(truth), {each.number: each for each in reader.finished()}
    rows = tuple(
        TrialRow(each, true)
        for each in final
        if (true := true_of(known, records[each.number])) is not None
    )
    scale = scale_in(reader.analysis())
    words = "verified" if scale is not None and scale.verified else "not verified"
    if code:
        sys.stderr.write(f"the campaign ended with exit code {code}: {said} says why\n")
    return TrialResult(seal, frozen, rows, words, code)


def _say(line: str) -> None:
    """Print a line at once: whoever reads along has it before what follows."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _run_to_its_end(command: list[str], output: IO[bytes]) -> int:
    """Run a program and return its exit code; it ends in order where this one is interrupted."""
    with subprocess.Popen(command, stdout=output, stderr=output, **own_session()) as process:
        try:
            return process.wait()
        except BaseException:
            process.terminate()  # and it is waited for
            raise


def true_of(truth: TruthRecord, record: FibreRecord) -> float | None:
    """Return what is true of the longest span of a fibre; None: it was not pushed."""
    pushed = [
        each.facts
        for each in truth.of("touched")
        if record.began_s <= each.time_s <= record.ended_s and "ei_n_m2" in each.facts
    ]
    longest = max(pushed, key=lambda each: float(each["abscissa_um"]), default=None)
    return None if longest is None else float(longest["ei_n_m2"])
