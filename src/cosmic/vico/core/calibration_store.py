"""A camera's calibration as a file that a person can read."""

from pathlib import Path
from typing import Annotated, Final, Literal, Self

import numpy as np
from pydantic import AwareDatetime, Field, model_validator

from cosmic.frame.config import StrictModel, load_model
from cosmic.frame.errors import ConfigError
from cosmic.frame.kept_file import toml_lines, write_whole
from cosmic.vico.core.calibration import Calibration, Plane, RotationCentre
from cosmic.vico.core.calibration_fit import (
    FEWEST_ANGLES,
    FEWEST_POINTS,
    LARGEST_RMS_PX,
    LARGEST_RMS_UM,
    MapFit,
    RotationFit,
)
from cosmic.vico.core.pixel_map import PixelMap

HEAD: Final = """\
# ViCo's calibration of one camera, written by the program when it measures.
# Pixels are those of the whole sensor, unbinned; the matrix says what a move of the platform by
# one um does in the image. Delete a [[planes]] section to have it measured anew.
"""

Pair = Annotated[tuple[float, float], Field(strict=False)]
Matrix = Annotated[tuple[Pair, Pair], Field(strict=False)]


class _Plane(StrictModel):
    """Section ``[[planes]]``."""

    zoom_counts: float
    height_um: float
    measured: AwareDatetime
    points: int = Field(ge=FEWEST_POINTS)
    residual_rms_px: float = Field(ge=0.0, le=LARGEST_RMS_PX)
    residual_max_px: float = Field(ge=0.0)
    noise_px: float = Field(ge=0.0)
    centre_um: Pair
    centre_px: Pair
    matrix_px_um: Matrix
    leverage_um2: Matrix
    axis_px: Pair = (0.0, 0.0)
    bend_px2: float = Field(default=0.0, ge=-1e-6, le=1e-6)
    outliers: Annotated[tuple[str, ...], Field(strict=False)] = ()

    @model_validator(mode="after")
    def _can_be_used(self) -> Self:
        matrix = np.array(self.matrix_px_um)
        large, small = np.linalg.svd(matrix, compute_uv=False)
        if not (small > 1e-6 and large < 1e4 and small > 0.5 * large):
            raise ValueError("matrix_px_um maps no platform to an image; measure again")
        leverage = np.array(self.leverage_um2)
        if not (np.allclose(leverage, leverage.T) and np.linalg.eigvalsh(leverage).min() > 0.0):
            raise ValueError("leverage_um2 is not the inverse of a sum of squares; measure again")
        return self

    def plane(self) -> Plane:
        """Return it as the program uses it."""
        fitted = PixelMap(
            self.matrix_px_um,
            self.centre_um,
            self.centre_px,
            self.noise_px,
            self.leverage_um2,
            self.points,
            self.axis_px,
            self.bend_px2,
        )
        fit = MapFit(fitted, self.residual_rms_px, self.residual_max_px, self.outliers)
        return Plane(self.zoom_counts, self.height_um, fit, self.measured)


class _Rotation(StrictModel):
    """Section ``[rotation]``."""

    axis: str = Field(min_length=1)
    measured: AwareDatetime
    centre_um: Pair
    centre_std_um: float = Field(ge=0.0)
    radius_um: float = Field(gt=0.0)
    residual_rms_um: float = Field(ge=0.0, le=LARGEST_RMS_UM)
    residual_max_um: float = Field(ge=0.0)
    sense: Literal[1, -1]
    angles: int = Field(ge=FEWEST_ANGLES)

    def centre(self) -> RotationCentre:
        """Return it as the program uses it."""
        fit = RotationFit(
            self.centre_um,
            self.radius_um,
            self.residual_rms_um,
            self.residual_max_um,
            self.centre_std_um,
            self.sense,
            self.angles,
        )
        return RotationCentre(self.axis, fit, self.measured)


class _File(StrictModel):
    format: Literal[1]
    camera: str = Field(min_length=1)
    planes: Annotated[tuple[_Plane, ...], Field(strict=False)] = ()
    rotation: _Rotation | None = None


def load_calibration(path: Path, camera: str) -> Calibration:
    """Read the calibration of `camera`.

    Raises
    ------
    ConfigError
        The file is missing, broken, out of bounds or another camera's; the text names the key.
    """
    found = load_model(path, _File)
    if found.camera != camera:
        raise ConfigError(
            f"{path}: camera: the file belongs to {found.camera!r}, not to {camera!r}; "
            "calibrate this camera, or choose its file"
        )
    calibration = Calibration(camera)
    for section in found.planes:
        plane = section.plane()
        calibration = calibration.with_plane(plane)
    if len(calibration.planes) != len(found.planes):
        raise ConfigError(f"{path}: planes: two of them have the same zoom and height; delete one")
    if found.rotation is not None:
        calibration = calibration.with_rotation(found.rotation.centre())
    return calibration


def save_calibration(path: Path, calibration: Calibration) -> None:
    """Write `calibration`; the old file stays whole until the new one is.

    Raises
    ------
    ConfigError
        It cannot be written there.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, calibration_text(calibration))
    except OSError as exc:
        raise ConfigError(f"{path}: cannot be written: {exc.strerror or exc}") from exc
    except ValueError as exc:
        raise ConfigError(f"{path}: a calibration holds what cannot be kept: {exc}") from exc


def calibration_text(calibration: Calibration) -> str:
    """Return `calibration` as TOML."""
    parts = [HEAD, toml_lines({"format": 1, "camera": calibration.camera})]
    parts += ["\n[[planes]]\n" + toml_lines(_plane_values(each)) for each in calibration.planes]
    if calibration.rotation is not None:
        parts.append("\n[rotation]\n" + toml_lines(_rotation_values(calibration.rotation)))
    return "".join(parts)


def _plane_values(plane: Plane) -> dict[str, object]:
    fit = plane.fit
    return {
        "zoom_counts": plane.zoom_counts,
        "height_um": plane.height_um,
        "measured": plane.measured,
        "points": fit.map.points,
        "residual_rms_px": fit.rms_px,
        "residual_max_px": fit.max_px,
        "noise_px": fit.map.noise_px,
        "centre_um": fit.map.centre_um,
        "centre_px": fit.map.centre_px,
        "matrix_px_um": fit.map.matrix_px_um,
        "leverage_um2": fit.map.leverage_um2,
        "axis_px": fit.map.axis_px,
        "bend_px2": fit.map.bend_px2,
        "outliers": fit.outliers,
    }


def _rotation_values(rotation: RotationCentre) -> dict[str, object]:
    fit = rotation.fit
    return {
        "axis": rotation.axis,
        "measured": rotation.measured,
        "centre_um": fit.centre_um,
        "centre_std_um": fit.std_um,
        "radius_um": fit.radius_um,
        "residual_rms_um": fit.rms_um,
        "residual_max_um": fit.max_um,
        "sense": fit.sense,
        "angles": fit.angles,
    }
