"""A platform as its files describe it: configuration in, running applications out."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from cosmic.app.hosting import Site, build_daqco, build_mico, build_vico
from cosmic.app.platform_file import KNOWN_APPLICATIONS, PlatformFile, load_platform, load_twin
from cosmic.autonomy.couplings import join_teleoperation
from cosmic.autonomy.interlocks import (
    join_force_limits,
    join_positions,
    join_stage_positions,
)
from cosmic.autonomy.places import join_places
from cosmic.daqco.api.application import DaqcoApplication
from cosmic.frame.application import GuiFactory
from cosmic.frame.clock import Clock, RatedClock
from cosmic.frame.errors import ConfigError
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.api.application import MicoApplication
from cosmic.twin.sample import put_on
from cosmic.twin.scene import Scene
from cosmic.vico.api.application import VicoApplication

if TYPE_CHECKING:
    from cosmic.mico.hw.sim_scu3d_faults import Faults


@dataclass(frozen=True)
class Platform:
    """What one process runs: the applications, their clock, and the policy for failures."""

    file: PlatformFile
    path: Path
    clock: Clock
    policy: FailurePolicy
    mico: MicoApplication | None
    faults: "Faults | None" = None
    daqco: DaqcoApplication | None = None
    vico: VicoApplication | None = None

    @property
    def simulated(self) -> bool:
        """True when no hardware moves."""
        return self.file.mico.backend == "simulated"

    def initialize(self) -> None:
        """Open the hardware of every application."""
        if self.mico is not None:
            self.mico.initialize()
        if self.daqco is not None:
            self.daqco.initialize()
        if self.vico is not None:
            self.vico.initialize()

    def shut_down(self) -> None:
        """Stop and close every application; any state. Motion ends first."""
        if self.mico is not None:
            self.mico.shut_down()
        if self.daqco is not None:
            self.daqco.shut_down()
        if self.vico is not None:
            self.vico.shut_down()


def build_platform(
    config: str | Path | None = None,
    *,
    applications: tuple[str, ...] = KNOWN_APPLICATIONS,
    rate: float = 1.0,
    cold: bool = False,
    seed: int = 0,
    sample: str | None = None,
    mico_gui: GuiFactory | None = None,
    daqco_gui: GuiFactory | None = None,
    vico_gui: GuiFactory | None = None,
) -> Platform:
    """Read the configuration and make the applications; opens no hardware yet.

    Parameters
    ----------
    config : path or None
        A platform.toml or its folder; None is the one that ships with CoSMic.
    applications : tuple of str
        Which to make, as far as the platform file names them.
    rate, cold, seed, sample
        Of the simulated platform; see `cosmic.connect`.
    mico_gui, daqco_gui, vico_gui : callable or None
        Make the applications' GUI components, where there is a window.

    Raises
    ------
    ConfigError
        The configuration is wrong, or a rate other than 1 was asked for real hardware.
    NotConnectedError
        The vendor library is not there.
    """
    file, path = load_platform(config)
    simulated = file.mico.backend == "simulated"
    if not simulated and (rate != 1.0 or cold or sample is not None):
        raise ConfigError(
            f"{path}: mico.backend: only the simulated platform has a rate, --cold or --sample"
        )
    if rate != 1.0 and file.daqco is not None and file.daqco.backend != "simulated":
        raise ConfigError(f"{path}: daqco.backend: real boards have no rate; leave --rate out")
    try:
        clock = RatedClock(rate)
    except (TypeError, ValueError) as exc:
        raise ConfigError(f"rate: {exc}") from None
    scene = None
    if simulated:
        twin = load_twin(file, path)
        twin = twin if sample is None else put_on(twin, sample, seed)
        scene = Scene.from_settings(twin, clock, seed=seed, cold=cold, folder=path.parent)
    site = Site(file, path, clock, FailurePolicy(), scene, seed)
    hosted = [name for name in applications if name in file.platform.applications]
    mico, faults, daqco, vico = None, None, None, None
    if "mico" in hosted:
        mico, faults = build_mico(site, mico_gui)
    if "daqco" in hosted and file.daqco is not None:
        daqco = build_daqco(site, file.daqco, daqco_gui)
    if "vico" in hosted and file.vico is not None:
        vico = build_vico(site, file.vico, vico_gui)
    if daqco is not None and mico is not None:
        join_force_limits(daqco, mico)
        join_teleoperation(mico, daqco)
        join_positions(daqco.recorder, mico, clock)
    if vico is not None and mico is not None:
        join_stage_positions(vico, mico)
        kept_in = vico.settings.calibration
        join_places(vico, mico, path.parent / kept_in if kept_in else None)
    return Platform(
        file=file,
        path=path,
        clock=clock,
        policy=site.policy,
        mico=mico,
        faults=faults,
        daqco=daqco,
        vico=vico,
    )
