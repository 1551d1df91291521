"""Applications by name: MiCo, DAQCo, ViCo, and those of other packages beside them.

A package announces one under ``[project.entry-points."cosmic.applications"]``; the platform file
names it among the `applications` of ``[platform]`` and gives its settings under
``[application.NAME]``.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from cosmic.app.configuration.platform_file import PlatformFile
from cosmic.app.simulation import SimulationFaults
from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.api.daqco import Daqco, daqco_of
from cosmic.frame.application import CosmicApplicationBase, GuiFactory
from cosmic.frame.clock import Clock
from cosmic.frame.errors import NotAvailable
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.plugins import Backend
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.mico import Mico, mico_of
from cosmic.twin.scene import Scene
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.vico import Vico, vico_of


@dataclass(frozen=True)
class Site:
    """What the applications of one process share while they are built."""

    file: PlatformFile
    path: Path
    clock: Clock
    policy: FailurePolicy
    scene: Scene | None
    seed: int


@dataclass(frozen=True)
class ApplicationContext:
    """What a platform gives to an application.

    Attributes
    ----------
    name : str
        What the platform file calls it.
    site : Site
        The platform file and its path, the platform's clock, and the policy that failures go to.
    faults : SimulationFaults
        Where simulated parts are joined, so that faults can be injected into them.
    gui_factory : callable or None
        Makes the widget of one of CoSMic's own; None where there is no window.
    window : bool
        There is a window: an application of another package makes its widget in `get_gui`.
    hosted : mapping of str to CosmicApplicationBase
        What was made before: CoSMic's own come first.
    """

    name: str
    site: Site
    faults: SimulationFaults
    gui_factory: GuiFactory | None = None
    window: bool = False
    hosted: Mapping[str, CosmicApplicationBase] = field(default_factory=dict)

    @property
    def mico(self) -> Mico:
        """The axes, as a script has them; raises `NotAvailable` where they are not hosted here."""
        found = self.hosted.get("mico")
        if not isinstance(found, MicoApplication):
            raise NotAvailable(f"{self.name} needs mico, which is not hosted here")
        return mico_of(found, self.name)

    @property
    def daqco(self) -> Daqco:
        """Data acquisition; raises `NotAvailable` where it is not hosted here."""
        found = self.hosted.get("daqco")
        if not isinstance(found, DaqcoApplication):
            raise NotAvailable(f"{self.name} needs daqco, which is not hosted here")
        return daqco_of(found)

    @property
    def vico(self) -> Vico:
        """Cameras; raises `NotAvailable` where they are not hosted here."""
        found = self.hosted.get("vico")
        if not isinstance(found, VicoApplication):
            raise NotAvailable(f"{self.name} needs vico, which is not hosted here")
        return vico_of(found)


ApplicationBackend = Backend[ApplicationContext, CosmicApplicationBase]
"""What an entry point of the group ``cosmic.applications`` leads to.

Made in the main thread, with nothing opened: that is `CosmicApplicationBase.initialize`, which is
called in the order in which applications are named, and in a window's thread where there is one, so
that it returns soon. `shut_down` is called in the opposite order, before CoSMic's own.
"""
