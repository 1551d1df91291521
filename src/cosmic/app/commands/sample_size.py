"""``cosmic sample-size``: how many good fibres make the mean stiffness as precise as wanted."""

import argparse
import math
import sys
from typing import Final

from scipy.special import chdtri  # scipy.stats takes a second to load

from cosmic.autonomy.campaign.statistics import MeanEi, fibres_needed, progress
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.frame.errors import ConfigError
from cosmic.frame.units import TWO_SIDED

USUAL: Final = (2.0, 5.0, 10.0, 20.0)


def run(chosen: argparse.Namespace) -> int:
    """Print the plan and return the exit code.

    Raises
    ------
    CosmicError
        The folder holds no campaign with two good fibres, or no spread is given.
    """
    mean, seen_part = _basis(chosen)
    for line in lines_of(mean, (chosen.precision,) if chosen.precision else USUAL, seen_part):
        sys.stdout.write(f"{line}\n")
    if chosen.spread is None:
        sys.stdout.write(f"{doubt_of(mean)}\n")
    return 0


def _basis(chosen: argparse.Namespace) -> tuple[MeanEi, float]:
    """Return a mean with spread and shared uncertainty, and good fibres of a fibre tried."""
    mean, part = MeanEi(0, math.nan, math.nan, math.nan, math.nan), math.nan
    if chosen.folder is not None:
        reader = CampaignReader(chosen.folder)
        reader.check()
        now = progress(reader.fibres(), reader.elapsed_s())
        mean, part = now.mean, now.good / now.done if now.done else math.nan
    spread, shared = mean.spread_ln, mean.common_std_ln
    if chosen.spread is not None:
        spread = chosen.spread
    if chosen.shared_percent is not None:
        shared = math.log1p(chosen.shared_percent / 100.0) / TWO_SIDED
    if not 0.0 < spread < 10.0:
        raise ConfigError(
            "the spread between fibres is unknown: name the folder of a campaign with two good "
            "fibres, or give --spread, the standard deviation of ln(EI), such as 0.56"
        )
    return MeanEi(max(mean.count, 2), mean.ei_n_m2, math.nan, math.nan, spread, shared), part


def doubt_of(mean: MeanEi) -> str:
    """Return how far the spread itself is known, by how many fibres it was found from."""
    free = mean.count - 1
    low, high = (
        mean.spread_ln * math.sqrt(free / float(chdtri(free, above))) for above in (0.025, 0.975)
    )
    return (
        f"the spread is that of {mean.count} fibres: it may be {low:.2f} to {high:.2f} (95 %), and "
        "the numbers of fibres with it; ask again when there are more"
    )


def lines_of(mean: MeanEi, wanted_percent: tuple[float, ...], good_part: float) -> list[str]:
    """Return what is said: how many fibres for each precision."""
    lines = [
        f"spread between fibres: sd of ln(EI) {mean.spread_ln:.2f}; "
        f"shared by all: ±{mean.shared_percent:.1f} %"
    ]
    for each in wanted_percent:
        needed = fibres_needed(mean, each)
        if math.isinf(needed):
            lines.append(f"±{each:g} % of the mean: no number of fibres, what is shared is wider")
            continue
        tried = f", about {needed / good_part:.0f} tried" if good_part > 0.0 else ""
        lines.append(f"±{each:g} % of the mean (95 %): {needed:.0f} good fibres{tried}")
    return lines
