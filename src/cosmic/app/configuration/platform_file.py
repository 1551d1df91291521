"""What a platform.toml says, read and checked."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field

from cosmic.app.configuration.alarms import AlarmSettings
from cosmic.app.configuration.network import NetworkSettings
from cosmic.autonomy.control.settings import ControlSettings
from cosmic.daqco.core.settings import DaqcoSettings
from cosmic.frame.config import StrictModel, load_model, shipped_config_dir
from cosmic.frame.errors import ConfigError
from cosmic.frame.plugins import Kind, has_twin, is_simulated
from cosmic.frame.plugins import names as plugin_names
from cosmic.mico.core.settings import MicoSettings
from cosmic.twin.settings import TwinSettings
from cosmic.vico.core.settings import VicoSettings
from cosmic.vico.hw.factory import NONE

KNOWN_APPLICATIONS: Final = ("mico", "daqco", "vico")


class PlatformSettings(StrictModel):
    """Section ``[platform]`` of platform.toml."""

    name: str = Field(min_length=1)
    twin: str = "twin.toml"
    scene: str = ""
    stop_key: str = "F12"
    applications: Annotated[tuple[str, ...], Field(strict=False)] = KNOWN_APPLICATIONS
    requires: Annotated[tuple[str, ...], Field(strict=False)] = ()


class PlatformFile(StrictModel):
    """A whole platform.toml."""

    platform: PlatformSettings
    mico: MicoSettings
    daqco: DaqcoSettings | None = None
    vico: VicoSettings | None = None
    application: dict[str, dict[str, object]] = Field(default_factory=dict)
    control: ControlSettings = ControlSettings()
    network: NetworkSettings = NetworkSettings()
    alarms: AlarmSettings = AlarmSettings()

    @property
    def all_simulated(self) -> bool:
        """Whether no part of the platform is real; what is left out counts as simulated."""
        used = {(Kind.CONTROLLER, each) for each in self.mico.backends}
        if self.daqco is not None:
            used |= {(Kind.BOARD, each.backend) for each in self.daqco.drivers}
        if self.vico is not None:
            used |= {(Kind.CAMERA, each.backend) for each in self.vico.camera}
            used |= {(Kind.LENS, self.vico.lens.backend), (Kind.LIGHT, self.vico.light.backend)}
        return all(name == NONE or is_simulated(kind, name) for kind, name in used)

    @property
    def moves_nothing(self) -> bool:
        """Whether no controller is real."""
        return all(is_simulated(Kind.CONTROLLER, each) for each in self.mico.backends)

    @property
    def has_twin(self) -> bool:
        """Whether a controller moves the simulated platform, so that there is one."""
        return any(has_twin(Kind.CONTROLLER, each) for each in self.mico.backends)


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
    check_applications(file.platform.applications, f"{path}: platform.applications")
    return file, path


def check_applications(names: Iterable[str], where: str) -> None:
    """Check that each application is one there is.

    Raises
    ------
    ConfigError
        One is not.
    """
    brought = [each for each in plugin_names(Kind.APPLICATION) if each not in KNOWN_APPLICATIONS]
    known = [*KNOWN_APPLICATIONS, *brought]
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ConfigError(
            f"{where}: unknown application {unknown[0]!r}; known are {', '.join(known)}. Others "
            f"come in packages that announce them in their entry points [{Kind.APPLICATION.value}]"
        )


def load_twin(file: PlatformFile, path: Path) -> TwinSettings:
    """Read the twin that a platform file names, from the folder of that file."""
    return load_model(path.parent / file.platform.twin, TwinSettings)
