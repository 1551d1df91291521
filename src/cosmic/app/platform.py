"""A platform as its files describe it: configuration in, running applications out."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

import cosmic
from cosmic.autonomy.interlocks import join_force_limits, join_positions
from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.core.settings import DaqcoSettings
from cosmic.daqco.hw.factory import make_library
from cosmic.daqco.hw.sim_signal import Source
from cosmic.frame.application import GuiFactory
from cosmic.frame.clock import Clock, RatedClock
from cosmic.frame.config import StrictModel, load_model, shipped_config_dir
from cosmic.frame.errors import ConfigError
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.core.collision.checker import CollisionChecker, NoCollisionModel
from cosmic.mico.core.collision.collision_manager import CollisionManager
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.settings import MicoSettings
from cosmic.mico.hw.factory import make_controller, make_simulated
from cosmic.mico.hw.interface import Controller
from cosmic.twin.scene import Scene
from cosmic.twin.settings import TwinSettings

if TYPE_CHECKING:
    from cosmic.mico.hw.sim_scu3d_faults import Faults

KNOWN_APPLICATIONS: Final = ("mico", "daqco", "vico")
BUILT_APPLICATIONS: Final = ("mico", "daqco")


class PlatformSettings(StrictModel):
    """Section ``[platform]`` of platform.toml."""

    name: str = Field(min_length=1)
    twin: str = "twin.toml"
    scene: str = ""
    stop_key: str = "F12"
    applications: Annotated[tuple[str, ...], Field(strict=False)] = BUILT_APPLICATIONS


class PlatformFile(StrictModel):
    """A whole platform.toml."""

    platform: PlatformSettings
    mico: MicoSettings
    daqco: DaqcoSettings | None = None


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

    def shut_down(self) -> None:
        """Stop and close every application; any state. Motion ends first."""
        if self.mico is not None:
            self.mico.shut_down()
        if self.daqco is not None:
            self.daqco.shut_down()


def platform_path(config: str | Path | None) -> Path:
    """Return the platform file that `config` names: a file, a folder with one, or None."""
    if config is None:
        return shipped_config_dir() / "platform.toml"
    path = Path(config)
    return path / "platform.toml" if path.is_dir() else path


def load_platform(config: str | Path | None) -> tuple[PlatformFile, Path]:
    """Read and check a platform file.

    Raises
    ------
    ConfigError
        A line for every mistake, each with file, key and reason.
    """
    path = platform_path(config)
    file = load_model(path, PlatformFile)
    unknown = [name for name in file.platform.applications if name not in KNOWN_APPLICATIONS]
    if unknown:
        raise ConfigError(
            f"{path}: platform.applications: unknown application {unknown[0]!r}; "
            f"known are {', '.join(KNOWN_APPLICATIONS)}"
        )
    return file, path


def load_twin(file: PlatformFile, path: Path) -> TwinSettings:
    """Read the twin that a platform file names, from the folder of that file."""
    return load_model(path.parent / file.platform.twin, TwinSettings)


def load_checker(file: PlatformFile, path: Path) -> CollisionChecker:
    """Return the collision model that a platform file names, or the stand-in where none is named.

    Raises
    ------
    ConfigError
        The scene is wrong, or does not fit the platform; a line for every mistake.
    """
    if not file.platform.scene:
        return NoCollisionModel()
    # Imported here: what reads meshes takes its time to load.
    from cosmic.mico.core.collision.scene_loader import load_scene

    scene = load_scene(path.parent / file.platform.scene)
    mistakes = misfits(file, path, scene)
    if mistakes:
        raise ConfigError("\n".join(mistakes))
    return CollisionManager(scene, axes=(each.name for each in file.mico.positioner))


def misfits(file: PlatformFile, path: Path, scene: SceneModel) -> list[str]:
    """Return where a scene and the positioners do not fit together, a line each."""
    positioners = {each.name: each for each in file.mico.positioner}
    lines = [
        f"{path}: platform.scene: {file.platform.scene} drives {axis}, which is no positioner"
        for axis in scene.axes
        if axis not in positioners
    ]
    for index, each in enumerate(file.mico.positioner):
        where = f"{path}: mico.positioner[{index}]"
        if each.name not in scene.axes:
            lines.append(
                f"{where}.name: {each.name} moves nothing in {file.platform.scene}; add a drive"
            )
        elif each.limits is not None:
            low, high = scene.travel(each.name)
            if not low <= each.limits[0] <= each.limits[1] <= high:
                lines.append(
                    f"{where}.limits_{each.unit}: {each.limits[0]:g} to {each.limits[1]:g} reaches "
                    f"beyond the hard stops of {file.platform.scene}, {low:g} to {high:g}"
                )
    return lines


def build_platform(
    config: str | Path | None = None,
    *,
    applications: tuple[str, ...] = KNOWN_APPLICATIONS,
    rate: float = 1.0,
    cold: bool = False,
    seed: int = 0,
    mico_gui: GuiFactory | None = None,
    daqco_gui: GuiFactory | None = None,
) -> Platform:
    """Read the configuration and make the applications; opens no hardware yet.

    Parameters
    ----------
    config : path or None
        A platform.toml or its folder; None is the one that ships with CoSMic.
    applications : tuple of str
        Which to make, as far as the platform file names them.
    rate, cold, seed
        Of the simulated platform; see `cosmic.connect`.
    mico_gui, daqco_gui : callable or None
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
    if not simulated and (rate != 1.0 or cold):
        raise ConfigError(f"{path}: mico.backend: only the simulated platform has a rate or --cold")
    if rate != 1.0 and file.daqco is not None and file.daqco.backend != "simulated":
        raise ConfigError(f"{path}: daqco.backend: real boards have no rate; leave --rate out")
    try:
        clock = RatedClock(rate)
    except (TypeError, ValueError) as exc:
        raise ConfigError(f"rate: {exc}") from None
    policy = FailurePolicy()
    mico, faults, scene = None, None, None
    if simulated:
        twin = load_twin(file, path)
        scene = Scene.from_settings(twin, clock, seed=seed, cold=cold, folder=path.parent)
    if "mico" in applications and "mico" in file.platform.applications:
        controller: Controller
        if scene is not None:
            controller, faults = make_simulated(scene)
        else:
            controller = make_controller(file.mico.backend, library_path=file.mico.library)
        mico = MicoApplication(
            controller,
            file.mico,
            clock=clock,
            policy=policy,
            checker=load_checker(file, path),
            gui_factory=mico_gui,
        )
    daqco = None
    if "daqco" in applications and "daqco" in file.platform.applications and file.daqco:
        daqco = DaqcoApplication(
            make_library(
                file.daqco.backend,
                clock=clock,
                scene_sources=_sources(scene),
                clock_sources=file.daqco.clock_sources,
                seed=seed,
            ),
            file.daqco,
            clock=clock,
            policy=policy,
            software=f"CoSMic {cosmic.__version__}",
            configuration=path.read_text(encoding="utf-8"),
            gui_factory=daqco_gui,
        )
    if daqco is not None and mico is not None:
        join_force_limits(daqco, mico)
        join_positions(daqco.recorder, mico, clock)
    return Platform(
        file=file,
        path=path,
        clock=clock,
        policy=policy,
        mico=mico,
        faults=faults,
        daqco=daqco,
    )


def _sources(scene: Scene | None) -> dict[tuple[str, str], Source]:
    """Return what the twin connects to the inputs of the simulated boards."""
    if scene is None or scene.force_side is None:
        return {}
    sensors = scene.force_side.sensors
    sources: dict[tuple[str, str], Source] = {}
    for place, name in scene.settings.sensor_wiring.items():
        board, _, number = place.partition("/")
        sources[board, number] = sensors[name]
    return sources
