"""A platform as its files describe it: configuration in, running applications out."""

import logging
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Final

from cosmic.app.applications import Site
from cosmic.app.configuration.network import own_certificates
from cosmic.app.configuration.platform_file import KNOWN_APPLICATIONS, PlatformFile, load_platform
from cosmic.app.configuration.references import misnamed
from cosmic.app.garbage_watch import GarbageWatch
from cosmic.app.simulation import SimulationFaults, make_scene
from cosmic.app.stations.address import StationAddress
from cosmic.app.stations.hosting import build_applications
from cosmic.app.stations.joins import join_here, join_stations, join_vision
from cosmic.app.stations.remote_applications import RemoteApplications, open_stations
from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.api.daqco import Daqco
from cosmic.frame.application import CosmicApplicationBase, GuiFactory
from cosmic.frame.c_memory import share_one_arena
from cosmic.frame.clock import Clock, RatedClock
from cosmic.frame.errors import ArgumentError, ConfigError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.network.application import RemoteApplication
from cosmic.frame.platform_services import tick_finely
from cosmic.frame.plugins import Kind, is_simulated, missing_packages
from cosmic.frame.threads import share_interpreter
from cosmic.mico.api.application_base import MicoApplicationBase
from cosmic.mico.api.mico import Mico, mico_of
from cosmic.twin.scene import Scene
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.vico import Vico

logger = logging.getLogger(__name__)

LARGEST_SEED: Final = 2**63 - 1
RESET_SINCE: Final = "it was stopped, and the stop was reset since"


@dataclass(frozen=True)
class Platform:
    """What one process runs: the applications, their clock, and the policy for failures.

    An application that another station hosts stands in the place of one of its own.

    Attributes
    ----------
    seed : int
        Of everything random in the simulated platform.
    others : mapping of str to CosmicApplicationBase
        Applications of other packages that run here, by name.
    failed : mapping of str to str
        Why an application that the platform file names is not there.
    sample : str
        What lies on the simulated plate; empty for the fibres that twin.toml lists.
    """

    file: PlatformFile
    path: Path
    clock: Clock
    policy: FailurePolicy
    mico: MicoApplicationBase | None
    seed: int = 0
    faults: SimulationFaults | None = None
    daqco: DaqcoApplication | RemoteApplication[Daqco] | None = None
    vico: VicoApplication | RemoteApplication[Vico] | None = None
    remote: RemoteApplications = field(default_factory=RemoteApplications)
    scene: Scene | None = None
    others: Mapping[str, CosmicApplicationBase] = field(default_factory=dict)
    failed: Mapping[str, str] = field(default_factory=dict)
    sample: str = ""

    @property
    def simulated(self) -> bool:
        """True when no hardware moves, neither here nor at the stations used."""
        real_here = not self.file.moves_nothing and bool(self.own)
        return not real_here and all(each.facts.simulated for each in self.remote.stations)

    @property
    def world(self) -> str:
        """Name of the simulated world; empty where no part of the twin is here."""
        return "" if self.scene is None else self.scene.world

    @property
    def own(self) -> dict[str, CosmicApplicationBase]:
        """The applications that run in this process, by name."""
        return {name: each for name, each in self._all.items() if name not in self.remote.host_of}

    @property
    def _all(self) -> dict[str, CosmicApplicationBase]:
        own = (("mico", self.mico), ("daqco", self.daqco), ("vico", self.vico))
        found = (*own, *self.others.items())
        return {name: each for name, each in found if each is not None}

    @property
    def failure(self) -> str:
        """Why MiCo, if it runs here, has no devices; empty when all is well."""
        return self.mico.failure if self.mico is not None and "mico" in self.own else ""

    def begin_remote(self) -> None:
        """Begin to use what other stations host; what they have is known when this returns."""
        for name, each in self._all.items():
            if name in self.remote.host_of:
                each.initialize()
        join_stations(self.mico, self.daqco, self.remote, self.policy)
        axes = self.mico if "mico" in self.remote.host_of else None
        if axes is not None and isinstance(self.vico, VicoApplication):
            join_vision(self.vico, axes, self.path)

    @cached_property
    def garbage(self) -> GarbageWatch:
        """Keeps garbage collection from what moves, while the platform is open."""
        own = self.daqco if isinstance(self.daqco, DaqcoApplication) else None
        mico = None if self.mico is None else mico_of(self.mico)
        return GarbageWatch(mico, own, self.policy)

    def initialize(self) -> None:
        """Open the hardware of every application that runs here."""
        for each in self.own.values():
            each.initialize()
        self.garbage.begin()

    def initialize_later(self) -> None:
        """Begin to open the hardware of every application that runs here; a window's thread."""
        self.garbage.begin(window=True)
        own = self.own.values()
        if self.mico in own and self.mico is not None:
            self.mico.initialize_later()
        if self.daqco in own and self.daqco is not None:
            self.daqco.initialize_later()
        if self.vico in own and self.vico is not None:
            self.vico.initialize()
        for each in self.others.values():
            each.initialize()

    def shut_down(self) -> None:
        """Stop and close every application; any state. Motion ends first."""
        with ExitStack() as at_end:  # from the last line to the first, whatever fails
            if self.scene is not None:
                at_end.callback(self.scene.close)
            at_end.callback(self.garbage.end)
            at_end.callback(self.remote.close)
            for each in (self.vico, self.daqco, self.mico):
                if each is not None:
                    at_end.callback(each.shut_down)
            for other in self.others.values():  # before what they may use
                at_end.callback(other.shut_down)


