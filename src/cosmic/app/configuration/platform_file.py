"""What a platform.toml says, read and checked."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Final

from pydantic import Field

from cosmic.app.configuration.network import NetworkSettings
from cosmic.autonomy.control.settings import ControlSettings
from cosmic.daqco.core.settings import DaqcoSettings
from cosmic.frame.config import StrictModel, load_model, shipped_config_dir
from cosmic.frame.errors import ConfigError
from cosmic.mico.core.settings import MicoSettings
from cosmic.twin.settings import TwinSettings
from cosmic.vico.core.settings import VicoSettings

KNOWN_APPLICATIONS: Final = ("mico", "daqco", "vico")


class PlatformSettings(StrictModel):
    """Section ``[platform]`` of platform.toml."""

    name: str = Field(min_length=1)
    twin: str = "twin.toml"
    scene: str = ""
    stop_key: str = "F12"
    applications: Annotated[tuple[str, ...], Field(strict=False)] = KNOWN_APPLICATIONS


class PlatformFile(StrictModel):
    """A whole platform.toml."""

    platform: PlatformSettings
    mico: MicoSettings
    daqco: DaqcoSettings | None = None
    vico: VicoSettings | None = None
    control: ControlSettings = ControlSettings()
    network: NetworkSettings = NetworkSettings()

    @property
    def all_simulated(self) -> bool:
        """Whether no part of the platform is real; what is left out counts as simulated."""
        backends: set[str] = {self.mico.backend}
        if self.daqco is not None:
            backends |= {each.backend for each in self.daqco.drivers}
        if self.vico is not None:
            backends |= {each.backend for each in self.vico.camera}
            backends |= {self.vico.lens.backend, self.vico.light.backend} - {"none"}
        return backends == {"simulated"}


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
    unknown = [name for name in names if name not in KNOWN_APPLICATIONS]
    if unknown:
        raise ConfigError(
            f"{where}: unknown application {unknown[0]!r}; "
            f"known are {', '.join(KNOWN_APPLICATIONS)}"
        )


def load_twin(file: PlatformFile, path: Path) -> TwinSettings:
    """Read the twin that a platform file names, from the folder of that file."""
    return load_model(path.parent / file.platform.twin, TwinSettings)
