"""``cosmic scene``: the check of a collision scene, and the split of a concave mesh."""

import argparse
import sys
from pathlib import Path

from cosmic.frame.errors import ConfigError
from cosmic.mico.core.collision.scene_loader import find_scene_mistakes


def run(chosen: argparse.Namespace) -> int:
    """Check a scene or split a mesh; raises `ConfigError` with a line for each mistake."""
    if chosen.task == "decompose":
        for line in decompose(chosen.mesh, chosen.folder):
            sys.stdout.write(f"{line}\n")
        return 0
    mistakes, warnings = check_scene(chosen.scene)
    for line in warnings:
        sys.stderr.write(f"cosmic: warning: {line}\n")
    if mistakes:
        raise ConfigError("\n".join(mistakes))
    sys.stdout.write(f"{chosen.scene}: ok\n")
    return 0


def check_scene(path: Path) -> tuple[list[str], list[str]]:
    """Return the mistakes and the warnings of a scene, a line each; both empty if all is well."""
    return find_scene_mistakes(path)


def decompose(mesh: Path, out_dir: Path) -> list[str]:
    """Write convex pieces of a concave mesh and return what to print about them, a line each.

    Raises
    ------
    ConfigError
        The mesh is not usable, or the pieces cannot be written.
    NotAvailable
        The library that does it is not installed.
    """
    # Imported here: it is needed for this command alone.
    from cosmic.mico.core.collision.scene_decompose import decompose_mesh

    made = decompose_mesh(mesh, out_dir)
    lines = [str(file) for file in made.files]
    lines.append(f"{len(made.files)} convex pieces of {mesh.name}")
    more = "larger" if made.volume_error >= 0.0 else "smaller"
    lines.append(f"volume: {abs(made.volume_error):.2%} {more} than the mesh")
    if made.uncovered > 0.0:
        lines.append(
            f"the mesh reaches {made.uncovered:.3g} (in the unit of its file) beyond the pieces: "
            "give the pairs of this body a margin that is larger by that"
        )
    return lines
