"""What `cosmic scene check` and `cosmic scene decompose` say."""

from pathlib import Path

from cosmic.mico.core.collision.scene_loader import find_scene_mistakes


def check_scene(path: Path) -> tuple[list[str], list[str]]:
    """Return the mistakes and the warnings of a scene, a line each; both empty if all is well."""
    return find_scene_mistakes(path)


def decompose(mesh: Path, out_dir: Path) -> list[str]:
    """Write convex pieces of a concave mesh and return what to tell about them, a line each.

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
