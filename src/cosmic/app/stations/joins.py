"""Joins what one application does to another, in this process or over a line."""

from pathlib import Path
from typing import Final

from cosmic.app.applications import Site
from cosmic.app.stations.hosting import Hosted
from cosmic.app.stations.remote_applications import RemoteApplications
from cosmic.app.stations.remote_station import RemoteStation
from cosmic.autonomy.coordinate_transform import join_transform
from cosmic.autonomy.couplings import join_teleoperation
from cosmic.autonomy.interlocks import (
    join_exposures,
    join_force_cautions,
    join_force_limits,
    join_lens,
    join_outputs,
    join_positions,
    join_stage_positions,
)
from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.api.daqco import Daqco, daqco_of
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.application import RemoteApplication
from cosmic.frame.version import __version__
from cosmic.mico.api.application_base import MicoApplicationBase
from cosmic.mico.api.mico import Mico, mico_of
from cosmic.mico.core.motion.stop_latch import StopState
from cosmic.vico.api.application import VicoApplication

SOURCE: Final = "interlock"
"""Who stops, for the log."""


def join_here(own: Hosted, site: Site) -> None:
    """Join the applications of this process to each other."""
    mico, daqco, vico = own.mico, own.daqco, own.vico
    if daqco is not None and mico is not None:
        api = mico_of(mico, SOURCE)
        join_force_limits(daqco, mico)
        join_outputs(daqco, api)
        join_force_cautions(daqco, mico)
        join_teleoperation(api, daqco)
        join_positions(daqco.recorder, api, site.clock)
    if vico is not None and mico is not None:
        join_vision(vico, mico, site.path)
    if vico is not None and daqco is not None:
        join_exposures(vico, daqco)


def join_vision(vico: VicoApplication, mico: MicoApplicationBase, path: Path) -> None:
    """Join the cameras of this process to the axes, here or at a station.

    Parameters
    ----------
    path : Path
        The platform file, beside which calibrations are kept.
    """
    api = mico_of(mico, SOURCE)
    join_stage_positions(vico, api)
    join_lens(vico, api)
    kept_in = vico.settings.calibration
    folder = path.parent / kept_in if kept_in else None
    join_transform(vico, mico, folder, __version__)


def join_stations(
    mico: MicoApplicationBase | None,
    daqco: DaqcoApplication | RemoteApplication[Daqco] | None,
    remote: RemoteApplications,
    policy: FailurePolicy,
) -> None:
    """Have a force limit stop motion where the two are in different processes.

    What belongs to one station is joined there. A limit whose station fell silent counts as
    crossed. This holds while this process runs and no longer.
    """
    there, boards_at = remote.host_of.get("mico"), remote.host_of.get("daqco")
    if mico is None or daqco is None or there is boards_at:
        return
    api = mico_of(mico, SOURCE)
    if isinstance(daqco, DaqcoApplication):
        join_outputs(daqco, api)
    elif boards_at is not None:
        _stop_outputs_there(api, daqco_of(daqco), boards_at, policy)
    guard = daqco_of(daqco).guard
    if there is None:
        guard.trip = api.stop
        return

    def trip(reason: str) -> None:
        # Aside, for the thread that acquires must not wait for a line.
        there.later(
            lambda: api.stop(reason),
            lambda exc: policy.report(exc, f"stop at {there.name} ({reason})"),
        )

    guard.trip = trip


def _stop_outputs_there(
    mico: Mico, daqco: Daqco, station: RemoteStation, policy: FailurePolicy
) -> None:
    """Have a stop of MiCo stop outputs at another station; a reset there is given there."""

    def follow(state: StopState) -> None:
        reason = state.reason
        if reason is not None and daqco.outputs:
            station.later(
                lambda: daqco.stop_outputs(reason),
                lambda exc: policy.report(exc, f"stop of outputs at {station.name} ({reason})"),
            )

    mico.follow_stop(follow)
