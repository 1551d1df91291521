"""``cosmic new-device``: a package that brings a device or a method, and passes its tests."""

import argparse
import keyword
import re
import sys
from collections.abc import Iterator
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from string import Template
from typing import Final

from cosmic.frame.errors import ConfigError
from cosmic.frame.plugins import Kind, names

KINDS: Final = {
    "controller": Kind.CONTROLLER,
    "board": Kind.BOARD,
    "camera": Kind.CAMERA,
    "lens": Kind.LENS,
    "light": Kind.LIGHT,
    "input": Kind.INPUT,
    "positioner": Kind.POSITIONER,
    "procedure": Kind.PROCEDURE,
    "analysis": Kind.ANALYSIS,
    "exporter": Kind.EXPORTER,
    "application": Kind.APPLICATION,
    "contact": Kind.CONTACT,
}
_WITH_SIMULATED: Final = ("controller", "board", "camera", "lens", "light", "input")
_TEMPLATES: Final = files("cosmic.app") / "templates"
_ENDING: Final = ".txt"


def run(chosen: argparse.Namespace) -> int:
    """Write the package into a new folder, and say what to do with it.

    Raises
    ------
    ConfigError
        The name cannot be one, is taken, the folder is there already, or cannot be written.
    """
    folder = write_package(chosen.kind, chosen.name, chosen.out or Path())
    sys.stdout.write(
        f"{folder}: a package that brings {KINDS[chosen.kind].word} {chosen.name!r}. Next:\n"
        f"  pip install -e {folder}\n"
        f"  pytest {folder}\n"
        f"  and read {folder / 'README.md'}\n"
    )
    return 0


def write_package(kind: str, name: str, out: Path) -> Path:
    """Write a package for a device of that kind into a folder of `out`, and return the folder.

    Parameters
    ----------
    kind : str
        One of `KINDS`.
    name : str
        What the platform file will say, and the name of the module.

    Raises
    ------
    ConfigError
        The name cannot be one, is taken, the folder is there already, or cannot be written.
    """
    if not re.fullmatch(r"[a-z][a-z0-9_]*", name) or keyword.iskeyword(name):
        raise ConfigError(f"{name!r} cannot be the name of a package: small letters, digits and _")
    if name == "cosmic" or name in sys.stdlib_module_names:
        raise ConfigError(f"{name!r} is the name of a module already; choose another name")
    if name in names(KINDS[kind]):
        raise ConfigError(f"there is a {KINDS[kind].word} {name!r} already; choose another name")
    dist = f"cosmic-{name.replace('_', '-')}"
    folder = out / dist
    if folder.exists():
        raise ConfigError(f"{folder} is there already; choose another name, or --out")
    words = {
        "name": name,
        "dist": dist,
        "title": name.replace("_", " ").capitalize(),
        "points": _entry_points(kind, name),
    }
    for source, path in (*_sources("common"), *_sources(kind)):
        target = folder / str(path).replace("NAME", name).removesuffix(_ENDING)
        text = Template(source.read_text(encoding="utf-8")).substitute(words)
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(text, encoding="utf-8")
        except OSError as exc:
            raise ConfigError(
                f"{target}: cannot be written ({exc.strerror or exc}); name another --out"
            ) from exc
    return folder


def _entry_points(kind: str, name: str) -> str:
    lines = [
        f'[project.entry-points."{KINDS[kind].value}"]',
        f'{name} = "{name}.backend:BACKEND"',
    ]
    if kind in _WITH_SIMULATED:
        lines.append(f'{name}_simulated = "{name}.backend:SIMULATED"')
    return "\n".join([*lines, ""])


def _sources(folder: str) -> Iterator[tuple[Traversable, Path]]:
    """Yield the templates of a folder, each with its path in the package."""
    waiting = [(_TEMPLATES / folder, Path())]
    while waiting:
        at, path = waiting.pop()
        for each in at.iterdir():
            if each.is_dir():
                waiting.append((each, path / each.name))
            elif each.name.endswith(_ENDING):
                yield each, path / each.name
