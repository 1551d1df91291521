"""Interlocks between subsystems: what one sees stops the other (D7, thesis 5.2)."""

from collections.abc import Iterator
from typing import Final

from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.api.daqco import Daqco
from cosmic.daqco.api.recorder import Recorder
from cosmic.daqco.core.recording_format import AxisPosition
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import CosmicError
from cosmic.mico.api.application_base import MicoApplicationBase
from cosmic.vico.api.application import VicoApplication

_UN: Final = {"nN": 1e-3, "uN": 1.0, "µN": 1.0, "mN": 1e3, "N": 1e6}
"""How many micronewtons a unit of force is."""


def join_force_limits(daqco: DaqcoApplication, mico: MicoApplicationBase) -> None:
    """Have a limit of DAQCo that is crossed stop every actuator of MiCo, and keep it stopped.

    The stop is called in the acquisition thread, past every queue. Where MiCo is not hosted in
    this process, limits are watched and told, and stop nothing.
    """
    daqco.guard.trip = mico.manager.stop


def join_force_cautions(daqco: DaqcoApplication, mico: MicoApplicationBase) -> None:
    """Have undo and initialisation ask where a force is felt beyond ``[mico.undo] felt_un``.

    Only channels whose unit is one of force count.
    """
    board = Daqco(daqco)

    def doubt() -> str:
        least_un = mico.manager.settings.undo.felt_un
        try:
            values, units = board.latest(), board.units
        except CosmicError:
            return ""
        felt = {
            name: f"{value:.1f} {units[name]}"
            for name, value in values.items()
            if not abs(value) * _UN.get(units.get(name, ""), 0.0) <= least_un
        }
        return "; ".join(f"{name} feels {text}" for name, text in sorted(felt.items()))

    mico.cautions.add(doubt)


def join_positions(recorder: Recorder, mico: MicoApplicationBase, clock: Clock) -> None:
    """Have the positions of all axes written into every recording, on its clock.

    Positions are gate coordinates, at the moment they were read.
    """

    def positions() -> Iterator[AxisPosition]:
        now_s, now_wall_s = clock.now_s(), WALL.now_s()
        rate = clock.rate or 1.0
        for state in mico.manager.states().values():
            age_s = max(0.0, now_wall_s - state.read_wall_s) * rate if state.in_motion else 0.0
            yield AxisPosition(
                time_s=now_s - age_s,
                axis=state.name,
                position=float("nan") if state.position is None else state.position,
                unit=state.unit,
                confidence=str(state.confidence),
            )

    recorder.position_source = positions


def join_stage_positions(vico: VicoApplication, mico: MicoApplicationBase) -> None:
    """Have the positions of all axes stand beside every picture; gate coordinates."""

    def positions(_time_s: float) -> dict[str, float]:
        return {
            state.name: state.position
            for state in mico.manager.states().values()
            if state.position is not None
        }

    axes = {each.name: each.unit for each in mico.manager.settings.positioner}
    for unit in vico.units.values():
        unit.recordings.axes = axes
    vico.position_source = positions