@dataclass(frozen=True)
class Uses:
    """Which stations elsewhere a process uses, and as whom.

    Attributes
    ----------
    stations : tuple of StationAddress
        Whose applications stand in the place of own ones.
    program : str
        What kind of program this is, such as "window": so the stations call it.
    certificates : Path or None
        Folder to prove itself with, in place of the one in the platform file.
    every : bool
        Use all that they host, and not only those among the applications asked for.
    """

    stations: tuple[StationAddress, ...] = ()
    program: str = "script"
    certificates: Path | None = None
    every: bool = True


def build_platform(
    config: str | Path | None = None,
    *,
    applications: tuple[str, ...] = KNOWN_APPLICATIONS,
    rate: float = 1.0,
    cold: bool = False,
    seed: int = 0,
    sample: str | None = None,
    truth: str | Path | None = None,
    world: str | None = None,
    uses: Uses = Uses(),
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
        Which to make, as far as the platform file names them and no station hosts them.
    rate, cold, seed, sample, truth, world
        Of the simulated platform; see `cosmic.connect`.
    uses : Uses
        Stations to connect to; the lines stand when this returns.
    mico_gui, daqco_gui, vico_gui : callable or None
        Make the applications' GUI components, where there is a window.

    Raises
    ------
    ConfigError
        The configuration is wrong, or a rate other than 1 was asked for real hardware.
    NotConnectedError
        The vendor library is not there.
    StationAway
        A station does not answer.
    """
    _prepare_process()
    file, path = load_platform(config)
    for each in missing_packages(file.platform.requires):
        logger.warning("%s: platform.requires: %s is not installed", path, each)
    _check_simulation(file, path, rate=rate, only_simulated=cold or bool(sample or truth or world))
    if not 0 <= seed <= LARGEST_SEED:
        raise ArgumentError(f"seed must be a whole number from 0 to {LARGEST_SEED}, not {seed}")
    clock = _clock(file, rate, uses)
    policy = FailurePolicy()
    guis = {"mico": mico_gui, "daqco": daqco_gui, "vico": vico_gui}
    with ExitStack() as undo:
        remote = _connect(uses, applications, file, path, policy)
        undo.callback(remote.close)
        wanted = _wanted(file, applications)
        hosted = [name for name in wanted if name not in remote.host_of]
        if mistakes := misnamed(file, path, hosted):
            raise ConfigError("\n".join(mistakes))
        scene: Scene | None = None
        if file.has_twin and hosted:
            scene = make_scene(
                file, path, clock, seed=seed, cold=cold, sample=sample, truth=truth, world=world
            )
            undo.callback(scene.close)
        site = Site(file, path, clock, policy, scene, seed)
        own = build_applications(site, hosted, guis)
        join_here(own, site)
        used = {name: remote.application(name, policy, guis[name]) for name in guis}
        platform = Platform(
            file=file,
            path=path,
            clock=clock,
            policy=policy,
            mico=own.mico or used["mico"],
            seed=seed,
            faults=own.faults,
            daqco=own.daqco or used["daqco"],
            vico=own.vico or used["vico"],
            remote=remote,
            scene=scene,
            others=own.others,
            failed=own.failed,
            sample=sample or "",
        )
        undo.callback(platform.shut_down)
        platform.begin_remote()
        undo.pop_all()
    return platform


def _prepare_process() -> None:
    """Have the interpreter, the memory and the timer of this process serve threads that wait."""
    share_interpreter()
    share_one_arena()
    if not tick_finely():
        logger.warning("Windows keeps its timer resolution of 15.6 ms: waits end up to that late")


def _clock(file: PlatformFile, rate: float, uses: Uses) -> RatedClock:
    try:
        # Where anything is real, or runs in another process, time waits for nobody here.
        return RatedClock(rate, waits=file.all_simulated and not uses.stations)
    except (TypeError, ValueError) as exc:
        raise ConfigError(f"rate: {exc}") from None


def _wanted(file: PlatformFile, applications: Sequence[str]) -> list[str]:
    """Return those of the platform file that are asked for; all three stand for the others too."""
    whole = set(KNOWN_APPLICATIONS) <= set(applications)
    return [
        name
        for name in file.platform.applications
        if name in applications or (whole and name not in KNOWN_APPLICATIONS)
    ]


def _check_simulation(file: PlatformFile, path: Path, *, rate: float, only_simulated: bool) -> None:
    if (rate != 1.0 and not file.moves_nothing) or (only_simulated and not file.has_twin):
        raise ConfigError(
            f"{path}: mico.backend: only the simulated platform has a rate, --cold, --sample, "
            "--world or --truth"
        )
    boards = file.daqco.drivers if file.daqco is not None else ()
    if rate != 1.0 and not all(is_simulated(Kind.BOARD, each.backend) for each in boards):
        raise ConfigError(f"{path}: daqco.backend: real boards have no rate; leave --rate out")


def _connect(
    uses: Uses, applications: Sequence[str], file: PlatformFile, path: Path, policy: FailurePolicy
) -> RemoteApplications:
    if not uses.stations:
        return RemoteApplications()
    return open_stations(
        uses.stations,
        policy,
        program=uses.program,
        certificates=own_certificates(file.network, path.parent, uses.certificates),
        wanted=KNOWN_APPLICATIONS if uses.every else applications,
    )


def stopped_since(mico: Mico | None) -> Callable[[], str | None]:
    """Return what gives the reason of a stop that is latched or was since the first call, or None.

    A reset allows motion again, but what was stopped before it does not go on by itself.
    """
    epoch: int | None = None

    def stopped() -> str | None:
        nonlocal epoch
        if mico is None:
            return None
        state = mico.stop_state
        if epoch is None:
            epoch = state.epoch
        if state.reason is not None:
            return state.reason
        return RESET_SINCE if state.epoch != epoch else None

    return stopped
