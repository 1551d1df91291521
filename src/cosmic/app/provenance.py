"""What this program, its platform and its files are, for the record of a campaign."""

import platform as computer
import re
import shutil
import subprocess
from collections.abc import Mapping
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any, Final

from cosmic.app.platform import Platform
from cosmic.autonomy.campaign.provenance import Provenance
from cosmic.autonomy.campaign.recipe import Recipe
from cosmic.frame.config import StrictModel
from cosmic.frame.version import __version__

NO_WORLD: Final = "plain"
_GIT_S: Final = 10.0
_NAME: Final = re.compile(r"^[\w.-]+")


def provenance_of(platform: Platform, recipe: Recipe) -> Provenance:
    """Return what a campaign by a recipe on a platform is made with."""
    simulated = platform.simulated
    file = recipe.file
    facts: dict[str, Any] = {
        "seed": platform.seed if simulated else None,
        "sample": (platform.sample if simulated else "") or file.sample.name,
        "world": platform.world if simulated else "",
        "rate": platform.clock.rate,
        "platform": platform.file.platform.name,
        "simulated": simulated,
        "operator": file.operator,
        "climate": file.climate.model_dump(),
        "sensor": file.sensor.model_dump(),
        "software": dict(software()),
    }
    return Provenance(_files(platform), _settings(platform, recipe), facts)


def _settings(platform: Platform, recipe: Recipe) -> dict[str, Any]:
    parameters = recipe.parameters
    settings: dict[str, Any] = {
        "platform": _dumped(platform.file),
        "recipe": recipe.file.model_dump(mode="json", exclude={"parameters"}),
    }
    if parameters is not None:
        settings["parameters"] = _dumped(parameters)
    return settings


def _dumped(model: StrictModel) -> dict[str, Any]:
    return model.model_dump(mode="json")


def _files(platform: Platform) -> dict[str, Path]:
    settings, folder = platform.file.platform, platform.path.parent
    named = {f"platform/{platform.path.name}": platform.path}
    if platform.scene is not None:
        twin = folder / settings.twin
        named[f"twin/{twin.name}"] = twin
        if platform.world not in ("", NO_WORLD):
            world = Path(platform.world)
            path = world if world.suffix else twin.parent / "worlds" / f"{platform.world}.toml"
            named[f"world/{path.name}"] = path
    if settings.scene:
        scene = folder / settings.scene
        for each in sorted(scene.parent.rglob("*")):
            if each.is_file():
                named[f"scene/{each.relative_to(scene.parent).as_posix()}"] = each
    return {name: path for name, path in named.items() if path.is_file()}


@cache
def software() -> Mapping[str, Any]:
    """Return the versions of CoSMic with its commit, of what it stands on, and of the system."""
    return {
        "CoSMic": __version__,
        "commit": commit(),
        "Python": computer.python_version(),
        "system": computer.platform(),
        "packages": _packages(),
    }


def _packages() -> dict[str, str]:
    found = {}
    try:
        required = metadata.requires("cosmic") or []
    except metadata.PackageNotFoundError:
        required = []
    for line in required:
        name = _NAME.match(line)
        if name is None:
            continue
        try:
            found[name[0]] = metadata.version(name[0])
        except metadata.PackageNotFoundError:
            continue
    return dict(sorted(found.items()))


def commit() -> str:
    """Return the commit that runs, with "changed" where files differ from it; "" if unknown."""
    git, folder = shutil.which("git"), Path(__file__).parents[1]
    if git is None:
        return ""
    described = _asked(git, folder, "rev-parse", "HEAD")
    if not described or not _asked(git, folder, "ls-files", "__init__.py"):
        return ""
    changed = _asked(git, folder, "status", "--porcelain", "--untracked-files=no", ".")
    return f"{described}, changed" if changed else described


def _asked(git: str, folder: Path, *what: str) -> str:
    try:
        ended = subprocess.run(
            [git, "-C", str(folder), *what],
            capture_output=True,
            text=True,
            timeout=_GIT_S,
            check=False,
        )
    except (OSError, subprocess.SubprocessError):
        return ""
    return ended.stdout.strip() if ended.returncode == 0 else ""
