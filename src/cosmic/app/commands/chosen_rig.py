"""`chosen_rig`: the platform that a command line names."""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager

from cosmic.app.connect import connect
from cosmic.app.rig import Rig
from cosmic.app.stations.address import endpoints_of


@contextmanager
def chosen_rig(
    chosen: argparse.Namespace,
    *,
    rate: float | None = None,
    seed: int = 0,
    sample: str | None = None,
    world: str | None = None,
) -> Iterator[Rig]:
    """Start the platform, take control of stations where that is asked for, and close it.

    What is given besides comes before what the command line says.

    Raises
    ------
    CosmicError
        As `cosmic.connect`; nothing has moved.
    """
    asked = chosen.rate if rate is None else rate
    with connect(
        chosen.config,
        rate=1.0 if asked is None else asked,
        cold=chosen.cold,
        seed=seed,
        sample=sample or chosen.sample,
        truth=chosen.truth,
        world=world or chosen.world,
        stations=endpoints_of(chosen),
        certificates=chosen.certificates,
    ) as rig:
        if chosen.connect:
            rig.take_control()
        yield rig
