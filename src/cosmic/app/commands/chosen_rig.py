"""`chosen_rig`: the platform that a command line names, closed in order whatever ends it."""

import argparse
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from typing import Final, TypeVar

from cosmic.app.connect import connect
from cosmic.app.rig import Rig
from cosmic.app.stations.address import endpoints_of
from cosmic.autonomy.procedures.run import ProcedureRun
from cosmic.frame.errors import ConfigError, DeviceTimeout
from cosmic.frame.interruption import held_back

W = TypeVar("W")

LOOK_S: Final = 1.0
"""Windows tells of Ctrl+C only between two waits."""


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

    What is given besides comes before what the command line says. Start and close are done whole:
    a signal that ends the program is heard after them.

    Raises
    ------
    CosmicError
        As `cosmic.connect`; nothing has moved.
    Interrupted
        There was such a signal; the platform is closed.
    """
    if chosen.certificates is not None and not chosen.connect:
        raise ConfigError(
            f"--certificates {chosen.certificates}: proves who this program is to stations that "
            "--connect names; name one, or leave it out"
        )
    asked = chosen.rate if rate is None else rate
    at_end = ExitStack()
    try:
        with held_back():
            rig = at_end.enter_context(
                connect(
                    chosen.config,
                    rate=1.0 if asked is None else asked,
                    cold=chosen.cold,
                    seed=seed,
                    sample=sample or chosen.sample,
                    truth=chosen.truth,
                    world=world or chosen.world,
                    stations=endpoints_of(chosen),
                    certificates=chosen.certificates,
                )
            )
        if chosen.connect:
            rig.take_control()
        yield rig
    finally:
        with held_back():
            at_end.close()


def carry_out(run: ProcedureRun[W]) -> None:
    """Carry out a procedure to its end; a signal that ends the program aborts it in order.

    Raises
    ------
    OperationFailed, ProcedureAborted
        How it ended.
    Interrupted
        There was such a signal; nothing of it moves any more.
    """
    with held_back(lambda name: run.abort(f"ended by {name}")):
        run.start()
        while not run.over:
            with suppress(DeviceTimeout):
                run.wait(LOOK_S)
        run.wait()
