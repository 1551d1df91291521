"""``cosmic calibrate-force``: the scale of a force channel, against weights or a reference beam."""

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import Final, TextIO

from cosmic.app.commands.chosen_rig import carry_out, chosen_rig
from cosmic.app.rig import Rig
from cosmic.autonomy.bending.fit import assess_campaign, in_time, measure_fibre
from cosmic.autonomy.bending.standards import ForceScale
from cosmic.autonomy.calibrating.force_scale import (
    CalibrationProblem,
    ForceCalibration,
    ForceScaleResult,
    RestingForce,
    reach_of,
    weight,
)
from cosmic.autonomy.campaign.formatting import scale_words
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.force import ForceWatch
from cosmic.autonomy.handling.force_limit import armed_beyond_parking
from cosmic.autonomy.handling.push import certificate_of
from cosmic.autonomy.handling.settings import HandlingSettings, StandardSettings
from cosmic.autonomy.shipped.bend_test import build_standard
from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.core.scale import Scale
from cosmic.frame.clock import WALL
from cosmic.frame.errors import ConfigError
from cosmic.frame.kept_file import write_whole

LONGEST_WALL_S: Final = 30.0
"""How long a reading may take."""

ROUNDS, BENDS = 2, 3
NOT_VERIFIED: Final = 1
Ask = Callable[[str], bool]
"""`ask(text)` shows what is to be done and waits; False: the person ends it."""


def run(chosen: argparse.Namespace) -> int:
    """Lead through a calibration and return the exit code.

    Raises
    ------
    CosmicError
        There is no such channel, a load is none, or the readings cannot be used.
    """
    if chosen.beam is not None:
        if chosen.out is not None:
            raise ConfigError(f"--out {chosen.out}: only readings of --weights are written")
        with chosen_rig(chosen) as rig:
            return by_beam(rig, chosen.beam, chosen.expanded_percent, chosen.rounds or BENDS)
    loads = [weight(each, chosen.expanded_percent) for each in chosen.weights]
    if chosen.out is not None and (chosen.out.is_dir() or not chosen.out.parent.is_dir()):
        raise ConfigError(f"--out {chosen.out}: name a file in a folder that there is")
    with chosen_rig(chosen) as rig:
        before = rig.daqco.scales[checked_channel(rig.daqco, chosen.channel)]
        reach = reach_of(rig.daqco, chosen.channel)
        calibration = ForceCalibration(loads, chosen.rounds or ROUNDS, reach)
        found = lead(calibration, rig.daqco, chosen.channel, _ask(sys.stdin, sys.stdout))
        if found is None:
            sys.stderr.write("ended; nothing was changed\n")
            return NOT_VERIFIED
        if rig.daqco.scales.get(chosen.channel) != before:
            raise CalibrationProblem(
                f"the scale of {chosen.channel} was changed while weights were read: the readings "
                "do not fit together. Begin anew"
            )
        for line in lines_of(found, before):
            sys.stdout.write(f"{line}\n")
        if chosen.out is not None:
            write_certificate(chosen.out, found, chosen.channel, before)
            sys.stdout.write(f"{chosen.out}\n")
        return 0


def checked_channel(daqco: Daqco, channel: str) -> str:
    """Return the name of a channel that there is."""
    ForceWatch(daqco, channel, WALL)  # raises with the names that there are
    return channel


def _ask(given: TextIO, shown: TextIO) -> Ask:
    def ask(text: str) -> bool:
        shown.write(f"{text} Then press Enter (q ends): ")
        shown.flush()
        line = given.readline()
        return bool(line) and line.strip().lower() != "q"

    return ask


