"""Checks of a scene that was put together: sizes, travel, and whether it stands free."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np

from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.collision.scene_findings import Findings
from cosmic.mico.core.collision.scene_settings import SceneSettings
from cosmic.mico.core.collision.scene_solid import close_pairs, placed_corners

MANY_TRIANGLES: Final = 30000
STANDS_UP_UM: Final = 10.0
_ROUNDING: Final = 1e-9


def check_model(model: SceneModel, settings: SceneSettings, path: Path, findings: Findings) -> None:
    """Check what only the whole scene shows; `path` is the scene file."""
    before = len(findings.mistakes)
    _check_sizes(model, settings, path, findings)
    _check_travel(model, path, findings)
    for key, positions in (("park", model.park), ("detour", model.detour_height)):
        _check_positions(model, key, positions, path, findings)
    _check_contacts(model, path, findings)
    triangles = sum(len(view.faces) for view in model.views)
    if triangles > MANY_TRIANGLES:
        findings.odd(
            path, f"{triangles} triangles to draw; above {MANY_TRIANGLES} the 3D view gets slow"
        )
    if len(findings.mistakes) > before:
        return
    _check_free(model, {}, f"{path}: at home, all axes at 0,", findings)
    if model.park:
        _check_free(model, dict(model.park), f"{path}: park:", findings)


def _check_sizes(
    model: SceneModel, settings: SceneSettings, path: Path, findings: Findings
) -> None:
    limits = settings.limits
    for body in model.bodies:
        corners = [piece.vertices_um for piece in model.pieces if piece.body == body]
        if not corners:
            continue
        size = float(np.ptp(np.vstack(corners), axis=0).max())
        if size > limits.largest_body_um:
            findings.wrong(
                path,
                f"link {body!r} is {size / 1e6:.6g} m large; URDF counts in metres, was it written "
                "in millimetres? Else raise limits.largest_body_um",
            )
        elif size < limits.smallest_body_um:
            findings.wrong(
                path,
                f"link {body!r} is {size:.3g} um large; has a mesh a wrong scale? "
                "Else lower limits.smallest_body_um",
            )
    for piece, corners_um in zip(model.pieces, placed_corners(model, {}), strict=True):
        far = float(np.linalg.norm(corners_um, axis=1).max())
        if not far <= limits.scene_radius_um:
            findings.wrong(
                path,
                f"link {piece.body!r} reaches {far / 1e6:.6g} m from the origin; is an <origin> in "
                "millimetres? Else raise limits.scene_radius_um",
            )


def _check_contacts(model: SceneModel, path: Path, findings: Findings) -> None:
    """Warn of a plate that may be touched with all that stands on it."""
    places = zip(model.pieces, placed_corners(model, {}), strict=True)
    tops = [float(corners[:, 2].max()) for piece, corners in places if piece.body == model.plate]
    if not tops or np.ptp(tops) <= STANDS_UP_UM:
        return
    for contact in model.contacts:
        if any(model.plate in pair for pair in contact.pairs):
            findings.odd(
                path,
                f"contact {contact.name!r} lets bodies run into all of {model.plate!r}, parts of "
                f"which differ in height by {np.ptp(tops):.0f} um; make a link of its own of what "
                "must never be touched, such as a clip",
            )


def _check_travel(model: SceneModel, path: Path, findings: Findings) -> None:
    for axis in model.axes:
        low, high = model.travel(axis)
        slack = _ROUNDING * max(1.0, abs(low), abs(high)) if np.isfinite(low + high) else 0.0
        if not low < high:
            findings.wrong(path, f"drive: the joints of {axis} leave it no travel in common")
        elif not low - slack <= 0.0 <= high + slack:
            findings.wrong(
                path,
                f"drive: {axis} cannot be at 0, its travel is {low:g} to {high:g}; "
                "correct its offset or the limits of its joint",
            )


def _check_positions(
    model: SceneModel, key: str, positions: Mapping[str, float], path: Path, findings: Findings
) -> None:
    for axis, position in positions.items():
        if axis not in model.axes:
            findings.wrong(path, f"{key}: {axis!r} has no [[drive]]; is it misspelt?")
            continue
        low, high = model.travel(axis)
        if not low <= position <= high:
            findings.wrong(
                path, f"{key}: {axis} = {position:g} is outside its travel, {low:g} to {high:g}"
            )


def _check_free(
    model: SceneModel, positions: dict[str, float], where: str, findings: Findings
) -> None:
    margins = {watched.bodies: watched.margin_um for watched in model.pairs}
    for pair, gap_um in close_pairs(model, positions):
        names = f"{pair[0]!r} and {pair[1]!r}"
        if not gap_um > 0.0:
            findings.mistakes.append(
                f"{where} {names} overlap; move one, or let them touch in the SRDF and say why"
            )
        else:
            findings.warnings.append(
                f"{where} {names} may be closer than their margin of {margins[pair]:g} um"
            )
