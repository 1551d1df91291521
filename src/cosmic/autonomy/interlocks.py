"""Interlocks between subsystems: what one sees stops the other (D7, thesis 5.2)."""

from cosmic.daqco.api.application import DaqcoApplication
from cosmic.mico.api.application import MicoApplication


def join_force_limits(daqco: DaqcoApplication, mico: MicoApplication) -> None:
    """Have a limit of DAQCo that is crossed stop every actuator of MiCo, and keep it stopped.

    The stop is called in the acquisition thread, past every queue. Where MiCo is not hosted in
    this process, limits are watched and told, and stop nothing.
    """
    daqco.guard.trip = mico.manager.stop