def lead(
    calibration: ForceCalibration, daqco: Daqco, channel: str, ask: Ask
) -> ForceScaleResult | None:
    """Ask for one load after the other and read the channel; None where the person ends it.

    Raises
    ------
    CalibrationProblem
        The channel cannot be read, or the result not be used.
    """
    watch = ForceWatch(daqco, channel, WALL)
    watch.open()
    problem = ""
    try:
        while not calibration.done:
            count = f"{len(calibration.readings) + 1} of {calibration.count}"
            if not ask(f"{problem}{count}: {calibration.instruction}"):
                return None
            try:
                calibration.take(*read(daqco, watch))
                problem = f"{calibration.readings[-1].read_un:+.3f} µN. "
            except CalibrationProblem as exc:
                problem = f"{exc}. "
    finally:
        watch.close()
    return calibration.result()


def read(daqco: Daqco, watch: ForceWatch) -> tuple[float, float]:
    """Return mean and standard deviation of the mean of a channel at rest.

    Raises
    ------
    CalibrationProblem
        No samples come.
    """
    chunk = daqco.latest_chunk
    if chunk is None:
        raise CalibrationProblem(f"nothing is acquired: {watch.problem}")
    resting, until_s = RestingForce(watch, chunk.end_time_s), WALL.now_s() + LONGEST_WALL_S
    while (taken := resting.taken()) is None:
        if WALL.now_s() > until_s:
            raise CalibrationProblem(f"no samples come: {watch.problem}")
        watch.wait_for_chunk(0.2)
    return taken


def lines_of(found: ForceScaleResult, before: Scale) -> list[str]:
    """Return the result, and what to write into platform file and recipe."""
    after = found.applied_to(before)
    numbers = ", ".join(f"{each:.6g}" for each in after.coefficients)
    return [
        found.words,
        "",
        f"Platform file, scale {before.name!r}: coefficients = [{numbers}]",
        "Recipe:",
        "[sensor]",
        f'calibrated = "{datetime.now().astimezone():%Y-%m-%d}"',
        "[parameters.push.fit]",
        f"gain_std_part = {found.gain_std_part:.4f}",
    ]


def write_certificate(path: Path, found: ForceScaleResult, channel: str, before: Scale) -> None:
    """Write all readings and what follows from them as JSON."""
    page = {
        "made": datetime.now().astimezone().isoformat(timespec="seconds"),
        "channel": channel,
        "scale_before": asdict(before),
        "scale": asdict(found.applied_to(before)),
        "result": asdict(found),
    }
    write_whole(path, json.dumps(page, indent=1, ensure_ascii=False))


def by_beam(rig: Rig, ei_n_m2: float, expanded_percent: float, times: int) -> int:
    """Bend the reference beam on the plate some times, and say what it makes of the scale."""
    standard = StandardSettings(ei_n_m2=ei_n_m2, expanded_percent=expanded_percent)
    settings = HandlingSettings(standard=standard)
    scale = bent(rig, settings, times)
    sys.stdout.write(f"{scale_words(scale)}\n")
    for number, each in enumerate(scale.standards, 1):
        off = f"{each.off_percent:+.2f} ± {200.0 * each.off_std_part:.2f} %"
        sys.stdout.write(f"  {number}: {each.refused or off}\n")
    return 0 if scale.verified else NOT_VERIFIED


def bent(rig: Rig, settings: HandlingSettings, times: int) -> ForceScale:
    """Return the scale of the force by the beam on the plate, bent some times.

    Raises
    ------
    CosmicError
        It is not found, or cannot be taken or bent.
    """
    work = HandlingContext.on(rig, settings)
    try:
        with armed_beyond_parking(work):
            for _ in range(times):
                carry_out(rig.procedure(build_standard(settings), work))
    finally:
        work.close()
    fit = settings.push.fit.model_copy(update={"fibre_width_um": settings.standard.width_um})
    done = [each for each in work.shared.finished if each.standard and each.spans]
    certificate = certificate_of(settings.standard)
    measured = [measure_fibre(each.spans, settings=fit, certificate=certificate) for each in done]
    standards = in_time(measured, [each.found_s for each in done])
    return assess_campaign([], standards=standards, settings=settings.push.fit).scale
